"""Which deviation of a joint encoder is named, before and after the map is learned."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from jmm_agent.learning_monitor import LearningMonitorOptions
from jmm_agent.learning_watch import LearningWatch, StepState
from jmm_agent.settling import SettlingDetector, SettlingOptions
from jmm_agent.updaters.rest_fitter import RestMemory
from jmm_agent.vision.length_drift import LengthDrift
from jmm_agent.vision.pose_errors import JointPrior


@pytest.mark.parametrize(("observations", "away", "named"), [
    (7, 10.0, False),
    (7, -30.0, True),
    (8, 10.0, True),
    (8, -10.0, True),
])  # fmt: skip
def test_a_map_with_eight_observations_is_trusted_also_if_they_were_loaded(
    observations: int, away: float, named: bool
) -> None:
    memory = SimpleNamespace(observations=[None] * observations, rests=RestMemory())
    vision: Any = SimpleNamespace(memory=memory, fired=0, dropped={}, zeroings=0)
    settling = SettlingDetector(SettlingOptions())
    watch = LearningWatch(vision, settling, ("one",), LearningMonitorOptions())
    watch.update(StepState(1.0, 0.02, True, True, "", "", {"elbow": np.radians(away)}, ""))
    assert [fault.where for fault in watch.faults] == ["elbow"] * named


@pytest.mark.parametrize(
    ("ratio", "detail"),
    [(None, None), (0.0, "check their sign"), (9.8, "9.8 times the torques of the tensions")],
)
def test_tensions_that_do_not_balance_the_loads_are_named(
    ratio: float | None, detail: str | None
) -> None:
    memory = SimpleNamespace(observations=[], rests=RestMemory(unbalanced=ratio))
    vision: Any = SimpleNamespace(memory=memory, fired=0, dropped={}, zeroings=0)
    settling = SettlingDetector(SettlingOptions())
    watch = LearningWatch(vision, settling, ("one",), LearningMonitorOptions())
    state = StepState(1.0, 0.02, True, True, "", "", {}, "")
    watch.update(state)
    assert [fault.kind for fault in watch.faults] == ["tensions_wrong"] * (detail is not None)
    assert all(detail in fault.detail for fault in watch.faults if detail)
    memory.rests = RestMemory()
    watch.update(state)
    assert watch.faults == []


def watch_of(memory: SimpleNamespace) -> LearningWatch:
    """A watch of a Vision Updater that remembers something."""
    vision: Any = SimpleNamespace(memory=memory, fired=0, dropped={}, zeroings=0)
    settling = SettlingDetector(SettlingOptions())
    return LearningWatch(vision, settling, ("one",), LearningMonitorOptions())


def test_bones_that_do_not_fit_are_named_once_with_their_errors() -> None:
    memory = SimpleNamespace(
        observations=[], rests=RestMemory(joints=JointPrior(0.003, np.radians(2.0)))
    )
    watch = watch_of(memory)
    for time in (1.0, 2.0):
        watch.update(StepState(time, 0.02, True, True, "", "", {}, ""))
    [fault] = watch.faults
    assert (fault.kind, fault.where, fault.since) == ("joints_misplaced", "bones", 1.0)
    assert "about 3 mm along each axis, and their axes by 2 deg" in fault.detail
    memory.rests = RestMemory(joints=JointPrior())
    watch.update(StepState(3.0, 0.02, True, True, "", "", {}, ""))
    assert watch.faults == []


def test_lengths_that_drift_are_named_once_with_their_speed() -> None:
    drift = LengthDrift(speed=3e-3 / 60.0)
    memory = SimpleNamespace(observations=[], rests=RestMemory(drift=drift))
    watch = watch_of(memory)
    for time in (1.0, 2.0):
        watch.update(StepState(time, 0.02, True, True, "", "", {}, ""))
    [fault] = watch.faults
    assert (fault.kind, fault.where, fault.since) == ("lengths_drift", "muscles", 1.0)
    assert "about 3 mm a minute" in fault.detail
    memory.rests = RestMemory(drift=LengthDrift(speed=1e-3 / 60.0))
    watch.update(StepState(2.5, 0.02, True, True, "", "", {}, ""))
    [fault] = watch.faults
    assert fault.since == 1.0
    assert "about 1 mm a minute" in fault.detail
    memory.rests = RestMemory()
    watch.update(StepState(3.0, 0.02, True, True, "", "", {}, ""))
    assert watch.faults == []

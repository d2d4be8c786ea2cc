"""Which deviation of a joint encoder is named, before and after the map is learned."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from jmm_agent.learning_monitor import LearningMonitorOptions
from jmm_agent.learning_watch import LearningWatch, StepState
from jmm_agent.settling import SettlingDetector, SettlingOptions


@pytest.mark.parametrize(("observations", "away", "named"), [
    (7, 10.0, False),
    (7, -30.0, True),
    (8, 10.0, True),
    (8, -10.0, True),
])  # fmt: skip
def test_a_map_with_eight_observations_is_trusted_also_if_they_were_loaded(
    observations: int, away: float, named: bool
) -> None:
    memory = SimpleNamespace(observations=[None] * observations)
    vision: Any = SimpleNamespace(memory=memory, fired=0, dropped={}, zeroings=0)
    settling = SettlingDetector(SettlingOptions())
    watch = LearningWatch(vision, settling, ("one",), LearningMonitorOptions())
    watch.update(StepState(1.0, 0.02, True, True, "", "", {"elbow": np.radians(away)}, ""))
    assert [fault.where for fault in watch.faults] == ["elbow"] * named

"""Causes of the servo of a tendon, on a finger that is simulated without code of the package."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap import Options, Verdict, diagnose
from reality_gap.causes.base import Location
from reality_gap.causes.support.drives import OF_TENDON
from reality_gap.simulation.hypothesis import build
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.system import compile_system
from tests.reality_gap.causes import hidden_finger
from tests.reality_gap.causes.candidates import candidate
from tests.reality_gap.causes.hidden_finger import Finger, make_study

EFFECTS: list[tuple[str, str, dict[str, float]]] = [
    ("SlowWinch", "speed_limit", {"slowness": 1 / 0.015}),
    ("SoftWinch", "position_gain", {"excess": -0.4}),
    ("DampedWinch", "velocity_gain", {"excess": 1.0}),
    ("DeadWinch", "dead_zone", {"half_width": 4e-4}),
    ("WeakAtSpeed", "torque_speed_curve", {"drop": 1 / 0.15}),
]
"""Machine, and the id and values of its cause."""


def rms(values: object) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize(("machine", "id", "values"), EFFECTS)
def test_a_cause_is_what_the_servo_of_a_tendon_does(
    machine: str, id: str, values: dict[str, float], tmp_path: Path
) -> None:
    real: Finger = getattr(hidden_finger, machine)(seconds=4.0)
    with Replayer(make_study(real, tmp_path)) as replayer:
        one = candidate(replayer.system, id, "winch (of a tendon)")
        before, after = (rms(r) for r in replayer.residuals([[], [(one, values)]]))

    assert before > 2.0
    assert after**2 < 0.12 * before**2


def test_a_finger_without_an_effect_is_its_model(tmp_path: Path) -> None:
    with Replayer(make_study(Finger(seconds=4.0), tmp_path)) as replayer:
        assert rms(replayer.residual([])) < 1.4


@pytest.mark.parametrize(
    ("speed", "low", "high"), [(-0.01, -30.0, -20.0), (-0.04, 0.0, 0.0), (0.02, -40.0, -20.0)]
)
def test_a_least_tension_is_not_kept_at_a_speed_that_the_motor_cannot_reach(
    tmp_path: Path, speed: float, low: float, high: float
) -> None:
    study = make_study(Finger(seconds=0.5), tmp_path)
    study.model.write_text(
        study.model.read_text().replace('forcerange="-40.0 0"', 'forcerange="-40 -20"')
    )
    system = compile_system(study)
    one = candidate(system, "torque_speed_curve", Location("actuator", ("winch",), OF_TENDON))
    plant = build(system, [(one, {"drop": 1 / 0.04})])
    model = plant.spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_fwdPosition(model, data)
    arms = data.ten_J[: model.nv]
    data.qvel[:] = speed * arms / (arms @ arms)
    plant.effects.hooks[0].make(model)(model, data)

    np.testing.assert_allclose(model.actuator("winch").forcerange, [low, high], atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("machine", "id", "values"), EFFECTS)
def test_an_effect_gets_its_name(
    machine: str, id: str, values: dict[str, float], tmp_path: Path
) -> None:
    study = make_study(getattr(hidden_finger, machine)(), tmp_path)
    found = diagnose(study, options=Options(suggest=False))

    assert [one.candidate.cause.id for one in found.causes] == [id]


@pytest.mark.slow
def test_a_finger_without_an_effect_gets_no_name(tmp_path: Path) -> None:
    found = diagnose(make_study(Finger(), tmp_path), options=Options(suggest=False))

    assert found.verdict is Verdict.NOTHING_WRONG

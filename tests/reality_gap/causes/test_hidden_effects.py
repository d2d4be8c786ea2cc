"""Effects of machines that are simulated without code of the package, and the causes of these."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reality_gap import Options, Verdict, diagnose
from reality_gap.causes import CATALOGUE
from reality_gap.simulation.replayer import Replayer
from tests.reality_gap.causes import hidden_effects
from tests.reality_gap.causes.candidates import candidate
from tests.reality_gap.causes.hidden_arm import Machine, make_study

EFFECTS: list[tuple[str, str, str, dict[str, float]]] = [
    ("WeakAtSpeed", "torque_speed_curve", "elbow", {"drop": 0.5}),
    ("SlowServo", "speed_limit", "elbow", {"slowness": 1 / 1.2}),
    ("CoupledMotor", "motor_coupling", "elbow (with shoulder)", {"ratio": 0.15}),
    ("LinkedTip", "joint_coupling", "tip (with elbow)", {"rigidity": 5.0, "ratio": 0.6}),
    ("SticksAtRest", "stribeck_friction", "elbow", {"stiction": 0.8, "speed": 0.2}),
    ("RubbingGear", "gear_friction", "shoulder", {"coefficient": 0.25, "presliding": 4e-3}),
    ("ElasticGear", "joint_elasticity", "elbow", {"compliance": 0.01}),
    ("MirroredReading", "encoder_scale", "elbow", {"scale": -2.0}),
    ("DeadBand", "dead_zone", "elbow", {"half_width": 0.02}),
    ("DeadMotor", "dead_zone", "elbow", {"half_width": 0.4}),
    (
        "StruckArm",
        "external_force",
        "lower (at regular intervals)",
        {"z": -5.0, "start": 0.42, "duration": 0.16, "period": 1.3},
    ),
    ("FastClock", "clock_drift", "sensors", {"drift": 0.01}),
]
"""Machine, and the id, location and values of its cause."""


def rms(values: object) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize(("machine", "id", "location", "values"), EFFECTS)
def test_a_cause_is_what_the_machine_does(
    machine: str, id: str, location: str, values: dict[str, float], tmp_path: Path
) -> None:
    real: Machine = getattr(hidden_effects, machine)(seconds=4.0)
    with Replayer(make_study(real, tmp_path)) as replayer:
        one = candidate(replayer.system, id, location)
        hypotheses = [[], [(one, one.null_values() | values)]]
        before, after = (rms(r) for r in replayer.residuals(hypotheses))

    assert before > 2.0
    assert after**2 < 0.12 * before**2


@pytest.mark.parametrize("motors", [False, True])
def test_a_machine_without_an_effect_is_its_model(motors: bool, tmp_path: Path) -> None:
    with Replayer(make_study(Machine(motors, seconds=4.0), tmp_path)) as replayer:
        assert rms(replayer.residual([])) < 1.4


@pytest.mark.parametrize(
    ("chosen", "early"), [(("sensor",), 0.03), (("actuator",), 0.03)], ids=["sensors", "commands"]
)
def test_readings_may_be_stamped_before_the_commands_that_they_show(
    chosen: tuple[str, ...], early: float, tmp_path: Path
) -> None:
    """Both kinds of sensors are early, or all commands are stamped late."""
    cause = CATALOGUE["delay"]
    with Replayer(make_study(hidden_effects.EarlyStamps(seconds=4.0), tmp_path)) as replayer:
        system = replayer.system
        found = [p for p in cause.locations(system) if p.kind in chosen and len(p.elements) > 1]
        parts = [(candidate(system, "delay", location), {"delay": -early}) for location in found]
        before, after = (rms(r) for r in replayer.residuals([[], parts]))

    assert all(p.low < -early for part, _ in parts for p in part.parameters)
    assert before > 5.0
    assert after**2 < 0.12 * before**2


@pytest.mark.slow
@pytest.mark.parametrize(("machine", "id", "location", "values"), EFFECTS)
def test_an_effect_gets_its_name(
    machine: str, id: str, location: str, values: dict[str, float], tmp_path: Path
) -> None:
    study = make_study(getattr(hidden_effects, machine)(), tmp_path)
    found = diagnose(study, options=Options(suggest=False))

    assert [one.candidate.cause.id for one in found.causes] == [id]
    assert str(found.causes[0].candidate.location) == location


@pytest.mark.slow
@pytest.mark.parametrize("motors", [False, True])
def test_a_machine_without_an_effect_gets_no_name(motors: bool, tmp_path: Path) -> None:
    found = diagnose(make_study(Machine(motors), tmp_path), options=Options(suggest=False))

    assert found.verdict is Verdict.NOTHING_WRONG

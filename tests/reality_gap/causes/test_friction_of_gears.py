"""Friction that grows with the load of a gear, or falls as a joint begins to move."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from reality_gap.causes import CATALOGUE
from reality_gap.causes.gear_friction import PERIOD
from reality_gap.causes.speed_limit import followed
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.study.system import System
from reality_gap.types import Floats
from tests.reality_gap.causes.machines import arm_study, candidates_of, records

MASS, DAMPING = 90.0, 200.0
"""Of the screw's carriage [kg, N s/m]."""


def torque_study(model: Path, friction: Callable[[Floats, Floats], Floats]) -> Study:
    """A log of the efforts of a carriage, with a friction of its speed and its load."""
    time = np.arange(0.0, 12.0, 0.005)
    motion = 0.1 * np.sin(4.0 * time) + 0.05 * np.sin(7.0 * time)
    speed = 0.4 * np.cos(4.0 * time) + 0.35 * np.cos(7.0 * time)
    load = DAMPING * speed - MASS * (1.6 * np.sin(4.0 * time) + 2.45 * np.sin(7.0 * time))
    effort = load + friction(speed, load)
    channels = (
        Channel("position", "position", unit="m", noise=1e-6),
        Channel("effort", "screw", unit="N", noise=0.1, kind="effort"),
    )
    readings = (Reading(time, motion), Reading(time, effort))
    return Study(
        "screw", model, channels, (Episode("waves", time, np.zeros((len(time), 1)), readings),)
    )


def of_load(speed: Floats, load: Floats) -> Floats:
    """A fifth of the effort, which is the load plus this friction."""
    return 0.2 * np.abs(load) / (1.0 - 0.2 * np.sign(load * speed)) * np.sign(speed)


def at_rest(speed: Floats, load: Floats) -> Floats:
    """60 N at rest, which are gone at a speed of 0.2 m/s."""
    return 60.0 * np.exp(-((speed / 0.1) ** 2)) * np.sign(speed)


@pytest.mark.parametrize(
    ("id", "friction", "values"),
    [
        ("gear_friction", of_load, {"coefficient": 0.2}),
        ("stribeck_friction", at_rest, {"stiction": 60.0, "speed": 0.1}),
    ],
)
def test_efforts_show_friction_of_the_load_and_of_rest(
    systems: dict[str, System],
    id: str,
    friction: Callable[[Floats, Floats], Floats],
    values: dict[str, float],
) -> None:
    with Replayer(torque_study(systems["screw"].study.model, friction)) as replayer:
        [location] = CATALOGUE[id].locations(replayer.system)
        one = Candidate(
            CATALOGUE[id], location, CATALOGUE[id].parameters(replayer.system, location)
        )
        hypotheses = [[], [(one, one.null_values() | values)]]
        before, after = (np.sqrt(np.mean(r**2)) for r in replayer.residuals(hypotheses))

    assert before > 5.0
    assert after < 0.25 * before


def test_friction_of_a_gear_follows_the_torque_of_its_motor(systems: dict[str, System]) -> None:
    system = systems["arm"]
    one = candidates_of(system, "gear_friction")[0]
    assert one.location.elements == ("shoulder",)
    [record] = records(system, (one, one.null_values() | {"coefficient": 0.3}))
    model = record.model
    motor = record.force[:, model.actuator("shoulder").id]
    brake = record.force[:, model.actuator("gear_friction/shoulder").id]
    dof = int(model.joint("shoulder").dofadr[0])
    speed = record.qvel[:, dof]
    sliding = np.array(
        [np.abs(speed[max(0, k - 50) : k + 1]).min() > 0.3 for k in range(len(speed))]
    )
    found, expected = -brake * np.sign(speed), 0.3 * np.abs(motor)

    assert np.count_nonzero(sliding) > 50
    held = round(PERIOD / model.opt.timestep)  # the friction keeps its value for so many steps
    recent = np.stack([np.roll(expected, k) for k in range(held + 2)])
    assert np.abs(recent - found)[:, sliding].min(axis=0).max() < 0.05


def test_a_machine_of_another_size_has_other_scales(tmp_path: Path) -> None:
    """Frictions, windups and dead zones of a finger are not those of an arm."""
    sizes = []
    for name, force in (("finger", 0.01), ("arm", 100.0)):
        (tmp_path / name).mkdir()
        study = arm_study(tmp_path / name)
        text = study.model.read_text()
        for old, new in (("-8 8", f"{-force} {force}"), ("-2 2", f"{-force} {force}")):
            text = text.replace(f'forcerange="{old}"', f'forcerange="{new}"')
        study.model.write_text(text)
        with Replayer(study) as replayer:
            system = replayer.system
            found = [candidates_of(system, id)[0] for id in ("stribeck_friction",)]
            sizes.append(found[0].parameters[0].scale)

    assert sizes[1] > 10.0 * sizes[0]


def test_a_set_point_follows_at_its_speed() -> None:
    wanted = np.array([0.0, 1.0, 1.0, 1.0, -1.0, -1.0])

    np.testing.assert_allclose(followed(wanted, 0.5), [0.0, 0.5, 1.0, 1.0, 0.5, 0.0])
    assert followed(wanted, 2.0) is wanted

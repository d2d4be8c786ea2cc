"""Friction that grows with the load of a gear, or falls as a joint begins to move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reality_gap import Options, diagnose
from reality_gap.causes import CATALOGUE
from reality_gap.causes.speed_limit import followed
from reality_gap.inference.screening import Sensitivity
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.system import System
from reality_gap.types import Floats
from tests.reality_gap.causes.candidates import candidate
from tests.reality_gap.causes.carriage import Friction, carriage_study
from tests.reality_gap.causes.machines import arm_study, candidates_of, records

HELD = 0.006
"""Longest time for which the friction of a gear may stay the same [s]."""


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
    friction: Friction,
    values: dict[str, float],
) -> None:
    with Replayer(carriage_study(systems["screw"].study.model, friction=friction)) as replayer:
        [location] = CATALOGUE[id].locations(replayer.system)
        one = candidate(replayer.system, id, location)
        hypotheses = [[], [(one, one.null_values() | values)]]
        before, after = (np.sqrt(np.mean(r**2)) for r in replayer.residuals(hypotheses))

    assert before > 5.0
    print("RATIO", after / before)
    assert after < 0.25 * before


def test_large_friction_of_rest_is_named_where_three_typical_ones_would_not_show(
    systems: dict[str, System],
) -> None:
    """A joint that is hardly ever slow shows its friction of rest in few readings."""
    noise, causes = 80.0, [CATALOGUE[id] for id in ("stribeck_friction", "coulomb_friction")]
    study = carriage_study(systems["screw"].study.model, friction=at_rest)
    [episode], [position, effort] = study.episodes, study.channels
    motion, measured = episode.readings
    errors = noise * np.random.default_rng(1).standard_normal(len(measured.value))
    measured = replace(measured, value=measured.value + errors)
    study = replace(
        study,
        channels=(position, replace(effort, noise=noise)),
        episodes=(replace(episode, readings=(motion, measured)),),
    )
    changes = list[float]()

    def watch(replayer: Replayer, null: Floats, found: Sequence[Sensitivity]) -> None:
        changes.extend(s.change for s in found if s.candidate.cause.id == "stribeck_friction")

    options = Options(suggest=False)
    found = diagnose(study, causes=causes, options=options, watch=watch)

    assert max(changes) < options.visible
    assert [cause.candidate.cause.id for cause in found.causes] == ["stribeck_friction"]
    assert "stribeck_friction" not in dict(found.not_judged)


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
    held = round(HELD / model.opt.timestep)
    recent = np.stack([np.roll(expected, k) for k in range(held + 2)])
    assert np.abs(recent - found)[:, sliding].min(axis=0).max() < 0.05


def test_a_machine_of_another_size_has_other_scales(tmp_path: Path) -> None:
    """Friction of a finger is not that of an arm."""
    sizes = []
    for name, force in (("finger", 0.01), ("arm", 100.0)):
        (tmp_path / name).mkdir()
        study = arm_study(tmp_path / name)
        text, limits = study.model.read_text(), f'forcerange="{-force} {force}"'
        for old in ("-8 8", "-2 2"):
            assert f'forcerange="{old}"' in text
            text = text.replace(f'forcerange="{old}"', limits)
        study.model.write_text(text)
        with Replayer(study) as replayer:
            [stiction, *_] = candidates_of(replayer.system, "stribeck_friction")[0].parameters
            sizes.append(stiction.scale)

    assert sizes[1] > 10.0 * sizes[0]


def test_a_set_point_follows_at_its_speed() -> None:
    wanted = np.array([0.0, 1.0, 1.0, 1.0, -1.0, -1.0])

    np.testing.assert_allclose(followed(wanted, 0.5), [0.0, 0.5, 1.0, 1.0, 0.5, 0.0])
    assert followed(wanted, 2.0) is wanted

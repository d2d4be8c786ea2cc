"""Every mechanism changes the log, and the change goes to zero with the amplitude."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from hidden_plants.build import build
from hidden_plants.loop import Task, run_task
from hidden_plants.machine import Machine, load
from hidden_plants.mechanisms import MECHANISMS, resized, structures
from hidden_plants.motion import episodes
from hidden_plants.nuisance import Nuisance, mismatch_at, mismatch_size
from hidden_plants.readings import clean_readings
from hidden_plants.secret import CATALOGUE, OUTSIDE, Effect

ASSETS = Path(__file__).parents[2] / "assets" / "mjcf" / "kengoro_arm"
NOISE = {"length": 1e-4, "tension": 1.0, "marker": 1e-3}
IDS = (*CATALOGUE, *OUTSIDE)
SECONDS = 2.0
"""Duration of an episode, after a second in which it settles."""


@pytest.fixture(scope="module")
def elbow() -> Machine:
    return load("elbow", ASSETS)


@lru_cache
def plan(machine: Machine) -> tuple[np.ndarray, np.ndarray]:
    """Initial posture and targets of the first episode of a motion."""
    initial, targets = episodes(machine, 0, 20.0)[0]
    return initial, targets[: round(SECONDS / 0.02)]


def signals(machine: Machine, *effects: Effect, start: float = 14.0) -> dict[str, np.ndarray]:
    """Clean readings of one episode that begins at ``start`` in the log."""
    mismatch = mismatch_at(machine, Nuisance(), np.zeros(mismatch_size(machine)))
    robot = build(machine, mismatch, effects)
    initial, targets = plan(machine)
    time = 0.02 * np.arange(len(targets))
    trace = run_task(robot, Task(time, targets, initial, SECONDS, start))
    return clean_readings(robot, trace, time + 0.01, time[::5] + 0.01)


def distance(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> float:
    """Distance of two logs in standard deviations of their noise."""
    parts = [(one[name] - other[name]) / NOISE[name.split("_")[0]] for name in one]
    return float(np.sqrt(sum(np.sum(part**2) for part in parts)))


def visible(machine: Machine, id: str) -> Effect:
    """An effect of this id whose elements and shape make it visible."""
    choices = structures(machine, id)
    if id == "attachment_shift":
        choices = [structure for structure in choices if structure.elements == ("biceps_2",)]
    if id == "external_force":
        choices = [structure for structure in choices if structure.shape["every_episode"]]
    if id == "hard_stop":
        choices = [structure for structure in choices if structure.shape["side"] < 0.0]
    return MECHANISMS[id].effect(choices[0], MECHANISMS[id].typical)


@pytest.fixture(scope="module")
def without_effect(elbow: Machine) -> dict[str, np.ndarray]:
    return signals(elbow)


def test_every_id_has_a_mechanism() -> None:
    assert set(MECHANISMS) == set(IDS)


@pytest.mark.parametrize("id", IDS)
def test_an_effect_changes_the_log_and_a_tiny_one_does_not(
    id: str, elbow: Machine, without_effect: dict[str, np.ndarray]
) -> None:
    effect = visible(elbow, id)
    assert distance(signals(elbow, effect), without_effect) > 2.0
    tiny = resized(effect, effect.amplitude * 1e-4)
    assert distance(signals(elbow, tiny), without_effect) < 1.0
    none = resized(effect, 0.0)
    assert distance(signals(elbow, none), without_effect) == 0.0


@pytest.mark.parametrize("id", IDS)
def test_readings_stay_finite_at_the_largest_amplitude(id: str, elbow: Machine) -> None:
    bound = MECHANISMS[id].bound
    for structure in structures(elbow, id)[::3]:
        most = min(bound, structure.shape.get("most", bound))
        readings = signals(elbow, MECHANISMS[id].effect(structure, most))
        assert all(np.isfinite(values).all() for values in readings.values())
        assert max(np.abs(readings[f"length_{tendon}"]).max() for tendon in elbow.tendons) < 1.0


@pytest.mark.parametrize("id", IDS)
def test_elements_are_in_the_nominal_model(id: str, elbow: Machine) -> None:
    model = elbow.model
    names = {
        kind(i).name
        for count, kind in (
            (model.ntendon, model.tendon),
            (model.njnt, model.joint),
            (model.nsite, model.site),
            (model.nbody, model.body),
            (model.nsensor, model.sensor),
            (model.ncam, model.camera),
        )
        for i in range(count)
    }
    for structure in structures(elbow, id):
        assert set(structure.elements) <= names
        effect = MECHANISMS[id].effect(structure, MECHANISMS[id].typical)
        assert all(isinstance(value, float) for value in effect.parameters.values())
        assert resized(effect, 2.0 * effect.amplitude).parameters != effect.parameters


def test_an_elongated_tendon_stays_long(elbow: Machine) -> None:
    structure = next(s for s in structures(elbow, "wire_elongation") if not s.shape["duration"])
    effect = MECHANISMS["wire_elongation"].effect(structure, 2e-3)
    name = f"tension_{structure.elements[0]}"
    for start, changed in ((0.0, False), (16.0, True)):
        elongated, nominal = signals(elbow, effect, start=start), signals(elbow, start=start)
        assert (np.abs(elongated[name] - nominal[name])[0] > 5.0) == changed
        assert (distance(elongated, nominal) > 0.0) == changed


def test_a_delay_of_commands_shifts_the_log_by_the_delay(elbow: Machine) -> None:
    structure = structures(elbow, "delay")[0]
    delayed = signals(elbow, MECHANISMS["delay"].effect(structure, 0.06))
    prompt = signals(elbow)
    difference = np.abs(delayed["length_biceps"] - prompt["length_biceps"])
    shifted = np.abs(delayed["length_biceps"][3:] - prompt["length_biceps"][:-3])
    assert shifted.max() < 0.1 * difference.max()


def test_an_unknown_effect_is_an_error_that_lists_the_valid_ones(elbow: Machine) -> None:
    with pytest.raises(ValueError, match="unknown effect 'rust'; valid are: coulomb_friction"):
        signals(elbow, Effect("rust", (), {}, 1.0))


def test_two_effects_on_one_tendon_commute(elbow: Machine) -> None:
    pair = [
        MECHANISMS[id].effect(structures(elbow, id)[0], MECHANISMS[id].typical)
        for id in ("tendon_elasticity", "viscous_friction")
    ]
    both, alone = signals(elbow, *pair), signals(elbow, pair[0])
    assert distance(both, signals(elbow, *reversed(pair))) == 0.0
    assert distance(both, alone) > 2.0

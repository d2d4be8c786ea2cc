"""Hidden effects on machines of all kinds: nothing at amplitude 0, and visible above."""

from __future__ import annotations

from functools import lru_cache
from typing import cast

import numpy as np
import pytest

from hidden_plants.secret import Effect
from hidden_plants.strangers import Oracle, Secret, make_stranger, sample_secret
from hidden_plants.strangers.mechanisms import ADDED, MECHANISMS, OUTSIDE, build, mechanism_of
from hidden_plants.strangers.mechanisms.mechanism import Structure
from hidden_plants.strangers.mismatch import mismatch_at, mismatch_size
from hidden_plants.strangers.oracle import THRESHOLD
from hidden_plants.strangers.readings import run, whitened
from hidden_plants.strangers.stranger import Stranger
from hidden_plants.strangers.truth import true_size
from hidden_plants.types import Floats

SEEDS = (3, 6, 8, 5, 7, 10)
"""Motors, servos, servos with friction, two with tendons, and a log of torques."""
STEP = 0.0025


@lru_cache(maxsize=32)
def stranger(seed: int) -> Stranger:
    return make_stranger(seed, 3.0)


def readings(machine: Stranger, effects: tuple[Effect, ...]) -> Floats:
    none = mismatch_at(machine, np.zeros(mismatch_size(machine)))
    return whitened(machine, run(machine, none, effects, STEP))


@lru_cache(maxsize=8)
def oracle_of(seed: int) -> Oracle:
    return Oracle(stranger(seed))


@lru_cache(maxsize=8)
def usual(seed: int) -> Floats:
    return readings(stranger(seed), ())


def structures(id: str) -> list[tuple[int, Structure]]:
    """The first structure of a mechanism on each machine that has one."""
    found = []
    for seed in SEEDS:
        own = MECHANISMS[id].structures(stranger(seed), np.random.default_rng(1))
        found += [(seed, own[0])] if own else []
    return found


@pytest.mark.parametrize("id", MECHANISMS)
def test_an_effect_is_invisible_at_zero_and_visible_above(id: str) -> None:
    found = structures(id)
    assert found, f"no machine of the test shows {id}"
    for seed, structure in found[:1]:
        zero = readings(stranger(seed), (structure.at(0.0),))
        np.testing.assert_array_equal(zero, usual(seed))
        shown = readings(stranger(seed), (structure.at(1.5 * structure.size),))
        assert np.abs(shown - usual(seed)).max() > 1.0, (id, seed)


@pytest.mark.parametrize("id", ["length_scale", "length_offset"])
def test_encoders_of_more_tendons_than_joints_have_effects(id: str) -> None:
    machine = stranger(5)
    assert len(machine.moved) > len(machine.joints)
    none = mismatch_at(machine, np.zeros(mismatch_size(machine)))
    for structure in MECHANISMS[id].structures(machine, np.random.default_rng(1)):
        plant = build(machine, none, (structure.at(structure.size),), STEP)
        changed = (plant.scale != 1.0) | (plant.offset != 0.0)
        assert [machine.moved[i] for i in np.flatnonzero(changed)] == list(structure.elements)


def test_an_unknown_effect_is_named() -> None:
    with pytest.raises(ValueError, match="unknown effect 'rust'; valid are: coulomb_friction"):
        mechanism_of(Effect("rust", (), {}, 1.0))


def test_the_floor_is_where_the_oracle_just_sees_an_effect() -> None:
    machine, oracle = stranger(8), oracle_of(8)
    structure = next(
        s
        for s in MECHANISMS["servo_kp"].structures(machine, np.random.default_rng(1))
        if s.elements == ("m_j1",)
    )
    floor = oracle.floor(structure)
    assert oracle.distance(structure.at(floor)) == pytest.approx(THRESHOLD, rel=0.15)
    assert oracle.distance(structure.at(10.0 * floor)) > 5.0 * THRESHOLD


def test_mismatches_of_the_same_kind_raise_the_floor() -> None:
    """A gain within the tolerance of gains is not visible, however exact the encoders are."""
    machine, oracle = stranger(8), oracle_of(8)
    structures = MECHANISMS["servo_kp"].structures(machine, np.random.default_rng(1))
    assert oracle.floor(structures[0]) > 0.01


@pytest.mark.parametrize(("kind", "count"), [("single", 1), ("pair", 2), ("null", 0)])
def test_secrets_hold_as_many_effects_as_their_kind(kind: str, count: int) -> None:
    secret = sample_secret(np.random.default_rng(2), stranger(3), oracle_of(3), kind)
    ids = {effect.id for effect in secret.effects}
    assert len(ids) == count
    assert not ids & set(OUTSIDE)
    assert all(2.0 <= m <= 50.0 or m == float("inf") for m in secret.multiples)


def test_an_effect_outside_the_catalogue_is_one_of_those() -> None:
    secret = sample_secret(np.random.default_rng(2), stranger(3), oracle_of(3), "outside")
    assert secret.effects[0].id in OUTSIDE


def test_unknown_kinds_and_effects_are_refused() -> None:
    machine, rng, oracle = stranger(3), np.random.default_rng(2), oracle_of(3)
    with pytest.raises(ValueError, match="unknown kind 'triple'; valid are: single"):
        sample_secret(rng, machine, oracle, "triple")
    with pytest.raises(ValueError, match="unknown effect 'rust'"):
        sample_secret(rng, machine, oracle, "single", "rust")


def test_a_true_size_includes_the_mismatch_of_the_machine() -> None:
    machine = stranger(6)
    effect = Effect("link_mass", ("link2",), {"sign": 1.0, "size": 0.5}, 0.5)
    found = true_size(machine, effect)
    nominal = float(machine.model.body("link2").mass[0])
    assert found is not None
    assert 0.0 < abs(found - 0.5) <= 0.02 * nominal + 0.5 * 0.02


def test_a_payload_moves_the_centre_of_mass_and_keeps_the_sum() -> None:
    machine = stranger(6)
    none = mismatch_at(machine, np.zeros(mismatch_size(machine)))
    link = machine.skeleton.links[machine.skeleton.ends[0]]
    shape = {"at": link.length, "size": 2.0 * link.mass}
    plant = build(machine, none, (Effect("payload", (link.body,), shape, 1.0),), STEP)
    body, nominal = plant.model.body(link.body), machine.model.body(link.body)
    assert float(body.mass[0]) == pytest.approx(float(nominal.mass[0]) + 2.0 * link.mass)
    centre = float(nominal.mass[0]) * nominal.ipos + 2.0 * link.mass * np.array([link.length, 0, 0])
    np.testing.assert_allclose(body.ipos, centre / float(body.mass[0]), rtol=1e-9)


class NoOracle:
    """Floors that need no simulation."""

    def floor(self, structure: Structure) -> float:
        return structure.size


def secret_of(seed: int, kind: str) -> Secret:
    rng = np.random.default_rng([seed, 7])
    return sample_secret(rng, stranger(seed), cast(Oracle, NoOracle()), kind)


@pytest.mark.parametrize("kind", ["single", "pair", "outside"])
def test_effects_that_were_added_later_leave_other_trials_as_they_were(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hidden_plants.strangers.sampling._is_sound", lambda *one: True)
    after = {seed: secret_of(seed, kind) for seed in range(24)}
    monkeypatch.setattr(
        "hidden_plants.strangers.sampling.MECHANISMS",
        {id: one for id, one in MECHANISMS.items() if id not in ADDED},
    )
    before = {seed: secret_of(seed, kind) for seed in range(24)}
    kept = [s for s in after if not {e.id for e in after[s].effects} & set(ADDED)]

    assert len(kept) > 10
    assert all(after[seed] == before[seed] for seed in kept)
    assert (len(kept) < len(after)) == (kind != "outside")


@pytest.mark.parametrize("id", ["torque_speed_curve", "speed_limit", "dead_zone", "motor_coupling"])
def test_effects_of_motors_are_on_machines_with_motors_at_their_joints(id: str) -> None:
    kinds = {stranger(seed).traits.kind for seed, _ in structures(id)}
    assert kinds <= {"motors", "servos"}


def test_a_limit_of_speed_is_below_the_planned_speed() -> None:
    """Higher limits only delay commands, which is another effect."""
    machine = stranger(6)
    for one in MECHANISMS["speed_limit"].structures(machine, np.random.default_rng(1)):
        slowness = true_size(machine, one.at(one.least))
        assert slowness is not None
        assert slowness * one.shape["speed"] > 1.2


def test_an_elastic_gear_is_behind_what_other_effects_make_of_the_rotor() -> None:
    machine = stranger(6)
    assert machine.traits.kind == "servos"
    joint, rotor = machine.joints[-1], float(machine.design.armature[-1])
    soft = 0.05 * float(machine.travel[-1] / machine.design.peak[-1])
    gear = Effect("joint_elasticity", (joint,), {"size": soft}, soft)
    heavy = Effect("armature", (joint,), {"size": rotor}, rotor)
    alone, first, last = (
        readings(machine, effects) for effects in ((gear,), (gear, heavy), (heavy, gear))
    )

    np.testing.assert_array_equal(first, last)
    assert np.abs(first - alone).max() > 1.0

"""Machines of all kinds: nominal models, real machines and their studies."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

from hidden_plants.strangers import Oracle, make_stranger, sample_secret, write_study
from hidden_plants.strangers.mismatch import mismatch_at, mismatch_size, sample_mismatch
from hidden_plants.strangers.native import whitened_natively
from hidden_plants.strangers.readings import run, whitened
from hidden_plants.strangers.traits import MACHINE_KINDS, Traits, sample_traits

SEEDS = {"motors": 3, "servos": 6, "tendons": 5, "efforts": 10}
"""A machine of each kind."""


def many_traits() -> list[Traits]:
    return [sample_traits(np.random.default_rng(seed)) for seed in range(300)]


def test_machines_are_of_all_kinds_and_sizes() -> None:
    traits = many_traits()
    assert {t.kind for t in traits} == set(MACHINE_KINDS)
    assert {t.joints for t in traits} == set(range(1, 8))
    assert min(t.reach for t in traits) < 0.07
    assert max(t.reach for t in traits) > 1.8
    assert {t.position_bits for t in traits} == set(range(8, 25))
    assert min(t.rate for t in traits) == 20.0
    assert max(t.rate for t in traits) == 1000.0
    assert {t.integrator for t in traits} == {"Euler", "implicitfast", "RK4"}


def test_drives_suit_a_finger_and_an_industrial_arm() -> None:
    strangers = (make_stranger(seed, 3.0) for seed in (2, 11))
    limits = [float(stranger.design.limit.max()) for stranger in strangers]
    assert min(limits) < 0.1
    assert max(limits) > 1000.0


@pytest.mark.parametrize("seed", SEEDS.values())
def test_no_element_of_the_model_depends_on_its_defaults(seed: int) -> None:
    stranger = make_stranger(seed, 3.0)
    root = ElementTree.fromstring(stranger.xml)
    for defaults in root.findall("default"):
        root.remove(defaults)
    plain = mujoco.MjModel.from_xml_string(ElementTree.tostring(root).decode())
    for name in (
        *("dof_damping", "dof_armature", "dof_frictionloss", "jnt_stiffness", "qpos_spring"),
        *("geom_contype", "geom_conaffinity", "body_mass", "body_inertia", "site_pos"),
        *("tendon_stiffness", "tendon_damping", "tendon_frictionloss", "tendon_lengthspring"),
        *("actuator_gainprm", "actuator_biasprm", "actuator_forcerange", "actuator_gear"),
        *("actuator_dyntype", "actuator_ctrllimited"),
    ):
        np.testing.assert_array_equal(getattr(plain, name), getattr(stranger.model, name), name)


def test_some_models_have_defaults_that_a_careless_edit_inherits() -> None:
    stranger = next(s for s in map(make_stranger, range(20)) if s.traits.tricky_defaults)
    spec = mujoco.MjSpec.from_string(stranger.xml)
    joint = spec.worldbody.add_body(name="new").add_joint()
    assert joint.damping[0] > 0.0
    assert joint.stiffness[0] > 0.0


@pytest.mark.parametrize("kind", MACHINE_KINDS)
def test_a_machine_without_mismatch_moves_as_its_model(kind: str) -> None:
    stranger = make_stranger(SEEDS[kind], 2.0)
    assert stranger.traits.kind == kind
    none = mismatch_at(stranger, np.zeros(mismatch_size(stranger)))
    none = replace(
        none, inner_friction=0.0 * none.inner_friction, outer_friction=0.0 * none.outer_friction
    )
    real = whitened(stranger, run(stranger, none, (), 2.5e-4))
    model = whitened_natively(stranger, none, 2.5e-4)
    assert np.sqrt(np.mean((model - real) ** 2)) < 0.01 * np.std(real)


@pytest.mark.parametrize("kind", MACHINE_KINDS)
def test_machines_stay_within_their_ranges(kind: str) -> None:
    stranger = make_stranger(SEEDS[kind], 4.0)
    found = run(stranger, sample_mismatch(stranger), (), 1e-3)
    limit = np.maximum(np.abs(stranger.law.low), np.abs(stranger.law.high))
    assert found.sound
    assert np.all(found.peak <= 1.001 * limit)


def test_a_seed_determines_all_bytes(tmp_path: Path) -> None:
    for name in ("one", "other"):
        write_study(tmp_path / name, make_stranger(SEEDS["servos"], 2.0))
    write_study(tmp_path / "third", make_stranger(SEEDS["motors"], 2.0))
    files = sorted(path.name for path in (tmp_path / "one").iterdir())
    assert {"STUDY.yaml", "commands_0.csv", "model.xml", "sensors_0.csv"} <= set(files)
    for name in files:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "other" / name).read_bytes()
    assert (tmp_path / "third" / "model.xml").read_bytes() != (
        tmp_path / "one" / "model.xml"
    ).read_bytes()


def test_readings_are_multiples_of_the_steps_of_their_sensors(tmp_path: Path) -> None:
    stranger = make_stranger(SEEDS["tendons"], 2.0)
    write_study(tmp_path, stranger)
    table = np.genfromtxt(tmp_path / "sensors_0.csv", delimiter=",", names=True)
    for sensor in stranger.sensors:
        counts = table[sensor.name] / sensor.quantum
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-3)


def test_a_machine_that_leaves_its_ranges_by_itself_is_no_null(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    machine = make_stranger(3, 2.0)
    oracle = Oracle(machine)
    monkeypatch.setattr("hidden_plants.strangers.sampling._is_sound", lambda *_: False)

    with pytest.raises(ValueError, match="machine 3 leaves its ranges with no effect"):
        sample_secret(np.random.default_rng(0), machine, oracle, "null")

"""Catalogue of causes: its ids, and what holds for all causes."""

from __future__ import annotations

import dataclasses
import textwrap
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from reality_gap.causes import CATALOGUE, MODULES, base, find_cause, register_cause
from reality_gap.causes.base import Effects
from reality_gap.errors import StudyError, UnknownNameError
from reality_gap.simulation.hypothesis import Candidate, build
from reality_gap.study.system import System
from tests.reality_gap.causes.machines import candidates_of, predict, towards_null

IDS = (
    "tendon_elasticity",
    "wire_elongation",
    "coulomb_friction",
    "viscous_friction",
    "load_dependent_friction",
    "direction_dependent_friction",
    "backlash",
    "slack",
    "actuator_lag",
    "delay",
    "force_scale",
    "attachment_shift",
    "missing_wrapping",
    "force_offset",
    "length_offset",
    "length_scale",
    "tension_offset",
    "tension_scale",
    "link_mass",
    "centre_of_mass",
    "payload",
    "joint_stiffness",
    "joint_offset",
    "gravity_direction",
    "external_force",
    "marker_offset",
    "camera_mounting",
    "camera_focal",
    "position_gain",
    "velocity_gain",
    "command_gain",
    "gear_ratio",
    "velocity_feedforward",
    "armature",
    "gravity_compensation",
    "encoder_scale",
    "force_limit",
    "effort_scale",
    "effort_offset",
    "torque_speed_curve",
    "speed_limit",
    "coupling_ratio",
    "joint_coupling",
    "motor_coupling",
    "stribeck_friction",
    "gear_friction",
    "joint_elasticity",
    "dead_zone",
    "clock_drift",
    "motor_side_friction",
)
"""Ids that are part of the interface: verdicts and extended models contain them."""


def same(one: mujoco.MjModel, other: mujoco.MjModel) -> bool:
    """Whether two models are identical in every array, and in their options."""
    names = [n for n in dir(one) if isinstance(getattr(one, n), np.ndarray)]
    arrays = all(
        getattr(one, n).shape == getattr(other, n).shape
        and getattr(one, n).tobytes() == getattr(other, n).tobytes()
        for n in names
    )
    return arrays and np.array_equal(one.opt.gravity, other.opt.gravity)


def test_the_ids_of_the_catalogue_stay() -> None:
    assert set(IDS) <= set(CATALOGUE)
    assert all(cause.id == id for id, cause in CATALOGUE.items())


def test_each_file_of_the_folder_is_in_the_catalogue_under_its_name() -> None:
    assert base.__file__ is not None
    files = {path.stem for path in Path(base.__file__).parent.glob("*.py")}
    assert files - {"__init__", "base"} == set(MODULES) == set(CATALOGUE)
    assert len(MODULES) == len(CATALOGUE)


def test_the_example_of_the_documentation_is_a_cause(systems: dict[str, System]) -> None:
    assert base.__doc__ is not None
    code = [line for line in base.__doc__.splitlines() if line.startswith("    ") or not line]
    namespace: dict[str, Any] = {}
    exec(textwrap.dedent("\n".join(code)), namespace)
    cause, system = namespace["CAUSE"], systems["elbow"]
    (location,) = cause.locations(system)
    candidate = Candidate(cause, location, cause.parameters(system, location))
    model = build(system, [(candidate, {"excess": 0.5})]).spec.compile()
    assert model.opt.gravity == pytest.approx(1.5 * system.model.opt.gravity)


@pytest.mark.parametrize("id", CATALOGUE)
def test_a_null_leaves_the_model_identical(systems: dict[str, System], id: str) -> None:
    for system in systems.values():
        null = system.study.spec().compile()
        for candidate in candidates_of(system, id):
            held = towards_null(candidate, 0.0)
            spec, effects = system.study.spec(), Effects()
            if candidate.cause.edit is not None:
                candidate.cause.edit(spec, system, candidate.location, held)
            assert same(spec.compile(), null), str(candidate)
            plant = build(system, [(candidate, candidate.null_values())])
            assert plant.effects == effects, str(candidate)
            assert same(plant.spec.compile(), null), str(candidate)


@pytest.mark.parametrize("id", CATALOGUE)
def test_towards_null_the_replay_converges(systems: dict[str, System], id: str) -> None:
    shown = 0.0
    nulls = {name: predict(systems[name]) for name in ("elbow", "arm", "hand")}
    found = [(name, c) for name in nulls for c in candidates_of(systems[name], id)]
    for name, candidate in found:
        system, null = systems[name], nulls[name]
        far, near, nearer, none = (
            float(np.sqrt(np.mean((predict(system, (candidate, values)) - null) ** 2)))
            for values in (towards_null(candidate, share) for share in (1.0, 0.1, 0.01, 0.0))
        )
        shown = max(shown, far)
        assert near < 0.55 * far + 1e-6, str(candidate)
        assert nearer < 0.55 * near + 1e-6, str(candidate)
        assert none < 1e-6, str(candidate)
    assert shown > 0.05, f"{id} shows in no channel"


@pytest.mark.parametrize("id", CATALOGUE)
def test_parameters_are_sound(systems: dict[str, System], id: str) -> None:
    for system in systems.values():
        for location in CATALOGUE[id].locations(system):
            parameters = CATALOGUE[id].parameters(system, location)
            assert len({p.name for p in parameters}) == len(parameters) > 0
            for p in parameters:
                assert p.scale != 0
                assert p.tolerance >= 0
                assert p.low <= p.null <= p.high, f"{id} at {location}: {p}"
                assert p.low <= p.null + p.scale <= p.high, f"{id} at {location}: {p}"
                assert all(p.low <= start <= p.high for start in p.hints.starts)


def test_a_registered_cause_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("reality_gap.causes.CATALOGUE", dict(CATALOGUE))
    own = dataclasses.replace(CATALOGUE["coulomb_friction"], id="stiction")
    assert register_cause(own) is own
    assert find_cause("stiction") is own
    with pytest.raises(StudyError, match="already a cause 'stiction'"):
        register_cause(own)


def test_the_error_on_an_unknown_cause_lists_the_known_ones() -> None:
    with pytest.raises(UnknownNameError, match=r"'gremlins'.*tendon_elasticity"):
        find_cause("gremlins")

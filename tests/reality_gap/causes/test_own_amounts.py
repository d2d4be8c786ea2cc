"""Causes that act on all joints, on each by an amount of its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reality_gap import CATALOGUE, Diagnosis, Options, Study, Verdict, diagnose
from reality_gap.causes.base import Location
from reality_gap.causes.support.own_amounts import OWN
from reality_gap.inference.forward_selection import without_covered
from reality_gap.inference.gauss_newton import fit
from reality_gap.inference.likelihood import independent_noise
from reality_gap.inference.problem import Problem
from reality_gap.inference.ranking import rank, rank_by_remainder
from reality_gap.inference.screening import screen
from reality_gap.simulation.hypothesis import Hypothesis, build
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.system import System, compile_system
from reality_gap.types import Floats
from tests.reality_gap.causes.candidates import candidate
from tests.reality_gap.moved_arm import JOINTS, Machine, moved_arm

FRICTION = {"shoulder": 3.0, "elbow": 1.2, "wrist": 0.06}
ROTORS = {"shoulder": 0.3, "elbow": 0.08, "wrist": 0.004}
ALL = Location("joint", JOINTS, OWN)


@pytest.fixture
def study(tmp_path: Path) -> Study:
    return moved_arm(tmp_path, Machine(friction=FRICTION))


def diagnosed(study: Study, *ids: str) -> Diagnosis:
    causes = [CATALOGUE[id] for id in ids] or None
    return diagnose(study, causes=causes, options=Options(suggest=False))


@pytest.mark.parametrize(
    ("id", "attribute"),
    [
        ("coulomb_friction", "dof_frictionloss"),
        ("viscous_friction", "dof_damping"),
        ("armature", "dof_armature"),
    ],
)
def test_each_joint_has_an_amount_of_its_own(study: Study, id: str, attribute: str) -> None:
    system = compile_system(study)
    one = candidate(system, id, ALL)

    before, after = (_values(system, attribute, parts) for parts in ([], [(one, FRICTION)]))

    assert [p.name for p in one.parameters] == list(JOINTS)
    np.testing.assert_allclose(after - before, list(FRICTION.values()))


def _values(system: System, attribute: str, parts: Hypothesis) -> Floats:
    return np.array(getattr(build(system, parts).spec.compile(), attribute))


@pytest.mark.parametrize("id", ["coulomb_friction", "viscous_friction", "armature"])
def test_a_machine_of_one_joint_has_no_such_location(systems: dict[str, System], id: str) -> None:
    found = CATALOGUE[id].locations(systems["screw"])

    assert found
    assert not any(location.note == OWN for location in found)


def test_its_effect_is_that_of_the_single_joints(study: Study) -> None:
    cause = CATALOGUE["viscous_friction"]
    with Replayer(study) as replayer:
        singles = [candidate(replayer.system, cause.id, Location("joint", (n,))) for n in JOINTS]
        own = candidate(replayer.system, cause.id, ALL)
        null = replayer.residual([])
        composed = screen(replayer, [*singles, own], null)[-1]
        [replayed] = screen(replayer, [own], null)

    assert composed.candidate.matches(own)
    assert composed.names == replayed.names == JOINTS
    np.testing.assert_allclose(composed.columns, replayed.columns, rtol=1e-4, atol=1e-5)


def test_single_joints_are_special_cases_and_not_tried_beside_it(study: Study) -> None:
    elbow = Location("joint", ("elbow",))
    with Replayer(study) as replayer:
        null = replayer.residual([])
        own, one = (candidate(replayer.system, "coulomb_friction", at) for at in (ALL, elbow))
        other = candidate(replayer.system, "viscous_friction", elbow)
        noise_model = independent_noise(replayer.measured, np.zeros((len(null), 0)))
        problem = Problem(replayer, null, noise_model)
        base = fit(problem, [(own, FRICTION)])
        sensitivities = screen(replayer, [own, one, other], null)
        ranked = [order(problem, sensitivities, base) for order in (rank, rank_by_remainder)]

    assert own.includes(one)
    assert not own.includes(other)
    assert not one.includes(own)
    for some in ranked:
        assert {r.sensitivity.candidate.cause.id for r in some} == {"viscous_friction"}


def test_amounts_of_single_joints_beside_it_are_taken_over(study: Study) -> None:
    with Replayer(study) as replayer:
        null = replayer.residual([])
        noise_model = independent_noise(replayer.measured, np.zeros((len(null), 0)))
        own = candidate(replayer.system, "coulomb_friction", ALL)
        elbow = candidate(replayer.system, "coulomb_friction", Location("joint", ("elbow",)))
        both = fit(
            Problem(replayer, null, noise_model),
            [(elbow, {"friction": 0.7}), (own, FRICTION | {"elbow": 0.5})],
        )
        [(found, values)] = without_covered(Problem(replayer, null, noise_model), both).hypothesis

    assert len(both.candidates) == 2
    assert found.matches(own)
    assert values == pytest.approx(FRICTION, rel=0.1)


def test_friction_and_rotors_of_all_joints_are_two_causes(tmp_path: Path) -> None:
    found = diagnosed(
        moved_arm(tmp_path, Machine(friction=FRICTION, rotor=ROTORS)),
        "coulomb_friction",
        "viscous_friction",
        "armature",
        "link_mass",
    )

    named = {one.candidate.cause.id: one for one in found.causes}
    assert found.verdict is Verdict.NAMED
    assert {id: one.candidate.location for id, one in named.items()} == {
        "coulomb_friction": ALL,
        "armature": ALL,
    }
    for id, truth in (("coulomb_friction", FRICTION), ("armature", ROTORS)):
        for joint, value in truth.items():
            estimate = named[id].parameters[joint]
            assert estimate.value == pytest.approx(value, rel=0.15, abs=0.002)


def test_friction_of_one_joint_is_named_there_only(tmp_path: Path) -> None:
    ids = ("coulomb_friction", "viscous_friction", "armature", "link_mass")
    found = diagnosed(moved_arm(tmp_path, Machine(friction={"elbow": 1.2})), *ids)

    [cause] = found.causes
    assert cause.candidate.location == Location("joint", ("elbow",))
    assert cause.parameters["friction"].value == pytest.approx(1.2, rel=0.05)


def test_a_machine_without_a_fault_has_none(tmp_path: Path) -> None:
    ids = ("coulomb_friction", "viscous_friction", "armature", "link_mass")
    assert diagnosed(moved_arm(tmp_path, Machine()), *ids).verdict is Verdict.NOTHING_WRONG


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_all_causes_leave_the_friction_of_all_joints_the_likeliest(
    tmp_path: Path, seed: int
) -> None:
    found = diagnosed(moved_arm(tmp_path, Machine(friction=FRICTION, rotor=ROTORS), seed=seed))

    assert found.verdict is Verdict.NAMED
    assert {(c.candidate.cause.id, c.candidate.location) for c in found.causes} == {
        ("coulomb_friction", ALL),
        ("armature", ALL),
    }

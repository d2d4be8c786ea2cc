"""Deferral: which candidates are deferred in a machine with many tendons, and when they return."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from reality_gap.causes import CATALOGUE
from reality_gap.inference.deferral import (
    CLOSER,
    MANY_TENDONS,
    Deferred,
    split_deferred,
    tendons_and_joints,
)
from reality_gap.inference.ranking import Ranked
from reality_gap.inference.screening import Sensitivity, list_candidates, screen
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Channel, Episode, Reading, Study

FINE = {
    "dead_zone",
    "direction_dependent_friction",
    "load_dependent_friction",
    "missing_wrapping",
    "motor_side_friction",
    "speed_limit",
    "stribeck_friction",
    "wire_elongation",
}
PLAIN = ("viscous_friction", "tension_offset", "joint_stiffness")


def carts(count: int) -> str:
    """Return a model of carts on separate rails, each pulled by a tendon."""
    body = '<body pos="0 {i} 0"><joint name="rail{i}" type="slide" axis="1 0 0" damping="20"/>'
    body += '<geom type="sphere" size="0.1"/><site name="cart{i}"/></body>'
    tendon = '<spatial name="tendon{i}"><site site="wall{i}"/><site site="cart{i}"/></spatial>'
    motor = '<general name="motor{i}" tendon="tendon{i}" gainprm="500" biastype="affine"'
    motor += ' biasprm="0 -500 0"/>'
    sensors = '<tendonpos name="length{i}" tendon="tendon{i}"/>'
    sensors += '<actuatorfrc name="tension{i}" actuator="motor{i}"/>'

    def each(text: str) -> str:
        return "".join(text.replace("{i}", str(i)) for i in range(count))

    return (
        '<mujoco><option timestep="0.005" integrator="implicitfast" gravity="0 0 0"/><worldbody>'
        + each('<site name="wall{i}" pos="-1 {i} 0"/>')
        + each(body)
        + "</worldbody><tendon>"
        + each(tendon)
        + "</tendon><actuator>"
        + each(motor)
        + "</actuator><sensor>"
        + each(sensors)
        + "</sensor></mujoco>"
    )


def cart_replayer(folder: Path, count: int) -> Replayer:
    """Return the replayer of two seconds of that machine; its readings are 0."""
    (folder / "carts.xml").write_text(carts(count))
    time = np.arange(0.0, 2.0, 0.02)
    channels = [
        Channel(f"{kind}{i}", f"{kind}{i}", unit=unit, noise=noise)
        for kind, unit, noise in (("length", "m", 1e-3), ("tension", "N", 1.0))
        for i in range(count)
    ]
    swing = 1.0 + 0.2 * np.sin(4 * time[:, None] + np.arange(count))
    readings = tuple(Reading(time, np.zeros(len(time))) for _ in channels)
    episode = Episode("swing", time, swing, readings)
    return Replayer(Study("carts", folder / "carts.xml", tuple(channels), (episode,)))


def all_candidates(replayer: Replayer) -> tuple[Candidate, ...]:
    return list_candidates(replayer.system, list(CATALOGUE.values()))


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Replayer:
    return cart_replayer(tmp_path_factory.mktemp("many"), MANY_TENDONS)


def ranked(
    replayer: Replayer, evidence: Sequence[float], cause: str = "viscous_friction"
) -> list[Ranked]:
    """Rank a plain cause at each tendon by given evidence."""
    plain = [
        s for s in all_candidates(replayer) if s.cause.id == cause and len(s.location.elements) == 1
    ]
    plain = [s for s in plain if s.location.kind == "tendon"][: len(evidence)]
    found = [Sensitivity(s, (), {}, np.zeros((0, 0))) for s in plain]
    together = zip(evidence, found, strict=True)
    return sorted([Ranked(e, s, np.zeros(0)) for e, s in together], key=lambda one: -one.evidence)


def test_with_few_tendons_no_candidate_is_deferred(tmp_path: Path) -> None:
    replayer = cart_replayer(tmp_path, MANY_TENDONS - 1)
    first, later = split_deferred(replayer.system, all_candidates(replayer))

    assert first == all_candidates(replayer)
    assert later == ()


def test_in_a_machine_of_many_tendons_fine_causes_at_one_element_are_deferred(
    many: Replayer,
) -> None:
    first, later = split_deferred(many.system, all_candidates(many))

    assert {s.cause.id for s in later} <= FINE
    assert {s.cause.id for s in later} >= FINE - {"missing_wrapping"}  # there is nothing to wrap
    assert all(len(s.location.elements) == 1 for s in later)
    assert {s.cause.id for s in first} >= set(PLAIN)
    assert set(first) | set(later) == set(all_candidates(many))


def test_motor_sites_and_sensors_of_a_tendon_are_located_at_it(many: Replayer) -> None:
    found: dict[str, set[frozenset[str]]] = {}
    for candidate in all_candidates(many):
        if len(candidate.location.elements) == 1 and candidate.location.elements[0].endswith("3"):
            found.setdefault(candidate.location.kind, set()).add(
                tendons_and_joints(many.system, candidate)
            )

    assert found["tendon"] == {frozenset({"tendon3"})}
    assert found["actuator"] == {frozenset({"tendon3"})}
    assert found["site"] == {frozenset({"tendon3"})}
    assert found["joint"] == {frozenset({"rail3"})}


def test_a_candidate_with_evidence_releases_the_deferred_ones_at_its_tendon(many: Replayer) -> None:
    _, later = split_deferred(many.system, all_candidates(many))
    null = many.residual([])
    deferred = Deferred(many, null, later, 0.0)
    evidence = [-1.0] * MANY_TENDONS
    evidence[2] = 5.0

    found = deferred.release(ranked(many, evidence))
    again = deferred.release(ranked(many, evidence))

    at_tendon = [s for s in later if s.location.elements in (("tendon2",), ("motor2",))]
    assert {s.location.kind for s in at_tendon} == {"tendon", "actuator"}
    assert {s.candidate for s in found} == set(at_tendon)
    assert again == ()
    expected = screen(many, at_tendon, null)
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one.columns, other.columns)


def test_only_candidates_at_the_best_tendons_are_released(many: Replayer) -> None:
    _, later = split_deferred(many.system, all_candidates(many))
    deferred = Deferred(many, many.residual([]), later, 0.0)

    found = deferred.release(ranked(many, [float(i + 1) for i in range(MANY_TENDONS)]))

    released = set[str]().union(*(tendons_and_joints(many.system, s.candidate) for s in found))
    assert released == {f"tendon{i}" for i in range(MANY_TENDONS - CLOSER, MANY_TENDONS)}


def test_without_evidence_no_candidate_is_released(many: Replayer) -> None:
    _, later = split_deferred(many.system, all_candidates(many))

    assert Deferred(many, many.residual([]), later, 0.0).release(ranked(many, [-0.1, -2.0])) == ()


def test_invisible_candidates_are_left_out(many: Replayer) -> None:
    _, later = split_deferred(many.system, all_candidates(many))

    found = Deferred(many, many.residual([]), later, np.inf).release(ranked(many, [5.0]))

    assert found == ()

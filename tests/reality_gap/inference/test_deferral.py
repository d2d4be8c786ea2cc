"""Tests of who waits in a machine of many wires, and who is called."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from reality_gap.causes import CATALOGUE
from reality_gap.inference.deferral import CLOSER, MANY_TENDONS, Waiting, locations_of, parted
from reality_gap.inference.screening import Sensitivity, candidates, screen
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Channel, Episode, Reading, Study

FINE = {
    "direction_dependent_friction",
    "load_dependent_friction",
    "missing_wrapping",
    "wire_elongation",
}
PLAIN = ("viscous_friction", "tension_offset", "joint_stiffness")


def carts(count: int) -> str:
    """So many carts on rails of their own, each pulled by a wire."""
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


def workbench(folder: Path, count: int) -> Replayer:
    """Of that machine, which swings for two seconds; readings are 0."""
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


def everybody(replayer: Replayer) -> tuple[Candidate, ...]:
    return candidates(replayer.system, list(CATALOGUE.values()))


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Replayer:
    return workbench(tmp_path_factory.mktemp("many"), MANY_TENDONS)


def ranked(
    replayer: Replayer, evidence: Sequence[float], cause: str = "viscous_friction"
) -> list[tuple[float, Sensitivity, NDArray[np.float64]]]:
    """Sensitivities of a plain cause at each wire, with made-up evidence."""
    plain = [
        s for s in everybody(replayer) if s.cause.id == cause and len(s.location.elements) == 1
    ]
    plain = [s for s in plain if s.location.kind == "tendon"][: len(evidence)]
    found = [Sensitivity(s, (), {}, np.zeros((0, 0))) for s in plain]
    together = zip(evidence, found, strict=True)
    return sorted([(e, s, np.zeros(0)) for e, s in together], key=lambda item: -item[0])


def test_in_a_machine_of_few_wires_nobody_waits(tmp_path: Path) -> None:
    replayer = workbench(tmp_path, MANY_TENDONS - 1)
    first, later = parted(replayer.system, everybody(replayer))

    assert first == everybody(replayer)
    assert later == ()


def test_in_a_machine_of_many_wires_fine_causes_at_one_spot_wait(many: Replayer) -> None:
    first, later = parted(many.system, everybody(many))

    assert {s.cause.id for s in later} <= FINE
    assert {s.cause.id for s in later} >= FINE - {"missing_wrapping"}  # there is nothing to wrap
    assert all(len(s.location.elements) == 1 for s in later)
    assert {s.cause.id for s in first} >= set(PLAIN)
    assert set(first) | set(later) == set(everybody(many))


def test_a_wire_s_motor_sites_and_sensors_are_at_its_spot(many: Replayer) -> None:
    found: dict[str, set[frozenset[str]]] = {}
    for candidate in everybody(many):
        if len(candidate.location.elements) == 1 and candidate.location.elements[0].endswith("3"):
            found.setdefault(candidate.location.kind, set()).add(
                locations_of(many.system, candidate)
            )

    assert found["tendon"] == {frozenset({"tendon3"})}
    assert found["actuator"] == {frozenset({"tendon3"})}
    assert found["site"] == {frozenset({"tendon3"})}
    assert found["joint"] == {frozenset({"rail3"})}


def test_who_promises_something_calls_whoever_waits_there(many: Replayer) -> None:
    _, later = parted(many.system, everybody(many))
    null = many.residual([])
    waiting = Waiting(many, null, later, 0.0)
    evidence = [-1.0] * MANY_TENDONS
    evidence[2] = 5.0

    found = waiting.call(ranked(many, evidence))
    again = waiting.call(ranked(many, evidence))

    at_tendon = [s for s in later if s.location.elements == ("tendon2",)]
    assert {s.candidate for s in found} == set(at_tendon)
    assert again == ()
    expected = screen(many, at_tendon, [], null)
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one.columns, other.columns)


def test_only_the_best_spots_are_looked_at(many: Replayer) -> None:
    _, later = parted(many.system, everybody(many))
    waiting = Waiting(many, many.residual([]), later, 0.0)

    found = waiting.call(ranked(many, [float(i + 1) for i in range(MANY_TENDONS)]))

    called = {name for s in found for name in s.candidate.location.elements}
    assert called == {f"tendon{i}" for i in range(MANY_TENDONS - CLOSER, MANY_TENDONS)}


def test_nobody_is_called_where_nothing_is_promised(many: Replayer) -> None:
    _, later = parted(many.system, everybody(many))

    assert Waiting(many, many.residual([]), later, 0.0).call(ranked(many, [-0.1, -2.0])) == ()


def test_what_cannot_be_seen_is_left_out(many: Replayer) -> None:
    _, later = parted(many.system, everybody(many))

    found = Waiting(many, many.residual([]), later, np.inf).call(ranked(many, [5.0]))

    assert found == ()

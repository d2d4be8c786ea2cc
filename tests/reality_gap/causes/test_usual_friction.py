"""What every machine has and its drawing lacks: friction of wires."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from reality_gap import Options, Verdict, diagnose, load_study
from reality_gap.causes import CATALOGUE, coulomb_friction
from reality_gap.causes.base import Location
from reality_gap.report.html import page
from reality_gap.simulation.hypothesis import Candidate, build
from reality_gap.simulation.replay import replay
from reality_gap.simulation.replayer import Hypothesis, Replayer
from reality_gap.study.data import Study
from reality_gap.study.measurements import measured
from reality_gap.study.system import look_at

TENDONS = ("flexor", "extensor")
USUAL = 100.0 * coulomb_friction.USUAL
"""Of motors that pull with 400 N [N]."""


def rubbing(study: Study, **friction: float) -> Hypothesis:
    """Dry friction of wires [N]."""
    cause, system = CATALOGUE["coulomb_friction"], look_at(study)
    parts = []
    for tendon, size in friction.items():
        location = Location("tendon", (tendon,))
        candidate = Candidate(cause, location, cause.parameters(system, location))
        parts.append((candidate, candidate.nulls() | {"friction": size}))
    return parts


def drawn(study: Study, **friction: float) -> Study:
    """The study with friction in its drawing [N]."""
    spec = study.spec()
    for tendon, size in friction.items():
        spec.tendon(tendon).frictionloss = size
    path = study.model.with_name("drawn.xml")
    path.write_text(spec.to_xml(), encoding="utf-8")
    return replace(study, model=path)


def residual(study: Study, parts: Hypothesis = ()) -> np.ndarray:
    """Of the workbench (n,), in units of noise, without the time step's error taken out."""
    with Replayer(study) as replayer:
        return replayer.residual(parts) + replayer.drift / replayer.measured.noise


def by_hand(study: Study, parts: Hypothesis) -> np.ndarray:
    """The same of a replay with nothing but these parts."""
    system, readings = look_at(study), measured(study)
    return (readings.value - replay(build(system, parts), study, readings).prediction) / (
        readings.noise
    )


def test_what_is_usual_goes_with_what_a_motor_can_pull(lever_study: Study) -> None:
    spec = lever_study.spec()
    spec.actuator("flexor").forcerange = (-5.0, 0.0)
    path = lever_study.model.with_name("weak.xml")
    path.write_text(spec.to_xml(), encoding="utf-8")
    weak = replace(lever_study, model=path)

    with Replayer(weak) as replayer:
        found = {s.location.elements[0]: values["friction"] for s, values in replayer.usual}

    assert found == pytest.approx({"flexor": USUAL / 40.0, "extensor": USUAL})


def test_every_replay_has_the_usual_friction(lever_study: Study) -> None:
    usual = rubbing(lever_study, flexor=USUAL, extensor=USUAL)

    np.testing.assert_allclose(residual(lever_study), by_hand(lever_study, usual), atol=1e-9)
    assert np.abs(residual(lever_study) - by_hand(lever_study, [])).max() > 0.1


@pytest.mark.parametrize(
    ("friction", "left"),
    [({"flexor": 0.4}, {"extensor": USUAL}), (dict.fromkeys(TENDONS, 0.4), {})],
)
def test_where_friction_is_drawn_none_is_usual(
    lever_study: Study, friction: dict[str, float], left: dict[str, float]
) -> None:
    study = drawn(lever_study, **friction)

    expected = by_hand(study, rubbing(study, **left))

    np.testing.assert_allclose(residual(study), expected, atol=1e-9)


def test_an_extended_model_is_a_drawing_with_friction(lever_study: Study) -> None:
    """What was added to it is known, and more of the same may be added once again."""
    system = look_at(lever_study)
    usual = rubbing(lever_study, flexor=2.0, extensor=USUAL)
    path = lever_study.model.with_name("extended.xml")
    path.write_text(build(system, usual).spec.to_xml(), encoding="utf-8")
    extended = replace(lever_study, model=path)

    # XML has six digits.
    np.testing.assert_allclose(residual(extended), by_hand(lever_study, usual), atol=1e-3)
    more = residual(extended, rubbing(extended, flexor=1.0))
    whole = by_hand(lever_study, rubbing(lever_study, flexor=3.0, extensor=USUAL))
    np.testing.assert_allclose(more, whole, atol=1e-3)


def test_a_value_is_on_top_of_what_is_usual(lever_study: Study) -> None:
    """Two sets of bristles on a wire, of 0.15 and 2 N, are one of 2.15 N."""
    whole = rubbing(lever_study, flexor=USUAL + 2.0, extensor=USUAL)

    told = residual(lever_study, rubbing(lever_study, flexor=2.0))

    np.testing.assert_allclose(told, by_hand(lever_study, whole), atol=1e-3)


def test_other_studies_are_foreseen_with_it(lever_study: Study) -> None:
    with Replayer(lever_study) as replayer:
        [found] = replayer.predictions(lever_study, [[]])
        expected = replayer.look([]).prediction / replayer.measured.noise

    np.testing.assert_allclose(found, expected)


@pytest.mark.parametrize("cause", ["tension_scale", "coulomb_friction"])
def test_an_extended_model_has_it_beside_what_was_built_in(cause: str, study_folder: Any) -> None:
    """A tension sensor shows half as much again as there is, which friction does not explain.

    The log's machine has no friction at all, so that what is named leaves much.
    """
    for log in study_folder.logs.values():
        if cause == "tension_scale" and "tension_flexor" in log:
            log["tension_flexor"] = [1.5 * tension for tension in log["tension_flexor"]]
    study = load_study(study_folder.write())

    lenient = Options(certain=np.inf, better=np.inf)
    found = diagnose(study, causes=[CATALOGUE[cause]], options=lenient)

    built = cause == "tension_scale"
    assert found.verdict is (Verdict.NAMED if built else Verdict.NOTHING_WRONG)
    for tendon in TENDONS:
        assert (f"coulomb_friction/usual/{tendon}" in found.extended_xml) is built
    assert ("it is in all replays" in page(found, study)) is built

"""Usual friction: friction of tendons that each machine has and its nominal model lacks."""

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
from reality_gap.simulation.replayer import COARSER, Hypothesis, Replayer
from reality_gap.study.data import Study
from reality_gap.study.measurements import channel_noise, measured
from reality_gap.study.system import compile_system

TENDONS = ("flexor", "extensor")
USUAL = 0.2 * 400.0 * coulomb_friction.USUAL
"""Usual friction of tendons whose motors pull with at most 400 N [N]."""


@pytest.fixture
def lever_study(lever_study: Study) -> Study:
    """Return the study with a stated noise, which does not depend on the model."""
    sizes = zip(lever_study.channels, channel_noise(lever_study), strict=True)
    return replace(lever_study, channels=tuple(replace(c, noise=float(n)) for c, n in sizes))


def friction_of(study: Study, **friction: float) -> Hypothesis:
    """Hypothesis of dry friction of tendons [N]."""
    cause, system = CATALOGUE["coulomb_friction"], compile_system(study)
    parts = []
    for tendon, size in friction.items():
        location = Location("tendon", (tendon,))
        candidate = Candidate(cause, location, cause.parameters(system, location))
        parts.append((candidate, candidate.null_values() | {"friction": size}))
    return parts


def with_nominal_friction(study: Study, **friction: float) -> Study:
    """The study with friction in its nominal model [N]."""
    spec = study.spec()
    for tendon, size in friction.items():
        spec.tendon(tendon).frictionloss = size
    path = study.model.with_name("friction.xml")
    path.write_text(spec.to_xml(), encoding="utf-8")
    return replace(study, model=path)


def residual(study: Study, parts: Hypothesis = ()) -> np.ndarray:
    """Residual of the replayer without its correction of the time step, shape (n,) [noise]."""
    with Replayer(study) as replayer:
        return replayer.residual(parts) + replayer.drift / replayer.measured.noise


def by_hand(study: Study, parts: Hypothesis) -> np.ndarray:
    """Residual of a replay with these parts only, shape (n,) [noise]."""
    system, readings = compile_system(study), measured(study)
    return (readings.value - replay(build(system, parts), study, readings).prediction) / (
        readings.noise
    )


def test_usual_friction_is_proportional_to_the_force_of_the_motor(lever_study: Study) -> None:
    spec = lever_study.spec()
    spec.actuator("flexor").forcerange = (-5.0, 0.0)
    path = lever_study.model.with_name("weak.xml")
    path.write_text(spec.to_xml(), encoding="utf-8")
    weak = replace(lever_study, model=path)

    with Replayer(weak) as replayer:
        found = {s.location.elements[0]: values["friction"] for s, values in replayer.usual}

    assert found == pytest.approx({"flexor": USUAL / 80.0, "extensor": USUAL})


def test_every_replay_has_the_usual_friction(lever_study: Study) -> None:
    usual = friction_of(lever_study, flexor=USUAL, extensor=USUAL)

    np.testing.assert_allclose(residual(lever_study), by_hand(lever_study, usual), atol=1e-9)
    assert np.abs(residual(lever_study) - by_hand(lever_study, [])).max() > 0.1


@pytest.mark.parametrize(
    ("friction", "left"),
    [({"flexor": 0.4}, {"extensor": USUAL}), (dict.fromkeys(TENDONS, 0.4), {})],
)
def test_nominal_friction_replaces_the_usual_friction(
    lever_study: Study, friction: dict[str, float], left: dict[str, float]
) -> None:
    study = with_nominal_friction(lever_study, **friction)

    expected = by_hand(study, friction_of(study, **left))

    np.testing.assert_allclose(residual(study), expected, atol=1e-9)


def test_an_extended_model_is_a_nominal_model_with_friction(lever_study: Study) -> None:
    """Friction of the extended model is nominal, and more friction can be added."""
    system = compile_system(lever_study)
    usual = friction_of(lever_study, flexor=2.0, extensor=USUAL)
    path = lever_study.model.with_name("extended.xml")
    path.write_text(build(system, usual).spec.to_xml(), encoding="utf-8")
    extended = replace(lever_study, model=path)

    # XML has six digits.
    np.testing.assert_allclose(residual(extended), by_hand(lever_study, usual), atol=1e-3)
    more = residual(extended, friction_of(extended, flexor=1.0))
    whole = by_hand(lever_study, friction_of(lever_study, flexor=3.0, extensor=USUAL))
    np.testing.assert_allclose(more, whole, atol=1e-3)


def test_a_value_is_added_to_the_usual_friction(lever_study: Study) -> None:
    """Friction of 0.15 N and friction of 2 N on a tendon are friction of 2.15 N."""
    whole = friction_of(lever_study, flexor=USUAL + 2.0, extensor=USUAL)

    found = residual(lever_study, friction_of(lever_study, flexor=2.0))

    np.testing.assert_allclose(found, by_hand(lever_study, whole), atol=1e-3)


def test_predictions_of_other_studies_include_it(lever_study: Study) -> None:
    with Replayer(lever_study) as replayer:
        [found] = replayer.predictions(lever_study, [[]])
        step = COARSER if replayer.coarse else 1.0
        expected = replayer.replay([], step).prediction / replayer.measured.noise

    np.testing.assert_allclose(found, expected)


@pytest.mark.parametrize(
    "cause", [pytest.param("tension_scale", marks=pytest.mark.slow), "coulomb_friction"]
)
def test_an_extended_model_includes_it_if_a_cause_is_named(cause: str, study_folder: Any) -> None:
    """A tension sensor reads 1.5 times the tension, which friction does not explain.

    The machine of the log has no friction, so that much of the error remains.
    """
    for log in study_folder.logs.values():
        if cause == "tension_scale" and "tension_flexor" in log:
            log["tension_flexor"] = [1.5 * tension for tension in log["tension_flexor"]]
    study = load_study(study_folder.write())

    lenient = Options(certain=np.inf, better=np.inf)
    found = diagnose(study, causes=[CATALOGUE[cause]], options=lenient)

    named = cause == "tension_scale"
    expected = Verdict.PARTLY_NAMED if named else Verdict.NOTHING_WRONG
    assert found.verdict is expected
    for tendon in TENDONS:
        assert (f"coulomb_friction/usual/{tendon}" in found.extended_xml) is named
    assert ("it is in all replays" in page(found, study)) is named

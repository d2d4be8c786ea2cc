"""Sentence of a verdict: no certainty, the equivalent causes, and advice."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import pytest

from reality_gap.causes import find_cause
from reality_gap.diagnosis import STOP, Criterion, Diagnosis, Estimate, Gain, Verdict
from reality_gap.inference.held_out import Score
from reality_gap.inference.outcome import Outcome
from reality_gap.report.sentence import sentence

Make = Callable[[Verdict], Diagnosis]


def outcome_of(diagnosis: Diagnosis) -> Outcome:
    """An outcome with the fields of a diagnosis."""
    shared = {f.name for f in fields(Outcome)} & {f.name for f in fields(Diagnosis)}
    before, after, floor = diagnosis.rms_before, diagnosis.rms_after, diagnosis.noise_floor
    score = Score(before, after, floor, None, 0.0, Gain(0.0, 0.0, 0.0))
    values = {name: getattr(diagnosis, name) for name in shared}
    return Outcome(hypothesis=[], residual=np.zeros(0), score=score, **values)


def test_a_named_cause_has_its_parameters_and_its_confidence(diagnosed: Make) -> None:
    assert sentence(outcome_of(diagnosed(Verdict.NAMED))) == (
        "Coulomb friction at flexor: friction 3 N [2.5, 3.5] (confidence 93 %). "
        "Length offset at extensor: offset 0.0025 m [0.002, 0.003] (confidence 88 %; these data "
        "cannot distinguish it from length_scale). With them in the model, 96 % of the avoidable "
        "error is gone on held-out readings."
    )


@pytest.mark.parametrize(("confidence", "text"), [(1.0, "> 99 %"), (0.9996, "> 99 %")])
def test_no_cause_is_certain(confidence: float, text: str, diagnosed: Make) -> None:
    diagnosis = diagnosed(Verdict.NAMED)
    cause = replace(diagnosis.causes[0], confidence=confidence)

    found = sentence(outcome_of(replace(diagnosis, causes=(cause,))))

    assert f"(confidence {text})" in found
    assert "100" not in found


def test_a_gain_in_likelihood_replaces_an_uncertain_gain(diagnosed: Make) -> None:
    uncertain = replace(diagnosed(Verdict.NAMED), gain=None, likelihood_gain=Gain(31.0, 20.0, 42.0))

    assert "is higher by 31 nats [20, 42]" in sentence(outcome_of(uncertain))


@pytest.mark.parametrize(
    ("ids", "measured", "expected"),
    [
        (("position_gain", "armature"), 0.0, True),
        (("position_gain", "armature"), 1.0, False),
        (("position_gain", "coulomb_friction"), 0.0, True),
        (("position_gain",), 0.0, False),
        (("armature", "coulomb_friction"), 0.0, False),
        (("position_gain", "joint_offset"), 0.0, False),
    ],
)
def test_gains_and_forces_of_a_log_of_positions_are_relative_to_the_masses(
    ids: tuple[str, ...], measured: float, expected: bool, diagnosed: Make
) -> None:
    units = {
        "position_gain": ("excess", "1"),
        "armature": ("inertia", "kg"),  # of a slide
        "coulomb_friction": ("friction", "N m"),
        "joint_offset": ("offset", "rad"),
    }
    outcome, causes = outcome_of(diagnosed(Verdict.NAMED)), []
    for id, (name, unit) in ((id, units[id]) for id in ids):
        first = outcome.causes[0]
        candidate = replace(first.candidate, cause=find_cause(id))
        own = {name: Estimate(0.5, 0.4, 0.6, unit)}
        causes.append(replace(first, candidate=candidate, parameters=own))
    measures = {"forces_measured": measured}

    found = sentence(replace(outcome, causes=tuple(causes), measures=measures))

    assert ("in proportion to the masses of the model" in found) is expected


def test_an_unexplained_error_has_a_dependence(diagnosed: Make) -> None:
    found = sentence(outcome_of(diagnosed(Verdict.UNEXPLAINED)))

    assert found.startswith("Something is wrong that none of the known causes explains: 5 % of")
    assert "depends on the velocity sign of elbow" in found


def test_the_best_attempt_is_not_named_for_a_reason(diagnosed: Make) -> None:
    outcome = outcome_of(diagnosed(Verdict.UNEXPLAINED))

    found = sentence(replace(outcome, objection="has a parameter at its bound"))

    assert "the best attempt, which leaves 5 % of the difference, has a parameter at its" in found


@pytest.mark.parametrize("verdict", [Verdict.UNEXPLAINED, Verdict.PARTLY_NAMED])
@pytest.mark.parametrize("met", [False, True])
def test_what_is_left_beside_a_stop_depends_on_no_other_joint(
    verdict: Verdict, met: bool, diagnosed: Make
) -> None:
    objection = "explains less than an end stop of jy at 0.121 m would"
    stop = Criterion(STOP, 50.0, 5.0, met, objection)
    outcome = replace(outcome_of(diagnosed(verdict)), criteria=(stop,), objection=objection)

    found = sentence(outcome)

    assert "shows most in length_flexor" in found
    assert ("velocity sign of elbow" in found) is met


def test_nothing_wrong_does_not_claim_that_the_model_is_right(diagnosed: Make) -> None:
    assert "as far as these data can show" in sentence(outcome_of(diagnosed(Verdict.NOTHING_WRONG)))


def test_nothing_wrong_mentions_large_differences_that_tolerances_excuse(diagnosed: Make) -> None:
    outcome = outcome_of(diagnosed(Verdict.NOTHING_WRONG))
    large = replace(outcome, score=replace(outcome.score, before=450.0, floor=1.0))
    excused = replace(large, measures={**large.measures, "deviation": 2.99})

    assert "450 noises; deviations of at most 3 tolerances explain that" in sentence(excused)
    assert "noises" not in sentence(replace(excused, score=replace(large.score, before=4.0)))
    rounded = replace(large.score, before=0.76, floor=0.01)
    assert "noises" not in sentence(replace(excused, score=rounded))


def test_causes_that_are_not_all_have_a_rest_without_a_name(diagnosed: Make) -> None:
    found = sentence(outcome_of(diagnosed(Verdict.PARTLY_NAMED)))

    assert found.startswith("These causes explain a part of the error, also on held-out data; the")
    assert "Coulomb friction at flexor: friction 3 N" in found
    assert "The rest depends most on the velocity sign of elbow and shows most in length_f" in found


def test_rounding_errors_are_zero(diagnosed: Make) -> None:
    diagnosis = diagnosed(Verdict.NAMED)
    zero = Estimate(-1.154e-18, -1.154e-18, 0.002, "m")
    cause = replace(diagnosis.causes[1], parameters={"offset": zero})

    found = sentence(outcome_of(replace(diagnosis, causes=(cause,))))

    assert "offset 0 m [0, 0.002]" in found


def test_a_gain_is_never_all(diagnosed: Make) -> None:
    diagnosis = replace(diagnosed(Verdict.NAMED), gain=Gain(1.0, 0.998, 1.004))

    found = sentence(outcome_of(diagnosis))

    assert "> 99 % of the avoidable error is gone" in found
    assert "100 %" not in found

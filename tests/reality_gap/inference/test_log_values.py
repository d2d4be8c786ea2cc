"""Causes that act in one of two logs, and values that are the same or have changed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from reality_gap.causes import find_cause
from reality_gap.inference.gauss_newton import fit
from reality_gap.inference.likelihood import independent_noise
from reality_gap.inference.log_candidates import MOST, in_each_log
from reality_gap.inference.log_values import compare_logs
from reality_gap.inference.problem import Problem
from reality_gap.inference.screening import list_candidates, screen
from reality_gap.log_findings import LogComparison
from reality_gap.simulation.hypothesis import Candidate, build, in_log
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Study


@pytest.fixture
def study(lever_study: Study) -> Study:
    """The good study, whose episodes are two logs."""
    first, second = lever_study.episodes
    return replace(
        lever_study, episodes=(replace(first, log="monday"), replace(second, log="tuesday"))
    )


def candidate_of(study: Study, cause: str, element: str, log: str = "") -> Candidate:
    with Replayer(study) as replayer:
        found = list_candidates(replayer.system, [find_cause(cause)])
    [one] = (c for c in found if c.location.elements == (element,) and not c.location.note)
    return replace(one, location=replace(one.location, log=log))


def hidden(study: Study, cause: str, element: str, name: str, values: dict[str, float]) -> Study:
    """Return a study of a machine whose cause has another value in each log."""
    parts = []
    for log, value in values.items():
        one = candidate_of(study, cause, element, log)
        parts.append((one, one.null_values() | {name: value}))
    random = np.random.default_rng(3)
    with Replayer(study) as replayer:
        measured = replayer.measured
        readings = replayer.replay(parts).prediction + replayer.drift
        readings += measured.noise * random.standard_normal(len(readings))
    episodes = []
    for e, episode in enumerate(study.episodes):
        own = tuple(
            replace(r, value=readings[(measured.episode == e) & (measured.channel == c)])
            for c, r in enumerate(episode.readings)
        )
        episodes.append(replace(episode, readings=own))
    channels = tuple(
        replace(c, noise=float(measured.noise[measured.channel == i][0]))
        for i, c in enumerate(study.channels)
    )
    return replace(study, channels=channels, episodes=tuple(episodes))


def compared(study: Study, one: Candidate) -> LogComparison:
    with Replayer(study) as replayer:
        null = replayer.residual([])
        noise_model = independent_noise(replayer.measured, np.zeros((len(null), 0)))
        problem = Problem(replayer, null, noise_model)
        best = fit(problem, [(one, one.null_values())])
        [found] = compare_logs(problem, best)
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("values", "agreement"),
    [
        ({"monday": 0.004, "tuesday": 0.004}, "same"),
        ({"monday": 0.004, "tuesday": 0.006}, "changed"),
        ({"monday": 0.004, "tuesday": 0.0}, "changed"),
    ],
)
def test_an_offset_is_the_same_or_has_changed(
    study: Study, values: dict[str, float], agreement: str
) -> None:
    log = hidden(study, "length_offset", "flexor", "offset", values)
    found = compared(log, candidate_of(log, "length_offset", "flexor"))
    assert found.agreement == agreement
    for value in found.values:
        estimate = value.parameters["offset"]
        assert estimate.low <= values[value.log] <= estimate.high
        assert estimate.high - estimate.low < 1e-4


def test_a_cause_of_one_log_is_compared_with_the_others(study: Study) -> None:
    values = {"monday": 0.0, "tuesday": 0.004}
    log = hidden(study, "length_offset", "flexor", "offset", values)
    found = compared(log, candidate_of(log, "length_offset", "flexor", "tuesday"))
    assert found.agreement == "changed"
    monday, tuesday = (value.parameters["offset"] for value in found.values)
    assert abs(monday.value) < 1e-4
    assert tuesday.value == pytest.approx(0.004, abs=1e-4)


def test_values_that_are_too_uncertain_are_unknown(study: Study) -> None:
    """A friction of which a log shows hardly anything may be the same or not."""
    values = {"monday": 2e-5, "tuesday": 2e-5}
    log = hidden(study, "viscous_friction", "elbow", "damping", values)
    found = compared(log, candidate_of(log, "viscous_friction", "elbow"))
    assert found.agreement == "unknown"


def test_one_log_has_nothing_to_compare(lever_study: Study) -> None:
    one = candidate_of(lever_study, "length_offset", "flexor")
    with Replayer(lever_study) as replayer:
        null = replayer.residual([])
        noise_model = independent_noise(replayer.measured, np.zeros((len(null), 0)))
        problem = Problem(replayer, null, noise_model)
        assert compare_logs(problem, fit(problem, [(one, one.null_values())])) == (None,)


def test_a_cause_of_one_log_changes_no_other(study: Study) -> None:
    one = candidate_of(study, "length_offset", "flexor", "tuesday")
    with Replayer(study) as replayer:
        null = replayer.replay([]).prediction
        moved = replayer.replay([(one, {"offset": 0.004})]).prediction != null
        assert set(replayer.measured.episode[moved]) == {1}
        # The model that is the same in all logs does not have it.
        plant = build(replayer.system, [(one, {"offset": 0.004})])
        assert not plant.edits
        assert not plant.effects.readings


def test_deviations_in_all_logs_and_in_one_add_up(study: Study) -> None:
    everywhere = candidate_of(study, "length_scale", "flexor")
    tuesday = candidate_of(study, "length_scale", "flexor", "tuesday")
    parts = [(everywhere, {"scale": 0.1}), (tuesday, {"scale": -0.02})]
    assert in_log(parts, "monday") == [(everywhere, {"scale": 0.1})]
    [(found, values)] = in_log(parts, "tuesday")
    assert found == everywhere
    assert values["scale"] == pytest.approx(0.08)
    assert in_log(parts, "") == [(everywhere, {"scale": 0.1})]


def test_columns_of_one_log_are_those_of_a_replay(study: Study) -> None:
    with Replayer(study) as replayer:
        null = replayer.residual([])
        candidates = [candidate_of(study, "viscous_friction", "elbow")]
        found = in_each_log(study, replayer.measured, screen(replayer, candidates, null))
        assert [one.candidate.location.log for one in found] == ["monday", "tuesday"]
        [direct] = screen(replayer, [found[1].candidate], null)
    np.testing.assert_allclose(found[1].columns, direct.columns, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("count", [1, MOST + 1])
def test_one_log_and_many_have_no_candidates_of_their_own(study: Study, count: int) -> None:
    names = [f"day {k}" for k in range(count)]
    episodes = tuple(replace(study.episodes[0], name=n, log=n) for n in names)
    many = replace(study, episodes=episodes)
    with Replayer(study) as replayer:
        null = replayer.residual([])
        screened = screen(replayer, [candidate_of(study, "length_offset", "flexor")], null)
        assert in_each_log(many, replayer.measured, screened) == ()

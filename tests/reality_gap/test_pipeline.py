"""Tests of how a verdict is decided."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from reality_gap.causes import CATALOGUE
from reality_gap.causes.base import Location, Parameter
from reality_gap.diagnosis import Gain, Verdict
from reality_gap.inference.confidence import TEMPER
from reality_gap.inference.forward_selection import Settings
from reality_gap.inference.gauss_newton import fit
from reality_gap.inference.held_out import pays
from reality_gap.inference.likelihood import NoiseModel
from reality_gap.inference.refinement import again
from reality_gap.inference.remainder import Remainder, examine
from reality_gap.inference.verdict import Options, at_bound, decide, weighed
from reality_gap.io.loader import load_study
from reality_gap.pipeline import diagnose
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.simulation.replayer import Hypothesis, Replayer
from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.study.splits import BLOCK, REPORT, TURN
from reality_gap.types import Floats


def decided(
    evidence: float | None,
    learned: float = 0.0,
    instead: float = 0.0,
    before: float = 5.0,
    after: float = 1.0,
    events: tuple[bool, ...] = (False,),
    pays: bool = True,
    hypothesis: Hypothesis = (),
) -> Verdict:
    """For causes of this evidence, or none; what could be learned beside and instead [nats]."""
    candidates = [SimpleNamespace(cause=SimpleNamespace(event=event)) for event in events]
    best = SimpleNamespace(evidence=evidence, candidates=candidates, hypothesis=hypothesis)
    result: Any = SimpleNamespace(best=None if evidence is None else best)
    left: Any = SimpleNamespace(
        learned=SimpleNamespace(evidence=learned),
        instead=SimpleNamespace(evidence=learned if evidence is None else instead),
        before=before,
        after=after,
    )
    return decide(result, left, pays, Options())


@pytest.mark.parametrize(
    ("learned", "expected"),
    [(0.0, Verdict.NOTHING_WRONG), (5.9, Verdict.NOTHING_WRONG), (6.1, Verdict.UNEXPLAINED)],
)
def test_without_a_cause_it_is_what_can_be_learned_that_counts(
    learned: float, expected: Verdict
) -> None:
    assert decided(None, learned, after=5.0) is expected


@pytest.mark.parametrize(
    ("evidence", "learned", "expected"),
    [
        (20.0, 5.9, Verdict.NAMED),
        (20.0, 6.1, Verdict.UNEXPLAINED),
        (100.0, 14.9, Verdict.NAMED),
        (100.0, 15.1, Verdict.UNEXPLAINED),
        (10_000.0, 299.0, Verdict.NAMED),
        (10_000.0, 301.0, Verdict.UNEXPLAINED),  # a hard stop as three causes
    ],
)
def test_causes_may_leave_a_share_to_be_learned_and_few_roots(
    evidence: float, learned: float, expected: Verdict
) -> None:
    assert decided(evidence, learned) is expected


@pytest.mark.parametrize(
    ("instead", "expected"), [(105.0, Verdict.NAMED), (107.0, Verdict.UNEXPLAINED)]
)
def test_what_has_no_name_may_explain_it_better(instead: float, expected: Verdict) -> None:
    assert decided(100.0, instead=instead) is expected


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        (1.1, 2.5, Verdict.UNEXPLAINED),  # a hard stop as an external force
        (16.5, 35.7, Verdict.UNEXPLAINED),
        (4.0, 2.6, Verdict.NAMED),
        (1.0, 1.1, Verdict.NAMED),  # noise, and rounding of the model
    ],
)
def test_a_name_must_hold_where_it_was_not_fitted(
    before: float, after: float, expected: Verdict
) -> None:
    assert decided(1000.0, before=before, after=after) is expected


@pytest.mark.parametrize(
    ("events", "instead", "expected"),
    [
        ((True,), 22.0, Verdict.NAMED),
        ((True,), 82.0, Verdict.UNEXPLAINED),  # a hard stop, touched in each episode
        ((False,), 82.0, Verdict.NAMED),
        ((True, False), 82.0, Verdict.NAMED),  # the learner explains the other one
    ],
)
def test_what_the_posture_explains_nearly_as_well_is_no_event(
    events: tuple[bool, ...], instead: float, expected: Verdict
) -> None:
    assert decided(100.0, instead=instead, events=events) is expected


@pytest.mark.parametrize(
    ("instead", "expected"), [(5.9, Verdict.NOTHING_WRONG), (6.1, Verdict.UNEXPLAINED)]
)
def test_causes_that_do_not_pay_on_held_out_readings_are_as_none(
    instead: float, expected: Verdict
) -> None:
    assert decided(1000.0, instead=instead, pays=False) is expected


def one(value: float, low: float, high: float, null: float = 0.0) -> Hypothesis:
    """A cause with one parameter."""
    parameter = Parameter("size", "1", 1.0, 0.0, low, high, null)
    candidate = Candidate(CATALOGUE["payload"], Location("body", ("hand",)), (parameter,))
    return [(candidate, {"size": value})]


@pytest.mark.parametrize(
    ("hypothesis", "expected"),
    [
        (one(2.0, -1.0, 2.0), True),
        (one(1.99, -1.0, 2.0), True),  # an optimiser stops just before it
        (one(-1.0, -1.0, 2.0), True),
        (one(1.9, -1.0, 2.0), False),
        (one(0.0, 0.0, 2.0), False),  # where the cause does nothing
        (one(1.0, 1.0, 2.0, null=1.0), False),
        (one(1e9, -np.inf, np.inf), False),
        ([*one(0.5, 0.0, 2.0), *one(2.0, 0.0, 2.0)], True),
    ],
)
def test_no_name_has_a_parameter_at_its_bound(hypothesis: Hypothesis, expected: bool) -> None:
    assert at_bound(hypothesis) is expected
    named = decided(1000.0, hypothesis=hypothesis) is Verdict.NAMED
    assert named is not expected


@pytest.mark.parametrize(
    ("improvement", "likelihood", "expected"),
    [
        (Gain(0.1, 0.01, 0.2), Gain(0.0, -1.0, 1.0), True),
        (Gain(0.1, -0.01, 0.2), Gain(9.0, 1.0, 17.0), True),  # faint beside the tolerances
        (Gain(0.1, -0.01, 0.2), Gain(9.0, -1.0, 17.0), False),
        (Gain(-0.1, -0.2, -0.01), Gain(9.0, 1.0, 17.0), False),  # the RMS is surely worse
        (Gain(0.1, 0.01, 0.2), None, True),
        (Gain(0.1, -0.01, 0.2), None, False),
    ],
)
def test_a_model_pays_in_the_rms_or_in_the_likelihood(
    improvement: Gain, likelihood: Gain | None, expected: bool
) -> None:
    assert pays(improvement, likelihood) is expected


@pytest.mark.usefixtures("frictionless")
def test_what_does_not_hold_on_held_out_readings_is_not_named(study_folder: Any) -> None:
    """A tension that is read wrong, but not in those blocks of time that are only reported on."""
    for log in study_folder.logs.values():
        if "tension_flexor" in log:
            block = np.floor(np.array(log["time"]) / BLOCK).astype(int)
            wrong = block % len(TURN) != TURN.index(REPORT)
            log["tension_flexor"] = list(np.array(log["tension_flexor"]) * np.where(wrong, 1.5, 1))
    found = diagnose(load_study(study_folder.write()), causes=[CATALOGUE["tension_scale"]])
    assert found.verdict is Verdict.UNEXPLAINED
    assert not found.causes
    assert found.rms_after == found.rms_before


STILL = """
<mujoco>
  <worldbody><body><joint name="rail" type="slide"/><geom size="0.1"/></body></worldbody>
  <sensor><jointpos name="position" joint="rail"/></sensor>
</mujoco>
"""


def test_what_further_causes_need_follows_the_length_of_all_episodes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Searched(Exception):
        pass

    def stop(*arguments: Any) -> None:
        raise Searched(arguments[4])

    monkeypatch.setattr("reality_gap.pipeline.search", stop)
    (tmp_path / "still.xml").write_text(STILL)
    time = np.arange(0.0, 30.0, 0.1)
    channel = Channel("position", "position", unit="m", noise=1.0)
    episode = Episode("one", np.zeros(1), np.zeros((1, 0)), (Reading(time, 0.0 * time),))
    study = Study("still", tmp_path / "still.xml", (channel,), (episode, episode))
    with pytest.raises(Searched) as found:
        diagnose(study, causes=[CATALOGUE["gravity_direction"]])
    assert found.value.args == (Settings().for_log(study.duration),)
    assert study.duration == pytest.approx(59.8)


def with_a_wrong_tension(study_folder: Any) -> Study:
    for log in study_folder.logs.values():
        if "tension_flexor" in log:
            log["tension_flexor"] = [1.5 * tension for tension in log["tension_flexor"]]
    return load_study(study_folder.write())


@pytest.mark.parametrize("verdict", [Verdict.NAMED, Verdict.UNEXPLAINED])
def test_an_experiment_is_looked_for_only_where_a_name_holds(
    verdict: Verdict, study_folder: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []
    monkeypatch.setattr("reality_gap.pipeline.decide", lambda *arguments: verdict)
    monkeypatch.setattr("reality_gap.pipeline.next_experiment", lambda *a: asked.append(a))

    diagnose(with_a_wrong_tension(study_folder), causes=[CATALOGUE["tension_scale"]])

    assert len(asked) == (verdict is Verdict.NAMED)


@pytest.mark.usefixtures("frictionless")
@pytest.mark.parametrize(
    ("more", "chance"), [(-100.0, 0.0), (0.0, 0.5), (TEMPER * np.log(3), 0.75)]
)
def test_a_learner_in_place_of_the_causes_is_a_rival_to_them(
    more: float, chance: float, study_folder: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def as_good(
        replayer: Replayer, rule: NoiseModel, hypothesis: Hypothesis, residual: Floats, null: Floats
    ) -> Remainder:
        [(candidate, values)] = hypothesis
        named = again(rule, fit(replayer, [(candidate, values)], rule.learn, null)).evidence
        found = examine(replayer, rule, hypothesis, residual, null)
        return replace(found, instead=replace(found.instead, evidence=named + more))

    asked: list[float] = []
    monkeypatch.setattr("reality_gap.inference.verdict.examine", as_good)
    monkeypatch.setattr("reality_gap.pipeline.next_experiment", lambda *a: asked.append(a[-1]))
    study = with_a_wrong_tension(study_folder)
    found = diagnose(study, causes=[CATALOGUE["tension_scale"]])

    [cause] = found.causes
    assert found.unmodelled == pytest.approx(chance, abs=0.01)
    assert asked == [found.unmodelled]
    assert cause.confidence == pytest.approx(1.0 - chance, abs=0.01)
    assert sum(r.confidence for r in found.fitted_candidates) <= 1.0 - found.unmodelled + 1e-9


@pytest.mark.parametrize(
    ("named", "instead", "learned", "anew"),
    [
        (100.0, 0.0, 0.0, True),
        (100.0, 109.0, 0.0, True),
        (100.0, 111.0, 0.0, False),
        (20.0, 25.9, 0.0, True),  # may be named yet
        (20.0, 26.1, 0.0, False),
        (10_000.0, 0.0, 1499.0, True),
        (10_000.0, 0.0, 1501.0, False),  # a hard stop as three causes
    ],
)
def test_causes_that_a_learner_beats_by_far_are_not_looked_at_anew(
    named: float, instead: float, learned: float, anew: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, other = (
        SimpleNamespace(
            best=SimpleNamespace(evidence=e, hypothesis=[], residual=None), noise_model=None
        )
        for e in (named, named + 1.0)
    )
    found = (SimpleNamespace(evidence=evidence) for evidence in (instead, learned))
    leaves = [SimpleNamespace(instead=next(found), learned=next(found)), object()]
    looks = iter(leaves)
    monkeypatch.setattr("reality_gap.inference.verdict.examine", lambda *arguments: next(looks))
    monkeypatch.setattr("reality_gap.inference.verdict.revise", lambda *arguments: other)
    nothing: Any = None
    result: Any = first
    got = weighed(nothing, result, nothing, Settings(), Options())
    assert got == ((other, leaves[1]) if anew else (first, leaves[0]))


def test_what_stays_as_it_was_is_not_examined_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    best = SimpleNamespace(evidence=100.0, hypothesis=[], residual=None)
    nothing: Any = SimpleNamespace(evidence=0.0)
    result: Any = SimpleNamespace(best=best, noise_model=None)
    left = SimpleNamespace(instead=nothing, learned=nothing)
    looks = iter([left])
    monkeypatch.setattr("reality_gap.inference.verdict.examine", lambda *arguments: next(looks))
    monkeypatch.setattr("reality_gap.inference.verdict.revise", lambda *arguments: result)
    assert weighed(nothing, result, nothing, Settings(), Options()) == (result, left)

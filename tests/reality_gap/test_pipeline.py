"""Pipeline and verdict: when causes are named, and what a diagnosis does on the way."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from reality_gap.causes import CATALOGUE
from reality_gap.causes.base import Location, Parameter
from reality_gap.diagnosis import Verdict
from reality_gap.errors import TimeLimitError
from reality_gap.inference.confidence import TEMPER
from reality_gap.inference.expansion import Expanded
from reality_gap.inference.forward_selection import Settings
from reality_gap.inference.gauss_newton import Fit, fit, rescore
from reality_gap.inference.paying import NO_GAIN, at_bound
from reality_gap.inference.problem import Problem
from reality_gap.inference.remainder import Remainder, evaluate_remainder
from reality_gap.inference.tolerances import Tolerance
from reality_gap.inference.verdict import Options, decide, judge, revise_and_evaluate
from reality_gap.io.loader import load_study
from reality_gap.pipeline import diagnose
from reality_gap.simulation.hypothesis import Candidate, Hypothesis
from reality_gap.simulation.replayer import Expansion, Replayer
from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.study.measurements import BLOCK
from reality_gap.study.splits import REPORT, TURN
from reality_gap.types import Floats


def decided(
    evidence: float | None,
    learned: float = 0.0,
    instead: float = 0.0,
    before: float = 5.0,
    after: float = 1.0,
    events: tuple[bool, ...] = (False,),
    attempt_pays: bool = False,
    explained: float = 0.0,
    roughness: float = 1.0,
    deviation: float = 0.0,
    of_step: float = 0.0,
) -> Verdict:
    """Decide on causes with this evidence, or on none.

    Args:
        evidence: evidence of the causes [nats]; None without causes.
        learned, instead: evidence of what is learned of the remainder, and of the whole gap [nats].
        before, after: RMS without and with the causes [noise].
        events: for each cause, whether it is an event.
        attempt_pays: whether the best attempt predicts held-out readings better than the nominal
            model, although none of its causes may be named.
        explained: RMS of what tolerances explain [noise].
        roughness: factor of the tolerances.
        deviation: largest deviation by which tolerances explain what is left [tolerances].
        of_step: RMS of the error that extrapolation to finer time steps leaves [noise].
    """
    candidates = [SimpleNamespace(cause=SimpleNamespace(event=event)) for event in events]
    best = SimpleNamespace(evidence=evidence, candidates=candidates, is_null=evidence is None)
    paying: Any = SimpleNamespace(
        result=SimpleNamespace(best=best, problem=SimpleNamespace(roughness=roughness), stop=None),
        attempted=SimpleNamespace(pays=attempt_pays),
        dropped=(),
    )
    remainder: Any = SimpleNamespace(
        learned=SimpleNamespace(evidence=learned),
        instead=SimpleNamespace(
            evidence=learned if evidence is None else instead, explained=instead / (evidence or 1.0)
        ),
        share=after / before,
        before=before,
        after=after,
        explained=explained,
        fits=(before, after),
        deviation=deviation,
        of_step=of_step,
    )
    return decide(paying, judge(paying, remainder, Options()))


@pytest.mark.parametrize(
    ("learned", "expected"),
    [(0.0, Verdict.NOTHING_WRONG), (9.9, Verdict.NOTHING_WRONG), (10.1, Verdict.UNEXPLAINED)],
)
def test_without_causes_the_learned_residual_decides(learned: float, expected: Verdict) -> None:
    assert decided(None, learned, after=1.2) is expected


def test_errors_of_many_noises_are_not_nothing() -> None:
    assert decided(None, 0.0, after=5.0) is Verdict.UNEXPLAINED


@pytest.mark.parametrize(
    ("learned", "after", "explained", "expected"),
    [
        (17.0, 1.6, 60.0, Verdict.NOTHING_WRONG),  # 1.8 noises of an error of 3 %
        (17.0, 1.6, 6.0, Verdict.UNEXPLAINED),
        (170.0, 1.6, 60.0, Verdict.UNEXPLAINED),
    ],
)
def test_what_tolerances_explain_is_not_exactly_linear(
    learned: float, after: float, explained: float, expected: Verdict
) -> None:
    assert decided(None, learned, after=after, explained=explained) is expected


@pytest.mark.parametrize(
    ("after", "of_step", "expected"),
    [
        (2.0, 0.3, Verdict.UNEXPLAINED),
        (2.0, 1.9, Verdict.NOTHING_WRONG),
        (20.0, 30.0, Verdict.UNEXPLAINED),  # a replay that tells nothing excuses nothing
    ],
)
def test_a_small_error_of_the_time_step_is_no_error_of_the_model(
    after: float, of_step: float, expected: Verdict
) -> None:
    assert decided(None, 30.0, after=after, of_step=of_step) is expected


@pytest.mark.parametrize(
    ("deviation", "expected"), [(3.0, Verdict.NOTHING_WRONG), (2000.0, Verdict.UNEXPLAINED)]
)
def test_one_deviation_of_many_tolerances_is_no_excuse(deviation: float, expected: Verdict) -> None:
    """An encoder of many bits that is mirrored has another scale by thousands of tolerances."""
    assert decided(None, deviation=deviation, explained=500.0) is expected


@pytest.mark.parametrize(
    ("evidence", "roughness", "expected"),
    [
        (None, 4.0, Verdict.NOTHING_WRONG),
        (None, 8.0, Verdict.UNEXPLAINED),
        (100.0, 4.0, Verdict.NAMED),
        (100.0, 8.0, Verdict.PARTLY_NAMED),
    ],
)
def test_deviations_of_many_tolerances_are_no_excuse(
    evidence: float | None, roughness: float, expected: Verdict
) -> None:
    assert decided(evidence, roughness=roughness) is expected


@pytest.mark.parametrize(
    ("evidence", "learned", "expected"),
    [
        (20.0, 9.9, Verdict.NAMED),
        (20.0, 10.1, Verdict.PARTLY_NAMED),
        (100.0, 14.9, Verdict.NAMED),
        (100.0, 15.1, Verdict.PARTLY_NAMED),
        (10_000.0, 299.0, Verdict.NAMED),
        (10_000.0, 301.0, Verdict.PARTLY_NAMED),
    ],
)
def test_causes_that_leave_more_than_a_share_and_some_roots_of_their_evidence_are_not_all(
    evidence: float, learned: float, expected: Verdict
) -> None:
    assert decided(evidence, learned) is expected


@pytest.mark.parametrize(
    ("instead", "learned", "expected"),
    [
        (105.0, 0.0, Verdict.NAMED),
        (107.0, 0.0, Verdict.UNEXPLAINED),
        (107.0, 14.9, Verdict.UNEXPLAINED),
        (150.0, 56.0, Verdict.UNEXPLAINED),
        (150.0, 58.0, Verdict.PARTLY_NAMED),  # they explain what the learned residual cannot
    ],
)
def test_causes_are_not_named_if_a_learned_residual_explains_more_than_they_with_one(
    instead: float, learned: float, expected: Verdict
) -> None:
    assert decided(100.0, learned, instead) is expected


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        (1.1, 2.5, Verdict.UNEXPLAINED),  # a hard stop as an external force
        (16.5, 35.7, Verdict.UNEXPLAINED),
        (4.0, 2.6, Verdict.PARTLY_NAMED),  # several noises are left
        (40.0, 1.4, Verdict.NAMED),
        (1.0, 1.1, Verdict.NAMED),  # noise, and rounding of the model
    ],
)
def test_named_causes_must_predict_the_report_split_and_leave_the_noise(
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
def test_an_event_that_the_posture_explains_nearly_as_well_is_not_named(
    events: tuple[bool, ...], instead: float, expected: Verdict
) -> None:
    assert decided(100.0, instead=instead, events=events) is expected


def test_an_attempt_that_pays_but_cannot_be_named_is_not_nothing() -> None:
    assert decided(None, 5.9, after=5.0, attempt_pays=True) is Verdict.UNEXPLAINED


@pytest.mark.parametrize("verdict", Verdict)
def test_only_two_verdicts_name_causes(verdict: Verdict) -> None:
    assert verdict.has_names is (verdict in (Verdict.NAMED, Verdict.PARTLY_NAMED))


def one(value: float, low: float, high: float, null: float = 0.0) -> Hypothesis:
    """Return a cause with one parameter."""
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
def test_a_parameter_that_an_optimiser_stopped_at_its_bound_is_found(
    hypothesis: Hypothesis, expected: bool
) -> None:
    assert at_bound(hypothesis) is expected


@pytest.mark.usefixtures("frictionless")
def test_a_cause_that_fails_on_held_out_readings_is_not_named(study_folder: Any) -> None:
    """A tension has a wrong scale, except in the blocks of the report split."""
    for episode in range(2):
        log = study_folder.logs[f"robot_{episode}.csv"]
        block = np.floor(np.array(log["time"]) / BLOCK).astype(int) + episode
        wrong = block % len(TURN) != TURN.index(REPORT)
        log["tension_flexor"] = list(np.array(log["tension_flexor"]) * np.where(wrong, 1.5, 1))
    found = diagnose(load_study(study_folder.write()), causes=[CATALOGUE["tension_scale"]])
    assert found.verdict is Verdict.UNEXPLAINED
    assert not found.causes
    assert found.rms_after == found.rms_before
    [rejected] = found.rejected
    assert rejected.candidate.cause.id == "tension_scale"
    assert rejected.values["scale"] == pytest.approx(0.5, abs=0.2)
    assert rejected.reason == NO_GAIN


STILL = """
<mujoco>
  <worldbody><body><joint name="rail" type="slide"/><geom size="0.1"/></body></worldbody>
  <sensor><jointpos name="position" joint="rail"/></sensor>
</mujoco>
"""


def test_the_evidence_for_further_causes_follows_the_length_of_all_episodes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Searched(Exception):
        pass

    def stop(*arguments: Any) -> None:
        raise Searched(arguments[2])

    monkeypatch.setattr("reality_gap.inference.rough_search.search", stop)
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


@pytest.mark.parametrize("verdict", [Verdict.NAMED, Verdict.PARTLY_NAMED, Verdict.UNEXPLAINED])
def test_an_experiment_is_suggested_only_if_causes_are_named(
    verdict: Verdict, study_folder: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[Any] = []
    monkeypatch.setattr("reality_gap.inference.search_outcome.decide", lambda *arguments: verdict)
    monkeypatch.setattr(
        "reality_gap.inference.search_outcome.next_experiment", lambda *a: calls.append(a)
    )

    diagnose(with_a_wrong_tension(study_folder), causes=[CATALOGUE["tension_scale"]])

    assert len(calls) == verdict.has_names


@pytest.mark.usefixtures("frictionless")
@pytest.mark.parametrize(
    ("more", "chance"), [(-100.0, 0.0), (TEMPER * np.log(0.5), 1 / 3), (TEMPER * np.log(3), 0.75)]
)
def test_a_learned_residual_is_an_alternative_to_the_causes(
    more: float, chance: float, study_folder: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def as_good(problem: Problem, fitted: Fit) -> Remainder:
        named = rescore(problem, fit(problem, fitted.hypothesis)).evidence
        found = evaluate_remainder(problem, fitted)
        return replace(found, instead=replace(found.instead, evidence=named + more))

    doubts: list[float] = []
    monkeypatch.setattr("reality_gap.inference.verdict.evaluate_remainder", as_good)
    monkeypatch.setattr(
        "reality_gap.inference.search_outcome.next_experiment", lambda *a: doubts.append(a[-1])
    )
    study = with_a_wrong_tension(study_folder)
    options = Options(likely=0.2)
    found = diagnose(study, causes=[CATALOGUE["tension_scale"]], options=options)

    [cause] = found.causes
    assert found.unmodelled == pytest.approx(chance, abs=0.01)
    assert doubts == [found.unmodelled]
    assert cause.confidence == pytest.approx(1.0 - chance, abs=0.01)
    assert sum(r.confidence for r in found.fitted_candidates) <= 1.0 - found.unmodelled + 1e-9


@pytest.mark.usefixtures("frictionless")
@pytest.mark.parametrize(("more", "count"), [(0.0, 1), (1e6, 0)])
def test_a_cause_makes_up_for_a_linearisation_in_which_the_model_is_less_likely(
    more: float, count: int, study_folder: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def about_nothing(
        replayer: Replayer, tolerances: list[Tolerance], columns: Floats, *others: object
    ) -> Expanded:
        candidate, _ = tolerances[0].deviation(0.0)
        part = (candidate, candidate.null_values())
        expansion = Expansion((part,), np.zeros((1, len(columns))))
        return Expanded(expansion, columns, np.zeros(len(columns)), 1.0)

    monkeypatch.setattr("reality_gap.pipeline.is_small", lambda *arguments: False)
    monkeypatch.setattr("reality_gap.pipeline.expand", about_nothing)
    monkeypatch.setattr("reality_gap.pipeline.handicaps", lambda *arguments: (more, more))

    found = diagnose(with_a_wrong_tension(study_folder), causes=[CATALOGUE["tension_scale"]])

    assert len(found.causes) == count


@pytest.mark.usefixtures("frictionless")
def test_a_named_cause_has_its_gain_and_its_share_of_the_error(study_folder: Any) -> None:
    """Of the error of a tension with a wrong scale, little but the noise is left."""
    study = with_a_wrong_tension(study_folder)

    found = diagnose(study, causes=[CATALOGUE["tension_scale"]])

    assert found.verdict is Verdict.NAMED
    [cause] = found.causes
    assert cause.gain is not None
    assert cause.gain.low > 0.0
    assert found.waterfall[1] == cause.share
    tolerances, share = found.waterfall
    assert tolerances.before == pytest.approx(found.rms_before)
    assert share.before == tolerances.after
    assert share.after <= Options().left
    assert share.fraction > 0.8
    assert tolerances.fraction + share.fraction == pytest.approx(1.0, abs=0.1)
    assert all(one.met for one in found.criteria if one.name.startswith(("folds", "report")))


def searched(evidence: float, hypothesis: Hypothesis = ()) -> Any:
    """Return the result of a search that found causes of this evidence."""
    best = SimpleNamespace(evidence=evidence, is_null=False, hypothesis=hypothesis)
    return SimpleNamespace(best=best, problem=None)


def remainder_of(instead: float, learned: float) -> Any:
    """Return a remainder with these evidences."""
    return SimpleNamespace(
        instead=SimpleNamespace(evidence=instead), learned=SimpleNamespace(evidence=learned)
    )


def all_pay(result: Any) -> Any:
    return SimpleNamespace(result=result, attempt=result.best)


@pytest.mark.parametrize(
    ("named", "instead", "learned", "revised"),
    [
        (100.0, 0.0, 0.0, True),
        (100.0, 105.9, 0.0, True),
        (100.0, 106.1, 0.0, False),
        (100.0, 142.9, 50.0, True),  # may be named in part
        (100.0, 143.1, 50.0, False),
    ],
)
def test_causes_that_a_learned_residual_refutes_are_not_revised(
    named: float, instead: float, learned: float, revised: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, other = searched(named), searched(named + 1.0, one(0.5, 0.0, 2.0))
    remainders = [remainder_of(instead, learned), object()]
    evaluated = iter(remainders)
    monkeypatch.setattr(
        "reality_gap.inference.verdict.evaluate_remainder", lambda *arguments: next(evaluated)
    )
    monkeypatch.setattr("reality_gap.inference.verdict.revise", lambda *arguments: other)
    monkeypatch.setattr("reality_gap.inference.verdict.keep_paying", all_pay)

    paying, remainder = revise_and_evaluate(first, Options())

    expected = (other, remainders[1]) if revised else (first, remainders[0])
    assert (paying.result, remainder) == expected


def test_causes_that_no_revision_changes_are_evaluated_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    result, remainder = searched(100.0), remainder_of(0.0, 0.0)
    evaluated = iter([remainder])
    monkeypatch.setattr(
        "reality_gap.inference.verdict.evaluate_remainder", lambda *arguments: next(evaluated)
    )
    monkeypatch.setattr("reality_gap.inference.verdict.revise", lambda *arguments: result)
    monkeypatch.setattr("reality_gap.inference.verdict.keep_paying", all_pay)

    found, same = revise_and_evaluate(result, Options())

    assert (found.result, same) == (result, remainder)


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_limit_of_time_names_the_stage(
    study_folder: Any, monkeypatch: pytest.MonkeyPatch, jobs: int
) -> None:
    stages: list[str] = []

    def clock() -> float:
        """Advance by an hour when the screening has begun."""
        return 3600.0 * any(stage.startswith("screening") for stage in stages)

    monkeypatch.setattr("reality_gap.pipeline.time", SimpleNamespace(monotonic=clock))
    with pytest.raises(TimeLimitError, match=r"within 1800 s, while screening \d+ candidates"):
        diagnose(
            load_study(study_folder.path),
            jobs,
            lambda share, text: stages.append(text),
            options=Options(time_limit=1800.0),
        )

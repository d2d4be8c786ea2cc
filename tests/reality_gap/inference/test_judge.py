"""Events beside what can be learned without their time."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from reality_gap.diagnosis import Verdict
from reality_gap.inference.verdict import Options, decide, judge

EVIDENCE = 1000.0


def verdict(
    share: float,
    left: float,
    learned: float = 0.0,
    event: bool = True,
    before: float = 10.0,
    predicted: float = 1.0,
    deviation: float = 0.0,
) -> Verdict:
    """Verdict on one cause.

    Args:
        share: of its evidence that can be learned without its time.
        left: RMS that it leaves [noise].
        learned: what can be learned of that [nats].
        event: whether it comes from outside at its own time.
        before: RMS without it [noise].
        predicted: share of the power of the report split that what is learned predicts.
        deviation: largest deviation that explains what it leaves [tolerances].
    """
    candidate = SimpleNamespace(cause=SimpleNamespace(event=event))
    best = SimpleNamespace(is_null=False, evidence=EVIDENCE, candidates=(candidate,))
    problem = SimpleNamespace(roughness=1.0)
    paying: Any = SimpleNamespace(result=SimpleNamespace(best=best, problem=problem, stop=None))
    remainder: Any = SimpleNamespace(
        instead=SimpleNamespace(evidence=share * EVIDENCE, explained=predicted),
        learned=SimpleNamespace(evidence=learned),
        fits=(before, left),
        after=left,
        explained=0.0,
        deviation=deviation,
        of_step=0.0,
        share=left / before,
    )
    return decide(paying, judge(paying, remainder, Options()))


@pytest.mark.parametrize("share", [0.3, 0.6, 0.75])
def test_a_push_that_explains_all_is_named_though_much_can_be_learned(share: float) -> None:
    assert verdict(share, left=1.0) is Verdict.NAMED
    assert verdict(share, left=1.2) is Verdict.NAMED


@pytest.mark.parametrize(("left", "learned"), [(1.4, 0.0), (1.0, 5.0)])
def test_an_error_that_comes_back_with_the_motion_is_no_event(left: float, learned: float) -> None:
    assert verdict(0.6, left, learned) is Verdict.UNEXPLAINED
    assert verdict(0.4, left, learned) is Verdict.NAMED


def test_an_event_may_leave_what_the_form_of_its_edges_lacks() -> None:
    assert verdict(0.6, left=2.0, learned=5.0, before=100.0) is Verdict.PARTLY_NAMED
    assert verdict(0.6, left=2.0, learned=5.0, before=20.0) is Verdict.UNEXPLAINED
    assert verdict(0.9, left=2.0, learned=5.0, before=100.0) is Verdict.UNEXPLAINED


def test_nearly_all_that_an_event_explains_is_not_an_event() -> None:
    assert verdict(0.9, left=1.0) is Verdict.UNEXPLAINED


@pytest.mark.parametrize("predicted", [-0.5, 0.3, 0.75])
def test_what_is_learned_of_few_readings_and_predicts_no_others_is_chance(
    predicted: float,
) -> None:
    assert verdict(0.9, left=1.0, predicted=predicted) is Verdict.NAMED
    assert verdict(0.9, left=2.0, before=20.0, predicted=predicted) is Verdict.UNEXPLAINED


def test_other_causes_may_depend_on_the_motion() -> None:
    assert verdict(0.9, left=1.0, event=False) is Verdict.NAMED


def test_what_only_large_deviations_explain_is_not_all_named() -> None:
    """They are no noise, though nothing is left beside them."""
    assert verdict(0.3, left=1.0, deviation=15.0) is Verdict.NAMED
    assert verdict(0.3, left=1.0, deviation=25.0) is Verdict.PARTLY_NAMED

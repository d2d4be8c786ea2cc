"""Posture accuracy: targets are new, trials are those of the paper, sentences are true."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from experiments.harness.errors import ExperimentError
from experiments.posture_accuracy import run as runner
from experiments.posture_accuracy.run import AWAY, Sizes, make_plan, run
from experiments.posture_accuracy.tables import (
    averages,
    by_posture,
    disagreement,
    metrics,
    sag,
    seed_entry,
    tables,
)
from experiments.robots.conditions import ACTUAL, NOMINAL
from kengoro.robots import shuffled_postures
from kengoro.trained_maps import trained_map
from kengoro.visits import ANGLES, Visits, no_visits
from kengoro_env.names import JOINTS

BEGINNING = 1 + 27 + 10


def test_new_postures_differ_by_20_deg_from_all_that_are_learned() -> None:
    skipped = 0
    for seed in range(6):
        plan = make_plan(seed, Sizes())
        assert [len(rows) for rows in plan[1:]] == [27, 5, 10]
        for target in plan.targets:
            for learned in plan.learned:
                assert np.degrees(np.max(np.abs(target - learned))) >= AWAY
        own = np.vstack([plan.first, *plan[1:]])
        assert len(np.unique(own, axis=0)) == len(own)
        following = shuffled_postures(seed)[BEGINNING : BEGINNING + 5]
        skipped += not np.array_equal(plan.targets, following)
    assert skipped, "no posture was near a learned one, so that the rule was not tested"


def test_too_few_postures_far_away_get_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "AWAY", 150.0)
    with pytest.raises(ExperimentError, match=r"^Only 0 postures are 150 deg .* 5 are needed\.$"):
        make_plan(0, Sizes())


def made_up(
    offsets: list[float], not_seen: tuple[int, ...] = (), seen_share: float = 1.0
) -> Visits:
    """Visits whose estimate is off by some degrees in all joints, of which vision shows a share;
    what is commanded is estimated."""
    visits = no_visits()
    for number, offset in enumerate(offsets):
        true = np.full(len(JOINTS), 0.1)
        estimate = true + np.radians(offset)
        seen = estimate - seen_share * np.radians(offset)
        shown = None if number in not_seen else seen
        for key, angles in zip(ANGLES, (estimate, true, estimate, shown), strict=True):
            visits[key].append(None if angles is None else angles.tolist())
        visits["max_tension"].append(100.0 + number)
        visits["time"].append(float(number))
    return visits


def test_errors_are_means_over_trials_and_spreads_over_starts() -> None:
    """Two postures with three starts each; one observation is missing."""
    found = averages(made_up([1.0, 2.0, 3.0, 5.0, 5.0, 8.0], not_seen=(5,)), 3)
    assert found["target_true_deg"] == pytest.approx(4.0, abs=1e-3)
    spread = (np.std([1, 2, 3]) + np.std([5, 5, 8])) / 2
    assert found["target_true_deg_std"] == pytest.approx(spread, abs=1e-3)
    assert found["estimate_seen_deg"] == pytest.approx(3.2, abs=1e-3)
    assert (found["trials"], found["seen"], found["max_tension_N"]) == (6, 5, 105.0)
    assert [len(e) for e in by_posture(made_up([1.0] * 4, (1,)), 2, "estimate_seen", "mm")] == [
        1,
        2,
    ]


def result(before: float, after: float, seen_share: float = 1.0, starts: int = 2) -> dict[str, Any]:
    trials = {
        when: made_up([offset] * 2 * starts, seen_share=seen_share)
        for when, offset in (("before", before), ("after", after))
    }
    more = {"starts": starts, "learning_time": 60.0, "updates": {}, "dropped": {}}
    return {**trials, **more, "away_deg": [25.0, 31.0], "away_rms_deg": [10.0, 12.0]}


def entries(*robots: dict[str, Any]) -> dict[int, dict[str, Any]]:
    nominal = seed_entry(result(2.0, 0.5))
    return {k: {ACTUAL: seed_entry(robot), NOMINAL: nominal} for k, robot in enumerate(robots)}


def test_metrics_are_judged_by_the_median_robot() -> None:
    found = metrics(entries(result(12.0, 3.0), result(10.0, 4.0), result(12.0, 9.0)))
    assert found["rmse_true_after"]["median"] == pytest.approx(4.0, abs=1e-3)
    assert found["rmse_true_after"]["worst"] == pytest.approx(9.0, abs=1e-3)
    assert found["rmse_true_after"]["reached"]
    assert not found["rmse_true_after_aim"]["reached"]
    assert found["rmse_seen_ratio"]["median"] == pytest.approx(0.4, abs=1e-3)
    assert found["away_largest_joint"]["median"] == 25.0
    assert found["rmse_true_before_nominal"]["median"] == pytest.approx(2.0, abs=1e-3)


def test_a_robot_whose_hand_was_never_seen_stays_in_what_is_true() -> None:
    blind = result(12.0, 3.0)
    blind["before"] = made_up([12.0] * 4, not_seen=(0, 1, 2, 3))
    found = metrics(entries(blind, result(10.0, 2.0)))
    assert found["rmse_seen_ratio"]["median"] == pytest.approx(0.2, abs=1e-3)
    assert found["rmse_true_before"]["median"] == pytest.approx(11.0, abs=1e-3)
    assert "0 of 4 -> 4 of 4" in {cell for row in tables(entries(blind))[1].rows for cell in row}


def test_a_sentence_compares_seen_and_true_errors() -> None:
    fooled = disagreement(entries(*[result(12.0, 4.0, seen_share=0.25)] * 3))
    assert fooled.startswith("Seen and true disagree after learning")
    assert "3 [3, 3] deg larger" in fooled
    assert disagreement(entries(*[result(12.0, 4.0, seen_share=0.9)] * 3)).startswith(
        "Seen and true agree after learning"
    )
    blind = result(12.0, 3.0)
    blind["after"] = made_up([3.0] * 4, not_seen=(0, 1, 2, 3))
    assert "never seen" in disagreement(entries(blind))
    assert "2 [2, 2] deg before" in sag(entries(result(12.0, 3.0)))


def test_a_nominal_robot_is_tested_at_its_targets_and_learns_in_between(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    learned_in = watch_learning(monkeypatch)
    sizes = Sizes(learned=2, targets=1, starts=2, starts_nominal=2, move=1.0, patience=1.5)
    maps = request.config.cache.mkdir("maps")
    trained_map(maps)
    found = run(NOMINAL, 3, sizes, maps)
    for when in ("before", "after"):
        assert len(found[when]["time"]) == 2
        # where it was sent, not where it started, but for gravity
        assert np.max(np.abs(np.subtract(found[when]["target"], found[when]["true"]))) < 0.2
    assert found["before"]["time"][-1] < learned_in[0]
    assert learned_in[-1] < found["after"]["time"][0]
    assert 2.0 < found["learning_time"] < 300.0


def watch_learning(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Times [s] at which the session's agent was free to learn."""
    from kengoro.session import Session

    times: list[float] = []
    step: Callable[[Session], None] = Session.step

    def watched(session: Session) -> None:
        step(session)
        if session.agent.learning:
            times.append(session.time)

    monkeypatch.setattr(Session, "step", watched)
    return times

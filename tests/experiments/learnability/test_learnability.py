"""Small learnability experiment: the error falls by learning, and only by it."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from experiments.learnability import run
from experiments.learnability.observability import observability
from experiments.learnability.observers import Variant
from experiments.learnability.run import Args, conclude, error_deg, run_trial
from experiments.learnability.trial import evaluate, learn, lower_bound
from experiments.robots.world import Body, Sizes, World, known_world
from jmm_agent.types import Floats
from kengoro_env.departures import actual

SEED = 1
SIZES = Sizes(learned=6, tested=3, move=1.2, hold=0.8, corrections=8)


@pytest.fixture(scope="module")
def world(request: pytest.FixtureRequest) -> World:
    """With a map that is trained once and kept between test runs."""
    return known_world(request.config.cache.mkdir("maps"))


@pytest.fixture(scope="module")
def body(world: World) -> Body:
    """One actual robot."""
    return Body(world, actual(SEED), SIZES)


def errors_after(body: Body, variant: Variant) -> Floats:
    """|target - true| [deg] at the tested postures after learning."""
    learned_from, tested_on = body.world.split(SEED, SIZES)
    lesson = learn(body, learned_from, variant, SEED)
    rests = evaluate(body, tested_on, lesson.map, SEED)
    return np.array([np.degrees(np.sqrt(np.mean((r.target - r.true) ** 2))) for r in rests])


@pytest.fixture(scope="module")
def before(body: Body) -> Floats:
    """Errors [deg] of the nominal map before learning."""
    rests = evaluate(body, body.world.split(SEED, SIZES)[1], body.world.map, SEED)
    return np.array([np.degrees(np.sqrt(np.mean((r.target - r.true) ** 2))) for r in rests])


def test_without_learning_the_error_stays(body: Body, before: Floats) -> None:
    assert np.median(before) > 7.0
    np.testing.assert_array_equal(errors_after(body, Variant(learns=False)), before)


@pytest.mark.parametrize("vision", ["true angles", "observations together"])
def test_learning_lowers_the_error(body: Body, before: Floats, vision: str) -> None:
    after = errors_after(body, replace(Variant(), vision=vision))
    assert np.median(after) < 0.6 * np.median(before)


def test_the_lower_bound_is_below_the_error(body: Body, before: Floats) -> None:
    found = lower_bound(body, body.world.split(SEED, SIZES)[1], SEED)
    best = [np.degrees(np.sqrt(np.mean((target - true) ** 2))) for target, true in found]
    assert np.median(best) < 0.2 * np.median(before)


def test_tested_postures_were_not_learned_from(world: World) -> None:
    learned_from, tested_on = world.split(SEED, Sizes())
    assert learned_from.shape == (28, 14)
    assert tested_on.shape == (13, 14)
    assert not {tuple(q) for q in learned_from} & {tuple(q) for q in tested_on}


def test_the_unobservable_subspace_is_not_observed(world: World) -> None:
    report = observability(world)
    low, high = report["one_observation_dimensions"]
    assert 8 <= low <= high
    assert sum(report["one_observation_share"].values()) == pytest.approx(
        (low + high) / 2, abs=high - low + 0.01
    )
    sizes = [direction["mm_per_deg"] for direction in report["many_observations"]]
    assert 0 < sizes[0] < 2.0


def test_a_run_writes_its_results(
    world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sizes = Sizes(learned=2, tested=1, move=0.1, hold=0.1, corrections=1)
    results = {}
    for trial in run.TRIALS:
        results[f"{SEED:03d}-{trial}"] = run_trial(trial, SEED, sizes, world.cache)
    args = Args(out=tmp_path, cache=world.cache, sizes=sizes)
    summary = conclude(args, [SEED], results, 0.0)
    assert json.loads((tmp_path / "summary.json").read_text()) == summary
    assert "data:image/png" in (tmp_path / "report.html").read_text()
    report = summary["per_seed"][str(SEED)]["2-together"]
    last = results[f"{SEED:03d}-2-together"]["tested"]
    assert report["target_true_deg"]["all"] == pytest.approx(
        np.median(error_deg(last, "target", "true")), abs=1e-3
    )
    assert set(report["estimate_true_deg"]) == {
        "all", "neck", "scapula", "shoulder", "forearm", "worst",
    }  # fmt: skip

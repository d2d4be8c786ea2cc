"""Ablation: variants differ as described, and verdicts follow from the numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from experiments.ablation.run import CONDITIONS, Sizes, conclude, run
from experiments.ablation.tables import (
    EQUAL,
    HOLDS,
    REVERSED,
    UNDECIDED,
    WORSE,
    Numbers,
    best_variant,
    better_than_default,
    judge_claims,
    metrics,
    variant_tables,
    verdict,
)
from experiments.harness.statistics import Interval
from experiments.robots.variants import CLAIMS, DEFAULT, NONE, PAPER, VARIANTS, Claim
from experiments.robots.world import World, known_world
from jmm_agent.mapping.learner import BatchOptions
from jmm_agent.mapping.minibatch import MinibatchRule

SEED = 1
SIZES = Sizes(learned=2, tested=1, compared=5, move=0.5, patience=1.0, test_move=0.5, test_hold=0.5)


@pytest.fixture(scope="module")
def world(request: pytest.FixtureRequest) -> World:
    """With a map that is trained once and kept between test runs."""
    return known_world(request.config.cache.mkdir("maps"))


def made_up(**more: float) -> Numbers:
    """Ten robots with equal variants, except for ``more`` [deg] of a variant's errors."""
    spread = np.random.default_rng(0).uniform(4.0, 6.0, 10)
    keys = ("target_true_deg", "estimate_seen_deg", "target_true_mm", "max_tension_N", "set_mm",
            "box_mm")  # fmt: skip
    return {
        name: {key: list(spread + more.get(name.replace("-", "_"), 0.0)) for key in keys}
        for name in CONDITIONS
    }


def test_each_variant_changes_one_option_of_its_reference() -> None:
    for name, variant in VARIANTS.items():
        reference = VARIANTS[variant.reference]
        differs = (variant.options != reference.options) + (variant.rule != reference.rule)
        assert differs == (name != variant.reference), name


def test_the_references_are_the_default_and_the_papers_plain_rule() -> None:
    default, paper = VARIANTS[DEFAULT], VARIANTS[PAPER]
    assert default.rule is None
    assert paper.rule == MinibatchRule()
    assert paper.options.vision.lengths == "l_target"
    assert paper.options.vision.fit == "alone"
    assert replace(paper.options, vision=default.options.vision) == default.options
    assert paper.options.batch == BatchOptions()


def test_claims_compare_variants_that_there_are() -> None:
    for claims in CLAIMS.values():
        assert {claim.one for claim in claims} <= set(VARIANTS)
        assert {claim.other for claim in claims} <= set(CONDITIONS)


@pytest.mark.parametrize(
    ("low", "high", "text"),
    [
        (-2, -1, HOLDS),
        (1, 2, REVERSED),
        (-0.2, 0.1, EQUAL),
        (-2, 1, UNDECIDED),
        (-0.2, 0.6, UNDECIDED),
    ],
)
def test_something_is_better_if_the_whole_interval_is_below_zero(
    low: float, high: float, text: str
) -> None:
    claim = Claim("one is better", "a", "b", "target_true_deg")
    assert verdict(claim, Interval((low + high) / 2, low, high)) == text


@pytest.mark.parametrize(
    ("low", "high", "text"), [(-2, 0.2, HOLDS), (0.1, 0.5, WORSE), (-1, 0.5, UNDECIDED)]
)
def test_something_is_not_worse_if_the_interval_ends_below_what_counts_as_equal(
    low: float, high: float, text: str
) -> None:
    claim = Claim("one is not worse", "a", "b", "target_true_deg", "not worse")
    assert verdict(claim, Interval((low + high) / 2, low, high)) == text


def test_a_variant_that_beats_the_default_is_named_and_counted() -> None:
    alike = made_up()
    assert better_than_default(alike) == []
    assert metrics(alike)["variants_better_than_default"]["reached"] is True
    beaten = made_up(default_l=-1.0, paper_l=1.0)
    assert better_than_default(beaten) == ["default-l"]
    assert best_variant(beaten) == "default-l"
    text = metrics(beaten)
    assert text["variants_better_than_default"]["reached"] is False
    assert text["default_minus_best_other"]["median"] == pytest.approx(1.0)
    assert "default-l, the best" in [row[0] for row in variant_tables(beaten)[0].rows]
    assert "Significantly better than the default: default-l." in variant_tables(beaten)[0].note


def test_a_map_that_fools_its_own_estimate_is_mentioned() -> None:
    found = made_up()
    assert "never disagree significantly" in variant_tables(found)[0].note
    found["default-l"]["estimate_seen_deg"] = [1.0] * 10
    found["default-l"]["target_true_deg"] = [9.0] * 10
    text = "compared with the reference for: default-l; compared with no learning for: default-l."
    assert text in variant_tables(found)[0].note


def test_with_few_robots_claims_are_undecided() -> None:
    few = {
        name: {key: values[:2] for key, values in outcomes.items()}
        for name, outcomes in made_up(default_l=-1.0).items()
    }
    assert {claim["verdict"] for claim in judge_claims(few)} == {UNDECIDED}
    assert better_than_default(few) == []
    assert metrics(few)["variants_better_than_default"]["reached"] is None
    assert "too few robots" in variant_tables(few)[0].note


def test_claims_are_judged_by_the_numbers() -> None:
    found = made_up(paper_no_rehearsal=3.0, paper_vision=-2.0, none=5.0)
    text = {(c["rule"], c["claim"]): c["verdict"] for c in judge_claims(found)}
    assert text[PAPER, "the whole rehearsal batch prevents over-fitting of the map"] == HOLDS
    assert text[PAPER, "rehearsal of random pairs prevents over-fitting of the map"] == EQUAL
    assert text[PAPER, "the updaters do not compete: error"] == WORSE
    assert text[DEFAULT, "the updaters do not compete: error"] == HOLDS
    assert text[DEFAULT, "learning by both updaters lowers the error"] == HOLDS


@pytest.mark.slow
def test_updaters_that_are_off_do_not_fire_and_one_robot_serves_all(world: World) -> None:
    runs = {
        name: run(name, SEED, SIZES, world.cache)
        for name in (NONE, "default-antagonism", "default-vision", DEFAULT)
    }
    for name, updaters in {
        NONE: (False, False),
        "default-antagonism": (True, False),
        "default-vision": (False, True),
        DEFAULT: (True, True),
    }.items():
        fired = (runs[name]["antagonism_updates"] > 0, runs[name]["vision_updates"] > 0)
        assert fired == updaters, name
    assert run("default-vision", SEED, SIZES, world.cache) == runs["default-vision"]
    maps = {result["box_mm"] for result in runs.values()}
    assert len(maps) == 4
    results = {
        seed: {name: runs.get(name, runs[DEFAULT]) for name in CONDITIONS} for seed in (1, 2)
    }
    found = conclude(results, SIZES)
    assert len(found.pictures) == 3

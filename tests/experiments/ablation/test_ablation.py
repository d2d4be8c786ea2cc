"""The ablation: each variant is what it is called, and verdicts follow from the numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from experiments.ablation.run import CONDITIONS, Sizes, conclude, run
from experiments.ablation.tables import (
    EQUAL,
    HOLDS,
    OPEN,
    REVERSED,
    WORSE,
    Numbers,
    better_than_default,
    metrics,
    told_claims,
    variant_tables,
    verdict,
    winner,
)
from experiments.harness.statistics import Interval
from experiments.learnability.run import known_world
from experiments.robots.variants import CLAIMS, DEFAULT, NONE, PAPER, VARIANTS, Claim
from experiments.robots.world import World
from jmm_agent.mapping.learner import BatchOptions
from jmm_agent.mapping.minibatch import MinibatchRule

SEED = 1
SIZES = Sizes(learned=2, tested=1, compared=5, move=0.5, patience=1.0, test_move=0.5, test_hold=0.5)


@pytest.fixture(scope="module")
def world(request: pytest.FixtureRequest) -> World:
    """With a map that is trained once and kept between test runs."""
    return known_world(request.config.cache.mkdir("maps"))


def made_up(**more: float) -> Numbers:
    """Ten robots on which all variants are alike, but for ``more`` [deg] of a variant's errors."""
    spread = np.random.default_rng(0).uniform(4.0, 6.0, 10)
    keys = ("target_true_deg", "estimate_seen_deg", "target_true_mm", "max_tension_N", "set_mm",
            "box_mm")  # fmt: skip
    return {
        name: {key: list(spread + more.get(name.replace("-", "_"), 0.0)) for key in keys}
        for name in CONDITIONS
    }


def test_each_variant_changes_one_thing_of_its_reference() -> None:
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
    ("low", "high", "told"),
    [(-2, -1, HOLDS), (1, 2, REVERSED), (-0.2, 0.1, EQUAL), (-2, 1, OPEN), (-0.2, 0.6, OPEN)],
)
def test_something_is_better_if_the_whole_interval_is_below_zero(
    low: float, high: float, told: str
) -> None:
    claim = Claim("one is better", "a", "b", "target_true_deg")
    assert verdict(claim, Interval((low + high) / 2, low, high)) == told


@pytest.mark.parametrize(
    ("low", "high", "told"), [(-2, 0.2, HOLDS), (0.1, 0.5, WORSE), (-1, 0.5, OPEN)]
)
def test_something_is_not_worse_if_the_interval_ends_below_what_counts_as_equal(
    low: float, high: float, told: str
) -> None:
    claim = Claim("one is not worse", "a", "b", "target_true_deg", "not worse")
    assert verdict(claim, Interval((low + high) / 2, low, high)) == told


def test_a_variant_that_beats_the_default_is_named_and_counted() -> None:
    alike = made_up()
    assert better_than_default(alike) == []
    assert metrics(alike)["variants_better_than_default"]["reached"] is True
    beaten = made_up(default_l=-1.0, paper_l=1.0)
    assert better_than_default(beaten) == ["default-l"]
    assert winner(beaten) == "default-l"
    told = metrics(beaten)
    assert told["variants_better_than_default"]["reached"] is False
    assert told["default_minus_best_other"]["median"] == pytest.approx(1.0)
    assert "default-l, the winner" in [row[0] for row in variant_tables(beaten)[0].rows]
    assert "Surely better than the default: default-l." in variant_tables(beaten)[0].note


def test_a_map_that_fools_its_own_estimate_is_told() -> None:
    found = made_up()
    assert "Nowhere do" in variant_tables(found)[0].note
    found["default-l"]["estimate_seen_deg"] = [1.0] * 10
    found["default-l"]["target_true_deg"] = [9.0] * 10
    told = "beside the reference for: default-l; beside no learning for: default-l."
    assert told in variant_tables(found)[0].note


def test_of_few_robots_nothing_is_told() -> None:
    few = {
        name: {key: values[:2] for key, values in outcomes.items()}
        for name, outcomes in made_up(default_l=-1.0).items()
    }
    assert {claim["verdict"] for claim in told_claims(few)} == {OPEN}
    assert better_than_default(few) == []
    assert metrics(few)["variants_better_than_default"]["reached"] is None
    assert "too few robots" in variant_tables(few)[0].note


def test_claims_are_judged_by_the_numbers() -> None:
    found = made_up(paper_no_rehearsal=3.0, paper_vision=-2.0, none=5.0)
    told = {(c["rule"], c["claim"]): c["verdict"] for c in told_claims(found)}
    assert told[PAPER, "the whole rehearsal batch keeps the map from over-fitting"] == HOLDS
    assert told[PAPER, "rehearsing random pairs keeps the map from over-fitting"] == EQUAL
    assert told[PAPER, "both do not compete: error"] == WORSE
    assert told[DEFAULT, "both do not compete: error"] == HOLDS
    assert told[DEFAULT, "learning by both updaters lowers the error"] == HOLDS


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

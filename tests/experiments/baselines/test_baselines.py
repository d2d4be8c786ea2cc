"""Baselines: all methods get the same pairs, and the notes follow from the numbers."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from experiments.baselines.maps import Baselines
from experiments.baselines.run import Sizes, conclude, gather, methods, run
from experiments.baselines.tables import (
    GAUSSIAN,
    NO_LEARNING,
    OURS,
    POLYNOMIALS,
    TABLE,
    Numbers,
    counted_tables,
    metrics,
)
from experiments.robots.conditions import ACTUAL, NOMINAL
from experiments.robots.world import World, known_world
from jmm_agent.agent import AgentOptions
from kengoro.agents import make_agent
from kengoro.robots import shuffled_postures

SEED = 1
SIZES = Sizes(
    counts=(1, 3), counts_nominal=(1,), tested=1, move=0.6, patience=2.0, test_move=0.6,
    test_hold=0.6,
)  # fmt: skip
METHODS = {NO_LEARNING, *POLYNOMIALS.values(), TABLE, GAUSSIAN, OURS}


@pytest.fixture(scope="module")
def world(request: pytest.FixtureRequest) -> World:
    """With a map that is trained once and kept between test runs."""
    return known_world(request.config.cache.mkdir("maps"))


def without_times(result: dict[str, Any]) -> str:
    text = json.loads(json.dumps(result))
    for part in text["counts"].values():
        for tried in part["maps"].values():
            tried.pop("update_ms", None)
    return json.dumps(text)


def test_pairs_are_gathered_by_number_of_postures(world: World) -> None:
    agent = make_agent(SEED, jmm=world.map, options=AgentOptions(feed_forward=False))
    stages = gather(agent, ACTUAL, SEED, shuffled_postures(SEED), SIZES, world)
    assert list(stages) == [1, 3]
    for count, stage in stages.items():
        assert 0 < len(stage.pairs.noise) == len(stage.one_observation.noise) <= count
        np.testing.assert_array_equal(stage.pairs.lengths, stage.one_observation.lengths)
        apart = np.abs(stage.pairs.postures - stage.one_observation.postures)
        assert 0.001 < apart.max() < 1.0
    assert stages[3].map is agent.map
    assert stages[1].map is not agent.map
    assert stages[1].detector.fired == 1
    assert stages[3].detector.fired == agent.vision.fired > 1
    assert stages[3].detector is not agent.vision


def test_every_method_learns_from_the_pairs(world: World) -> None:
    agent = make_agent(SEED, jmm=world.map, options=AgentOptions(feed_forward=False))
    stage = gather(agent, ACTUAL, SEED, shuffled_postures(SEED), SIZES, world)[3]
    made = methods(world, Baselines(world.map, world.postures), SEED)
    assert {NO_LEARNING, *made} == METHODS
    before = np.abs(world.map.lengths(stage.pairs.postures) - stage.pairs.lengths).mean()
    for name, make in made.items():
        after = make(stage.pairs).lengths(stage.pairs.postures) - stage.pairs.lengths
        assert np.abs(after).mean() < 0.25 * before, name


@pytest.mark.slow
def test_a_run_repeats_and_its_findings_can_be_written(world: World) -> None:
    result = run(ACTUAL, SEED, SIZES, world.cache)
    nominal = run(NOMINAL, SEED, SIZES, world.cache)
    again = run(NOMINAL, SEED, SIZES, world.cache)
    assert without_times(nominal) == without_times(again)
    for part in result["counts"].values():
        assert set(part["maps"]) == METHODS
    found = conclude({SEED: {ACTUAL: result, NOMINAL: nominal}}, SIZES)
    json.dumps([found.per_seed, found.metrics], allow_nan=False)
    learned = found.per_seed[SEED]["3"]  # type: ignore[index]
    assert learned[OURS]["target_true_deg"] < 0.7 * learned[NO_LEARNING]["target_true_deg"]
    assert [picture.png[:4] for picture in found.pictures] == [b"\x89PNG"] * 3


def made_up(**errors: float) -> Numbers:
    """Six robots with given errors of two methods by both definitions."""
    spread = np.linspace(0.0, 0.1, 6)
    keys = ("target_true_deg", "estimate_seen_deg", "target_true_mm", "max_tension_N")
    return {
        name: {key: list(spread + errors[f"{location}_{key[:1]}"]) for key in keys[:2]}
        | {key: list(spread) for key in keys[2:]}
        for location, name in (("ours", OURS), ("table", TABLE))
    }


def test_the_best_method_is_named_by_both_definitions() -> None:
    agreed = made_up(ours_t=2.0, ours_e=1.0, table_t=3.0, table_e=2.0)
    torn = made_up(ours_t=2.0, ours_e=3.0, table_t=3.0, table_e=1.0)
    notes = [table.note for table in counted_tables({5: agreed, 27: torn}, {5: [5], 27: [26]})]
    assert "Best by target - true and by estimate - seen: ours." in notes[0]
    assert "Best by target - true: ours; by estimate - seen: table." in notes[1]
    assert "significantly better than ours: none; significantly worse: table." in notes[0]
    entries = metrics({5: agreed})
    assert entries["ours_minus_best_other_5"]["median"] == pytest.approx(-1.0)

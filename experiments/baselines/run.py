"""Baselines: other methods with the same measurements (paper, sec. I, II).

The default agent visits postures and learns. After some numbers of postures its pairs are given to
other methods: polynomial regression, a table, a Gaussian process. Each makes a map from them, and
every map moves the same robot to the same new postures.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from experiments.baselines.maps import Baselines
from experiments.baselines.tables import (
    GAUSSIAN,
    NO_LEARNING,
    OURS,
    POLYNOMIALS,
    TABLE,
    Numbers,
    counted_tables,
    metrics,
    nominal_table,
    one_observation_table,
)
from experiments.harness import common
from experiments.harness.common import Summary
from experiments.harness.experiment import Experiment, Findings, Results, run_experiment
from experiments.robots.conditions import ACTUAL, NOMINAL, make_session
from experiments.robots.evaluation import Evaluator, PostureMap
from experiments.robots.world import World, known_world
from jmm_agent.agent import Agent, AgentOptions
from jmm_agent.mapping.learner import BatchOptions, Learner, Pairs, RidgeRule
from jmm_agent.types import Floats
from jmm_agent.updaters import VisionUpdater
from jmm_agent.vision.observation_fit import MarkerObservation, ObservationFitOptions, fit_alone
from kengoro.agents import make_agent
from kengoro.robots import HAND, shuffled_postures
from kengoro.visits import errors, visit

COMPARED = 27
"""Largest number of postures after which both kinds of fit of the observations are compared."""


@dataclass(frozen=True)
class Sizes:
    """Amount of work on each robot.

    Attributes:
        counts: numbers of postures after which maps are made and tested.
        counts_nominal: the same, for the robot without departures.
        tested: number of other postures in a test.
        move: duration of a movement while learning [s].
        patience: longest wait for rest and an observation while learning [s].
        test_move: duration of a movement in the test [s].
        test_hold: time to come to rest in the test [s].
    """

    counts: tuple[int, ...] = (5, 10, 27, 81)
    counts_nominal: tuple[int, ...] = (27,)
    tested: int = 8
    move: float = 1.0
    patience: float = 2.0
    test_move: float = 1.2
    test_hold: float = 1.2


QUICK = Sizes(
    counts=(1, 3),
    counts_nominal=(1,),
    tested=1,
    move=0.5,
    patience=1.0,
    test_move=0.3,
    test_hold=0.2,
)


class Stage(NamedTuple):
    """State of learning after some postures.

    Attributes:
        map: of the agent.
        pairs: of the agent, from observations fitted together.
        one_observation: pairs from each observation alone, as in the paper.
        detector: Vision Updater of the agent, with the observations in its memory.
    """

    map: PostureMap
    pairs: Pairs
    one_observation: Pairs
    detector: VisionUpdater


@cache
def _baselines(maps: Path | None) -> Baselines:
    """Baselines of this process, with polynomials fitted to the nominal model."""
    world = known_world(maps)
    return Baselines(world.map, world.postures)


def methods(
    world: World, baselines: Baselines, seed: int
) -> dict[str, Callable[[Pairs], PostureMap]]:
    """Methods that make a map from pairs, by name; ours is one update of the nominal map."""

    def ours(pairs: Pairs) -> PostureMap:
        rule, rng = RidgeRule(world.prior), np.random.default_rng([seed, 7])
        learner = Learner(world.map, world.limits, rule, BatchOptions(), rng)
        learner.learn(pairs, pairs.last(0))
        return learner.map

    def polynomial(degree: int) -> Callable[[Pairs], PostureMap]:
        return lambda pairs: baselines.polynomial(degree, pairs)

    return {
        **{name: polynomial(degree) for degree, name in POLYNOMIALS.items()},
        TABLE: baselines.table,
        GAUSSIAN: baselines.process,
        OURS: ours,
    }


def gather(
    agent: Agent, condition: str, seed: int, postures: Floats, sizes: Sizes, world: World
) -> dict[int, Stage]:
    """Visit postures, shape (K, n) [rad], and learn; returns the stage after each count."""
    counts = sizes.counts if condition == ACTUAL else sizes.counts_nominal
    session = make_session(condition, seed, agent, postures[0])
    alone, seen, stages = agent.vision.pairs, agent.seen, {}
    for count, posture in enumerate(postures[1 : 1 + max(counts)], start=1):
        visit(session, posture, None, sizes.move, sizes.patience)
        if agent.seen is not None and agent.seen is not seen and agent.seen.learned:
            alone = alone.joined(_one_observation(agent, world))
        seen = agent.seen
        if count in counts:
            stages[count] = Stage(agent.map, agent.vision.pairs, alone, deepcopy(agent.vision))
    session.env.close()
    return stages


def _one_observation(agent: Agent, world: World) -> Pairs:
    """The newest pair by the paper's inverse kinematics of its observation alone.

    There is no pair if the newest observation gave none to the agent.
    """
    newest, seen = agent.vision.pairs.last(1), agent.seen
    if seen is None or not np.array_equal(newest.postures, seen.angles[None]):
        return newest.last(0)
    pose = agent.markers[HAND].pose_marker_in_camera
    observation = MarkerObservation(pose, newest.lengths[0], seen.angles + seen.error)
    fit = fit_alone(observation, world.marker_residual, world.limits, ObservationFitOptions())
    return newest._replace(postures=fit.angles)


def run(condition: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """Run one robot: the agent measures, then the map of every method is tested at each count.

    Only the times differ between runs with the same seed.
    """
    world = known_world(cache)
    postures = shuffled_postures(seed)
    tested = postures[-1 - sizes.tested :]
    # Without feed-forward: maps alone command the robot that compares them.
    agent = make_agent(seed, jmm=world.map, options=AgentOptions(feed_forward=False))
    stages = gather(agent, condition, seed, postures, sizes, world)
    evaluator = Evaluator(world, condition, seed, sizes.test_move, sizes.test_hold)

    def evaluated(jmm: PostureMap, detector: VisionUpdater) -> dict[str, Any]:
        return {"visits": evaluator.evaluate(jmm, tested, detector)}

    result: dict[str, Any] = {"counts": {}, "one_observation": {}}
    for count, stage in stages.items():
        maps = {NO_LEARNING: evaluated(world.map, stage.detector)}
        for name, make in methods(world, _baselines(cache), seed).items():
            begin = time.process_time()
            jmm = make(stage.pairs)
            milliseconds = 1e3 * (time.process_time() - begin)
            maps[name] = evaluated(stage.map if name == OURS else jmm, stage.detector)
            maps[name]["update_ms"] = round(milliseconds, 2)
            if condition == ACTUAL and count == _compared_count(sizes):
                result["one_observation"][name] = evaluated(
                    make(stage.one_observation), stage.detector
                )
        result["counts"][str(count)] = {"maps": maps, "pairs": len(stage.pairs.noise)}
    return result


def _compared_count(sizes: Sizes) -> int:
    """Number of postures after which both kinds of fit are compared."""
    return max(count for count in sizes.counts if count <= COMPARED)


def numbers(results: Results, condition: str, count: int | None) -> Numbers:
    """Outcomes of each method, with one number a robot.

    Args:
        results: of all robots.
        condition: `ACTUAL` or `NOMINAL`.
        count: number of postures; None for pairs from each observation alone.
    """
    found: Numbers = {}
    for result in results.values():
        part = result[condition]
        maps = part["one_observation"] if count is None else part["counts"][str(count)]["maps"]
        for name, tried in maps.items():
            outcomes = errors(tried["visits"])
            if "update_ms" in tried:
                outcomes["update_ms"] = tried["update_ms"]
            for key, number in outcomes.items():
                found.setdefault(name, {}).setdefault(key, []).append(number)
    return found


def conclude(results: Results, sizes: Sizes) -> Findings:
    """Errors of all methods by number of postures, and differences from ours."""
    from experiments.baselines.figures import pictures

    by_count = {count: numbers(results, ACTUAL, count) for count in sizes.counts}
    without = {count: numbers(results, NOMINAL, count) for count in sizes.counts_nominal}
    compared = _compared_count(sizes)
    together, alone = by_count[compared], numbers(results, ACTUAL, None)
    pairs = {
        count: [result[ACTUAL]["counts"][str(count)]["pairs"] for result in results.values()]
        for count in sizes.counts
    }
    kept = ("target_true_deg", "estimate_seen_deg", "target_true_mm")
    per_seed = {
        seed: {
            str(count): {
                name: {key: outcomes[key][rank] for key in kept} for name, outcomes in found.items()
            }
            for count, found in by_count.items()
        }
        for rank, seed in enumerate(results)
    }
    counted = dict(zip(by_count, counted_tables(by_count, pairs), strict=True))
    tables = [
        counted.pop(compared),
        *counted.values(),
        one_observation_table(together, alone, compared),
        *(nominal_table(found, count) for count, found in without.items()),
    ]
    shown = pictures(by_count, together, alone, compared)
    return Findings(metrics(by_count), per_seed, tables, shown, {})


EXPERIMENT = Experiment(
    name="baselines",
    title="Baselines",
    introduction=(
        "The default agent visits postures with its camera and learns. After some postures its "
        "pairs of joint angles and lengths are given to every method, so all have the same "
        "measurements, and the baselines profit from our fit of observations and from "
        "min(l, l_target). The map of each method then moves the same robot from the same start to "
        "the same new postures without further learning. This test uses no camera: the Vision "
        "Updater of the agent at that time, the same for all methods, gets the exact pose of the "
        "marker. Polynomials are fitted to samples of the nominal model and corrected by ridge "
        "regression of the pairs; table and Gaussian process model the residuals of the nominal "
        "map; parameters of polynomials and Gaussian process are chosen at each update by the "
        "marginal likelihood. No learning is the network trained offline on the nominal model."
    ),
    figure="methods of sec. I and II",
    conditions=(ACTUAL, NOMINAL),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
)


@dataclass(frozen=True)
class Args(common.Args):
    """Other methods, with the same measurements."""

    seeds: str = "0-9"
    out: Path = Path("out/baselines")


def main(args: Args) -> Summary:
    """Run the experiment; returns its summary."""
    return run_experiment(EXPERIMENT, args)

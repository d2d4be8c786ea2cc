"""Baselines: what others would learn from the same measurements (paper, sec. I, II).

The default agent visits postures and learns. Now and then the pairs that it believes are handed to
methods that others use: polynomial regression, a table, a Gaussian process. Each makes a map of
them, and every map moves the same robot to the same new postures.
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
    drawing_table,
    metrics,
    one_observation_table,
)
from experiments.harness.experiment import Findings, Results, Study
from experiments.learnability.run import known_world
from experiments.robots.evaluation import Examiner, PostureMap
from experiments.robots.world import World
from jmm_agent.agent import Agent
from jmm_agent.mapping.learner import BatchOptions, Learner, Pairs, RidgeRule
from jmm_agent.types import Floats
from jmm_agent.updaters import VisionUpdater
from jmm_agent.vision.observation_fit import MarkerObservation, ObservationFitOptions, fit_alone
from kengoro.arm import ACTUAL, HAND, NOMINAL, make_agent, make_session, shuffled_postures
from kengoro.visits import errors, visit

COMPARED = 27
"""Postures, at most, after which looks fitted together are compared with each look alone."""


@dataclass(frozen=True)
class Sizes:
    """How much is done on each robot.

    Attributes:
        counts: numbers of postures after which maps are made and tested.
        counts_drawing: the same for the robot without departures.
        tested: other postures to which the arm is moved then.
        move: duration of a movement while learning [s].
        patience: longest wait for rest and a look while learning [s].
        test_move: duration of a movement in the test [s].
        test_hold: time to come to rest in the test [s].
    """

    counts: tuple[int, ...] = (5, 10, 27, 81)
    counts_drawing: tuple[int, ...] = (27,)
    tested: int = 8
    move: float = 1.0
    patience: float = 2.0
    test_move: float = 1.2
    test_hold: float = 1.2


QUICK = Sizes(
    counts=(1, 3),
    counts_drawing=(1,),
    tested=1,
    move=0.5,
    patience=1.0,
    test_move=0.3,
    test_hold=0.2,
)


class Stage(NamedTuple):
    """What is there after some postures.

    Attributes:
        map: of the agent that learned.
        pairs: that it believes, of looks fitted together.
        one_look: those of each look alone, as in the paper.
        eyes: of the agent, with all looks that it remembers.
    """

    map: PostureMap
    pairs: Pairs
    one_observation: Pairs
    detector: VisionUpdater


@cache
def _baselines(maps: Path | None) -> Baselines:
    """The baselines of this process, their polynomials fitted to the drawing."""
    world = known_world(maps)
    return Baselines(world.map, world.postures)


def methods(
    world: World, baselines: Baselines, seed: int
) -> dict[str, Callable[[Pairs], PostureMap]]:
    """By name, what makes a map from pairs; ours as one update of the drawing's map."""

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
    """Visit postures (K, n) [rad] and learn; what is there after each number of postures."""
    counts = sizes.counts if condition == ACTUAL else sizes.counts_drawing
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
    """The agent's newest pair as the paper's inverse kinematics of its look alone has it; none if
    the newest look gave no pair."""
    newest, seen = agent.vision.pairs.last(1), agent.seen
    if seen is None or not np.array_equal(newest.postures, seen.angles[None]):
        return newest.last(0)
    pose = agent.markers[HAND].pose_marker_in_camera
    look = MarkerObservation(pose, newest.lengths[0], seen.angles + seen.error)
    fit = fit_alone(look, world.sight, world.limits, ObservationFitOptions())
    return newest._replace(postures=fit.angles)


def run(condition: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """One robot: measurements by the agent, then every method's map tested by number of postures.

    All but the times is the same for the same seed.
    """
    world = known_world(cache)
    postures = shuffled_postures(seed)
    tested = postures[-1 - sizes.tested :]
    agent = make_agent(world.map, seed)
    stages = gather(agent, condition, seed, postures, sizes, world)
    examiner = Examiner(world, condition, seed, sizes.test_move, sizes.test_hold)

    def examined(jmm: PostureMap, detector: VisionUpdater) -> dict[str, Any]:
        return {"visits": examiner.examine(jmm, tested, detector)}

    result: dict[str, Any] = {"counts": {}, "one_look": {}}
    for count, stage in stages.items():
        maps = {NO_LEARNING: examined(world.map, stage.detector)}
        for name, make in methods(world, _baselines(cache), seed).items():
            begin = time.process_time()
            jmm = make(stage.pairs)
            milliseconds = 1e3 * (time.process_time() - begin)
            maps[name] = examined(stage.map if name == OURS else jmm, stage.detector)
            maps[name]["update_ms"] = round(milliseconds, 2)
            if condition == ACTUAL and count == _looks_compared(sizes):
                result["one_look"][name] = examined(make(stage.one_observation), stage.detector)
        result["counts"][str(count)] = {"maps": maps, "pairs": len(stage.pairs.noise)}
    return result


def _looks_compared(sizes: Sizes) -> int:
    """Number of postures after which looks fitted together are compared with looks alone."""
    return max(count for count in sizes.counts if count <= COMPARED)


def numbers(results: Results, condition: str, count: int | None) -> Numbers:
    """Outcomes of each method after ``count`` postures, one number a robot; None: looks alone."""
    found: Numbers = {}
    for result in results.values():
        part = result[condition]
        maps = part["one_look"] if count is None else part["counts"][str(count)]["maps"]
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
    without = {count: numbers(results, NOMINAL, count) for count in sizes.counts_drawing}
    compared = _looks_compared(sizes)
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
        *(drawing_table(found, count) for count, found in without.items()),
    ]
    drawn = pictures(by_count, together, alone, compared)
    return Findings(metrics(by_count), per_seed, tables, drawn, {})


STUDY = Study(
    name="baselines",
    title="Baselines",
    introduction=(
        "The default agent visits postures with its camera and learns. After some postures the "
        "pairs of joint angles and lengths that it believes then are handed to every method: all "
        "have the same measurements, and the baselines profit from our fit of looks and from "
        "min(l, l_target). Each method's map then moves the same robot from the same start to the "
        "same new postures, with nothing more learned. The test needs no camera: the exact pose of "
        "the marker is seen through the eyes of the agent at that time, the same for all "
        "methods. Polynomials are regressed on samples of the drawing, then moved by ridge "
        "regression of the pairs; table and Gaussian process hold what the drawing misses; free "
        "numbers of polynomials and Gaussian process are chosen at each update by the marginal "
        "likelihood. No learning is the network trained offline once on the drawing."
    ),
    figure="methods of sec. I and II",
    conditions=(ACTUAL, NOMINAL),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
)

"""Trial of the learnability experiment: learning, test, and lower bound of the error."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from experiments.learnability.observers import MarkerObserver, Observer, TrueObserver, Variant
from experiments.robots.world import Body, Rest, World
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import BatchOptions, Learner, RidgeRule, Rule
from jmm_agent.mapping.minibatch import MinibatchRule
from jmm_agent.types import Floats
from jmm_agent.updaters import AntagonismOptions, AntagonismUpdater


class Lesson(NamedTuple):
    """Result of learning.

    Attributes:
        map: after the last posture.
        rests: the robot at rest at each posture.
        seen: observed joint angles at each posture, shape (n,) [rad]; empty without learning.
        pairs: number of pairs in the memory.
    """

    map: JointMuscleMap
    rests: list[Rest]
    seen: list[Floats]
    pairs: int


def learn(body: Body, postures: Floats, variant: Variant, seed: int) -> Lesson:
    """Visit postures after the first and learn at each with both updaters (sec. III)."""
    world = body.world
    learner = Learner(
        world.map, world.limits, _rule(world, variant), BatchOptions(), np.random.default_rng(seed)
    )
    antagonism = AntagonismUpdater(learner, AntagonismOptions())
    observer: Observer
    if variant.vision == "true angles":
        observer = TrueObserver(world, learner, variant, np.random.default_rng([seed, 2]))
    else:
        observer = MarkerObserver(world, learner, variant)
    body.reset(postures[0], np.random.default_rng([seed, 3]))
    rests, seen = [], []
    for target in postures[1:]:
        rests.append(body.go(target, learner.map))
        if variant.learns:
            antagonism.settled(rests[-1].estimate, rests[-1].lengths, observer.pairs)
            seen.append(observer.observe(rests[-1], antagonism.pairs))
    return Lesson(learner.map, rests, seen, len(observer.pairs.noise))


def evaluate(body: Body, postures: Floats, jmm: JointMuscleMap, seed: int) -> list[Rest]:
    """Visit postures after the first by a map, without learning, from a new start."""
    body.reset(postures[0], np.random.default_rng([seed, 4]))
    return [body.go(target, jmm) for target in postures[1:]]


def lower_bound(body: Body, postures: Floats, seed: int) -> list[tuple[Floats, Floats]]:
    """Postures after the first, each with the true angles of the best command that is found.

    The command is corrected by the true error, which no agent knows,
    l_target += G(q_true) (q_target - q_true), on the robot at rest, and the best one is kept.

    Args:
        body: the robot.
        postures: joint angles, shape (K, n) [rad].
        seed: of the start.

    Returns:
        Pairs of target and true angles, shape (n,) [rad] each.
    """
    arm, jmm = body.world.arm, body.world.map
    body.reset(postures[0], np.random.default_rng([seed, 4]))
    found = []
    for target in postures[1:]:
        best = true = body.go(target, jmm).true
        command = jmm.lengths(target)
        for _ in range(body.sizes.corrections):
            command = command + arm.moment_arms(true) @ (target - true)
            true = body.shift(target, command)
            best = min(best, true, key=lambda q: float(np.linalg.norm(q - target)))
        found.append((target, best))
    return found


def _rule(world: World, variant: Variant) -> Rule:
    if variant.rule == "ridge":
        return RidgeRule(world.prior)
    return MinibatchRule(all_layers=variant.rule == "minibatch")

"""One trial of the learnability study: a robot learns, is tested, and its floor is found."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from experiments.learnability.observers import MarkerWatcher, TrueWatcher, Variant, Watcher
from experiments.robots.world import Body, Rest, World
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import BatchOptions, Learner, RidgeRule, Rule
from jmm_agent.mapping.minibatch import MinibatchRule
from jmm_agent.types import Floats
from jmm_agent.updaters import AntagonismOptions, AntagonismUpdater


class Lesson(NamedTuple):
    """What was learned.

    Attributes:
        map: after the last posture.
        rests: the robot at each posture on the way.
        seen: what vision said of each, joint angles (n,) [rad]; empty without learning.
        pairs: number of looks that were believed and are remembered.
    """

    map: JointMuscleMap
    rests: list[Rest]
    seen: list[Floats]
    pairs: int


def learn(body: Body, postures: Floats, variant: Variant, seed: int) -> Lesson:
    """Visit postures after the first and learn at each, both updaters at work (sec. III)."""
    world = body.world
    learner = Learner(
        world.map, world.limits, _rule(world, variant), BatchOptions(), np.random.default_rng(seed)
    )
    antagonism = AntagonismUpdater(learner, AntagonismOptions())
    watcher: Watcher
    if variant.vision == "true angles":
        watcher = TrueWatcher(world, learner, variant, np.random.default_rng([seed, 2]))
    else:
        watcher = MarkerWatcher(world, learner, variant)
    body.reset(postures[0], np.random.default_rng([seed, 3]))
    rests, seen = [], []
    for target in postures[1:]:
        rests.append(body.go(target, learner.map))
        if variant.learns:
            antagonism.settled(rests[-1].estimate, rests[-1].lengths, watcher.pairs)
            seen.append(watcher.look(rests[-1], antagonism.pairs))
    return Lesson(learner.map, rests, seen, len(watcher.pairs.noise))


def examine(body: Body, postures: Floats, jmm: JointMuscleMap, seed: int) -> list[Rest]:
    """Visit postures after the first by a map, from a fresh start, without learning."""
    body.reset(postures[0], np.random.default_rng([seed, 4]))
    return [body.go(target, jmm) for target in postures[1:]]


def floor(body: Body, postures: Floats, seed: int) -> list[tuple[Floats, Floats]]:
    """For each posture after the first: it, and the true angles under the best command found.

    The command is corrected by what is missing in truth, which no agent knows,
    l_target += G(q_true) (q_target - q_true), on the robot at rest; the best of all is kept.
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

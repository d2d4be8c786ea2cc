"""Methods that get what our agent observed: joint angles, tensions and lengths of all its looks.

A look while a muscle is saturated makes no pair of our agent; all others get it, too.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from experiments.baselines.maps import Baselines
from experiments.few_observations.methods import GAUSSIAN, GIVEN, OFFSETS, POLYNOMIAL
from experiments.few_observations.successor_data import Initial, Observed
from experiments.few_observations.successors import Successors
from experiments.robots.evaluation import PostureMap, TensionMap
from experiments.robots.world import World, known_world
from jmm_agent.mapping.group_map import METRES
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Pairs
from jmm_agent.updaters import VisionUpdater
from jmm_agent.vision.permanent_elongation import elongations

NOISE = 0.001
"""Standard deviation of the lengths of a look [m]."""


def observed_rests(vision: VisionUpdater, world: World) -> Observed:
    """Rests in which an agent saw its hand, with the joint angles that it fitted to them all.

    Lengths from before a permanent elongation are what they would be now.

    Args:
        vision: of the agent.
        world: nominal model, by which torques of the loads are computed.
    """
    memory, joints, muscles = vision.memory, len(world.limits), len(world.map.muscles)
    if not memory.observations:
        none, of_joints = np.empty((0, muscles)), np.empty((0, joints))
        return Observed(of_joints, none, none, of_joints)
    longer = elongations(memory.observations, world.prior, memory.angles, memory.elongated)
    return Observed(
        memory.angles,
        np.array([found.tensions for found in memory.observations]),
        np.array([found.lengths for found in memory.observations]) - longer,
        np.array([world.arm.gravity(q) for q in memory.angles]),
    )


def with_offsets(nominal: JointMuscleMap, pairs: Pairs) -> JointMuscleMap:
    """The drawing with one constant added to each muscle, the mean over pairs."""
    if not len(pairs.noise):
        return nominal
    offsets = np.mean(pairs.lengths - nominal.lengths(pairs.postures), axis=0) / METRES
    groups = nominal.groups
    return nominal.with_output_layers(
        {group.name: (group.W2, group.b2 + offsets[group.muscle_index]) for group in groups}
    )


class Given:
    """Maps of the methods that are given our looks.

    Args:
        world: nominal model and typical postures.
        initial: training of the autoencoder.
        folder: of trained maps; the user's cache folder if left out.
    """

    def __init__(self, world: World, initial: Initial, folder: Path | None) -> None:
        self._nominal = world.map
        self._baselines = Baselines(world.map, world.postures)
        self._successors = Successors(world, initial, folder)

    def map(self, name: str, seen: Observed) -> PostureMap | TensionMap:
        """The map that a method makes of looks.

        Args:
            name: one of `methods.GIVEN`.
            seen: looks.
        """
        pairs = Pairs(seen.angles, seen.lengths, np.full(len(seen.angles), NOISE))
        if name == OFFSETS:
            return with_offsets(self._nominal, pairs)
        if name == GAUSSIAN:
            return self._baselines.process(pairs)
        if name == POLYNOMIAL:
            return self._baselines.polynomial(3, pairs)
        return self._successors.map(name, seen)

    def maps(self, seen: Observed) -> dict[str, PostureMap | TensionMap]:
        """Maps of all methods by name; see `map`."""
        return {name: self.map(name, seen) for name in GIVEN}


@cache
def known_given(folder: Path | None, steps: int) -> Given:
    """The methods in this process, with the maps in a folder.

    Args:
        folder: of trained maps; the user's cache folder if left out.
        steps: of the autoencoder's initial training.
    """
    return Given(known_world(folder), replace(Initial(), steps=steps), folder)

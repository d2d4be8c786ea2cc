"""A map is examined: it moves a robot to postures that nothing was learned from.

The robot has no camera: the marker's exact pose stands in for it, seen through the eyes of the
agent that learned. So many maps can be examined in little time, all from the same start.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Protocol

import numpy as np

from experiments.robots.world import World
from jmm_agent.mapping.length_map import LengthMap
from jmm_agent.types import Floats
from jmm_agent.updaters import VisionUpdater
from kengoro.arm import ACTUAL
from kengoro.visits import ANGLES, Visits, no_visits
from kengoro_env.departures import actual, drawing
from kengoro_env.robot.motors import Gains
from kengoro_env.robot.robot import Robot


class PostureMap(LengthMap, Protocol):
    """Lengths from joint angles: what moves an arm and tells where it is."""

    def lengths(self, q: Floats) -> Floats:
        """Muscle lengths [m]: (n,) -> (m,), or (B, n) -> (B, m)."""


class Examiner:
    """A robot without camera that maps are tried on.

    Args:
        world: what is known without moving a robot.
        condition: `ACTUAL` or `NOMINAL`.
        seed: of the robot and of its sensors' noise.
        move: time for a movement [s].
        hold: time to come to rest [s].
    """

    def __init__(self, world: World, condition: str, seed: int, move: float, hold: float) -> None:
        departures = actual(seed) if condition == ACTUAL else drawing()
        self._world, self._seed = world, seed
        self._robot = Robot(world.scene, departures, Gains())
        moving, holding = (round(t / self._robot.control_period) for t in (move, hold))
        share = np.minimum(1.0, np.arange(1, moving + holding + 1) / moving)
        self._trajectory = (share * share * (3.0 - 2.0 * share))[:, None]

    def examine(self, jmm: PostureMap, postures: Floats, detector: VisionUpdater) -> Visits:
        """Move from the first posture to all others in turn, with nothing learned on the way.

        What is estimated is what explains the lengths at rest best, as the filter does there.

        Args:
            jmm: the map that commands and estimates.
            postures: joint angles (1 + K, n) [rad].
            eyes: tell the joint angles that are seen.
        """
        robot, world, visits = self._robot, self._world, no_visits()
        robot.reset(postures[0], np.random.default_rng([self._seed, 4]))
        for here, target in pairwise(postures):
            tension = 0.0
            for command in jmm.lengths(here + self._trajectory * (target - here)):
                robot.step(command)
                tension = max(tension, float(robot.tensions.max()))
            true, lengths = robot.joint_angles, robot.measured_lengths()
            estimate = world.estimate(jmm, lengths, target)
            tensions = robot.measured_tensions()
            seen = detector.seen(
                world.marker(true), estimate, lengths, robot.target, tensions, learn=False
            ).angles
            for key, angles in zip(ANGLES, (target, true, estimate, seen), strict=True):
                visits[key].append(np.round(angles, 6).tolist())
            visits["max_tension"].append(round(tension, 1))
            visits["time"].append(round(robot.time, 2))
        return visits

    def own_lengths(self, postures: Floats) -> Floats:
        """What the encoders would read (K, m) [m] at postures (K, n) [rad], all wires at T_bias."""
        rng = np.random.default_rng([self._seed, 5])
        lengths = []
        for posture in postures:
            self._robot.reset(posture, rng)
            lengths.append(self._robot.target)
        return np.array(lengths)


def map_error_mm(jmm: PostureMap, postures: Floats, lengths: Floats) -> float:
    """Median over postures (K, n) [rad] of the RMS over wires of a map's error [mm].

    Args:
        jmm: the map.
        postures: (K, n) [rad].
        lengths: the robot's own there (K, m) [m].
    """
    error = 1e3 * (jmm.lengths(postures) - lengths)
    return float(np.median(np.sqrt(np.mean(error**2, axis=1))))

"""Robots whose lengths are zeroed anew, and the error of a map against such a robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from experiments.robots import evaluation
from experiments.robots.world import World
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.types import Floats
from kengoro_env.departures import actual
from kengoro_env.robot.draft import Departure, Draft
from kengoro_env.robot.robot import Robot

CHANGE = 0.0035
"""Root mean square change of the lengths by a zeroing [m]."""
ONE = 0.010
"""Elongation of a single muscle while the robot is off [m]."""
TRIED = 0.02
"""Standard deviation of the joint angles at which the change of the lengths is evaluated [rad]."""


@dataclass(frozen=True)
class Shift:
    """Departure: lengths of all muscles, or of one, count from other zeros.

    Attributes:
        deviation: standard deviation of each length's shift [m].
        one: elongation of one random muscle [m].
        seed: of the samples.
    """

    deviation: float = 0.0
    one: float = 0.0
    seed: int = 0

    def edit(self, draft: Draft) -> None:
        """Add to the offsets of the encoders."""
        rng, offsets = np.random.default_rng([self.seed, 351]), draft.sensor_errors.length_offset
        shifts = self.deviation * rng.standard_normal(len(draft.tendons))
        shifts[rng.integers(len(shifts))] += self.one
        for muscle, shift in zip(draft.tendons, shifts, strict=True):
            offsets[muscle] = offsets.get(muscle, 0.0) + float(shift)


@dataclass(frozen=True)
class Turn:
    """Departure: lengths were zeroed at a posture that differs by random angles.

    Attributes:
        deviation: standard deviation of each joint's angle [rad].
        seed: of the samples.
    """

    deviation: float
    seed: int

    def edit(self, draft: Draft) -> None:
        """Turn the joints of the zero posture."""
        rng, zero = np.random.default_rng([self.seed, 352]), draft.sensor_errors.zero_posture
        for joint in list(zero):
            zero[joint] += self.deviation * float(rng.standard_normal())


def departures(cycle: str, seed: int, world: World) -> tuple[Departure, ...]:
    """Departures of an actual robot after a power cycle.

    Args:
        cycle: "muscles": each length by a random shift; "posture": all at another posture, that
            changes the lengths by as much; "one": one muscle was elongated; "none": as before.
        seed: of the robot.
        world: nominal model of the arm.
    """
    robot = actual(seed)
    if cycle == "muscles":
        return (*robot, Shift(deviation=CHANGE, seed=seed))
    if cycle == "one":
        return (*robot, Shift(one=ONE, seed=seed))
    if cycle == "posture":
        tried = (*robot, Turn(TRIED, seed))
        change = own_lengths(tried, seed, world.postures[:5], world)
        change -= own_lengths(robot, seed, world.postures[:5], world)
        share = CHANGE / float(np.sqrt(np.mean(change**2)))
        return (*robot, Turn(TRIED * share, seed))
    return robot


def own_lengths(robot: tuple[Departure, ...], seed: int, postures: Floats, world: World) -> Floats:
    """Encoder readings (K, m) [m] of a robot with muscles at T_bias, at postures (K, n) [rad]."""
    rng = np.random.default_rng([seed, 8])
    return evaluation.own_lengths(Robot(world.scene, robot), postures, rng)


class EstimateError:
    """Error of the joint angles that a map estimates from a robot's own lengths.

    Args:
        robot: departures of the robot.
        seed: of the robot.
        postures: joint angles (K, n) [rad].
        world: nominal model of the arm.
    """

    def __init__(
        self, robot: tuple[Departure, ...], seed: int, postures: Floats, world: World
    ) -> None:
        self._postures, self._world = postures, world
        self._lengths = own_lengths(robot, seed, postures, world)

    def deg(self, jmm: JointMuscleMap) -> float:
        """Median over postures of the RMS over joints of the error [deg]."""
        pairs = zip(self._lengths, self._postures, strict=True)
        missed = [self._world.estimate(jmm, lengths, q) - q for lengths, q in pairs]
        return float(np.median(np.degrees(np.sqrt(np.mean(np.square(missed), axis=1)))))

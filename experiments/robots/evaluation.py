"""Evaluation of maps: each moves the same robot to postures that were not learned from.

The robot has no camera. The exact pose of the marker replaces the detected one, and the Vision
Updater of the agent that learned computes joint angles from it. So an evaluation takes little time,
and all maps start from the same posture.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Protocol, runtime_checkable

import numpy as np
from scipy.interpolate import make_interp_spline

from experiments.robots.conditions import ACTUAL
from experiments.robots.world import World
from jmm_agent.feed_forward import BETWEEN
from jmm_agent.guard.faults import MotorControl
from jmm_agent.mapping.length_map import LengthMap
from jmm_agent.tension_distribution import TensionOptions, distribute
from jmm_agent.types import Floats
from jmm_agent.updaters import VisionUpdater
from kengoro.visits import ANGLES, Visits, no_visits
from kengoro_env.departures import actual, drawing
from kengoro_env.robot.muscle_law import Gains
from kengoro_env.robot.robot import Robot

PULLS = 2
"""Times that tensions are computed by a map whose moment arms depend on them."""


class PostureMap(LengthMap, Protocol):
    """Map from joint angles to muscle lengths that can command and estimate an arm."""

    def lengths(self, q: Floats) -> Floats:
        """Muscle lengths [m]: (n,) -> (m,), or (B, n) -> (B, m)."""


@runtime_checkable
class TensionMap(Protocol):
    """Map from joint angles and tensions to muscle lengths."""

    def lengths(self, q: Floats, tensions: Floats) -> Floats:
        """Muscle lengths (B, m) [m] at angles (B, n) [rad] and tensions (B, m) [N]."""

    def at(self, tensions: Floats) -> PostureMap:
        """The map from joint angles to lengths at tensions (m,) [N]."""


class Evaluator:
    """A robot without camera on which maps are evaluated.

    Args:
        world: nominal model and postures.
        condition: `ACTUAL` or `NOMINAL`.
        seed: of the robot and of its sensors' noise.
        move: duration of a movement [s].
        hold: time to come to rest [s].
        feed_forward: whether commands pull with the tensions that the maps balance, as those of
            agents with `AgentOptions.feed_forward` do; if not, commands are the maps' lengths.
    """

    def __init__(
        self,
        world: World,
        condition: str,
        seed: int,
        move: float,
        hold: float,
        feed_forward: bool = False,
    ) -> None:
        gains, self._feed_forward = Gains(), feed_forward
        self._motors = MotorControl(gains.stiffness, gains.bias, gains.limit)
        departures = actual(seed) if condition == ACTUAL else drawing()
        self._world, self._seed = world, seed
        self._robot = Robot(world.scene, departures, gains)
        moving, holding = (round(t / self._robot.control_period) for t in (move, hold))
        share = np.minimum(1.0, np.arange(1, moving + holding + 1) / moving)
        self._trajectory = (share * share * (3.0 - 2.0 * share))[:, None]

    def evaluate(
        self, jmm: PostureMap | TensionMap, postures: Floats, vision: VisionUpdater
    ) -> Visits:
        """Move from the first posture to all others in turn, without learning.

        The estimate is the least-squares solution for the lengths at rest, to which the Kalman
        filter converges.

        Args:
            jmm: map that commands and estimates.
            postures: joint angles, shape (1 + K, n) [rad].
            vision: computes joint angles from the pose of the marker.

        Returns:
            K visits.
        """
        robot, world, visits = self._robot, self._world, no_visits()
        for target, tension in self._moves(jmm, postures):
            true, lengths = robot.joint_angles, robot.measured_lengths()
            tensions = robot.measured_tensions()
            own = jmm.at(tensions) if isinstance(jmm, TensionMap) else jmm
            estimate = world.estimate(own, lengths, target)
            seen = vision.seen(
                world.marker(true), estimate, lengths, robot.target, tensions, learn=False
            ).angles
            for key, angles in zip(ANGLES, (target, true, estimate, seen), strict=True):
                visits[key].append(np.round(angles, 6).tolist())
            visits["max_tension"].append(round(tension, 1))
            visits["time"].append(round(robot.time, 2))
        return visits

    def rests(
        self, jmm: PostureMap | TensionMap, postures: Floats
    ) -> Iterator[tuple[Floats, Floats, Floats]]:
        """Move as in `evaluate`; true angles (n,) [rad], lengths (m,) [m], tensions (m,) [N].

        Args:
            jmm: map that commands.
            postures: joint angles, shape (1 + K, n) [rad].
        """
        robot = self._robot
        for _ in self._moves(jmm, postures):
            yield robot.joint_angles, robot.measured_lengths(), robot.measured_tensions()

    def _moves(
        self, jmm: PostureMap | TensionMap, postures: Floats
    ) -> Iterator[tuple[Floats, float]]:
        """Move to all postures but the first; targets, and largest tensions [N], once at rest."""
        robot = self._robot
        robot.reset(postures[0], np.random.default_rng([self._seed, 4]))
        for here, target in pairwise(postures):
            tension = 0.0
            for command in self._commands(jmm, here, target):
                robot.step(command)
                tension = max(tension, float(robot.tensions.max()))
            yield target, tension

    def _commands(self, jmm: PostureMap | TensionMap, here: Floats, target: Floats) -> Floats:
        """Commands of a movement from one posture (n,) [rad] to another one (steps, m) [m]."""
        path = here + self._trajectory * (target - here)
        low = TensionOptions().low(self._motors, len(self._robot.tensions))
        pull = np.full((len(path), len(low)), self._motors.bias)
        if self._feed_forward:
            shares = np.linspace(0.0, 1.0, BETWEEN + 1)
            pulls = [self._pull(jmm, q, low) for q in here + shares[:, None] * (target - here)]
            pull = make_interp_spline(shares, np.array(pulls), k=1)(self._trajectory[:, 0])
        lengths = jmm.lengths(path, pull) if isinstance(jmm, TensionMap) else jmm.lengths(path)
        return np.asarray(lengths - (pull - self._motors.bias) / self._motors.stiffness)

    def _pull(self, jmm: PostureMap | TensionMap, q: Floats, low: Floats) -> Floats:
        """Tensions (m,) [N] that hold a posture (n,) [rad] by a map, at least the lowest (m,)."""
        load, pull = self._world.arm.gravity(q), low
        for _ in range(PULLS if isinstance(jmm, TensionMap) else 1):
            own = jmm.at(pull) if isinstance(jmm, TensionMap) else jmm
            arms = own.lengths_and_jacobian(q)[1]
            pull = distribute(arms, load, low, self._motors.limit).tensions
        return pull

    def own_lengths(self, postures: Floats) -> Floats:
        """Encoder readings of the robot with all muscles at T_bias.

        Args:
            postures: joint angles, shape (K, n) [rad].

        Returns:
            Lengths, shape (K, m) [m].
        """
        return own_lengths(self._robot, postures, np.random.default_rng([self._seed, 5]))


def own_lengths(robot: Robot, postures: Floats, rng: np.random.Generator) -> Floats:
    """Encoder readings of a robot with all muscles at T_bias.

    Args:
        robot: is reset to each posture.
        postures: joint angles, shape (K, n) [rad].
        rng: of the sensors' noise.

    Returns:
        Lengths, shape (K, m) [m].
    """
    lengths = []
    for posture in postures:
        robot.reset(posture, rng)
        lengths.append(robot.target)
    return np.array(lengths)


def map_error_mm(jmm: PostureMap, postures: Floats, lengths: Floats) -> float:
    """Median over postures of the RMS over muscles of a map's error [mm].

    Args:
        jmm: the map.
        postures: joint angles, shape (K, n) [rad].
        lengths: of the robot at the postures, shape (K, m) [m].
    """
    error = 1e3 * (jmm.lengths(postures) - lengths)
    return float(np.median(np.sqrt(np.mean(error**2, axis=1))))

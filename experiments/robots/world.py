"""Nominal world of the arm, and a robot that a map moves from posture to posture at rest."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.kinematics.bounded_least_squares import minimise
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.length_map import LengthMap
from jmm_agent.mapping.prior import MapPrior, PriorOptions
from jmm_agent.types import Floats
from jmm_agent.vision.marker_residual import MarkerResidual
from kengoro.trained_maps import ARM, model_of, points_of, trained_map
from kengoro_env.assets import asset_path
from kengoro_env.names import GROUP_JOINTS
from kengoro_env.postures import posture_set
from kengoro_env.robot.draft import Departure
from kengoro_env.robot.muscle_law import Gains
from kengoro_env.robot.nominal_model import NominalArm
from kengoro_env.robot.robot import Robot

EYE, MARKER, GRIP = "eye", "marker_hand", "grip"
ESTIMATE_MARGIN = 0.1
"""By how much an estimate may exceed the joint limits [rad]."""
WEAK_PULL = 1e-8
"""Weight of the start of the estimate, for joints that no length determines [m^2/rad^2]."""


@dataclass(frozen=True)
class Sizes:
    """Amount of work on each robot.

    Attributes:
        learned: number of postures that the agent learns from.
        tested: number of other postures on which the map is tested.
        move: duration of a movement [s].
        hold: time to come to rest [s].
        corrections: number of corrections of each command for the lower bound of the error.
    """

    learned: int = 27
    tested: int = 12
    move: float = 2.0
    hold: float = 1.5
    corrections: int = 8


class Rest(NamedTuple):
    """A robot at rest.

    Attributes:
        target, true, estimate: joint angles, shape (n,) [rad].
        lengths, command: measured and commanded muscle lengths, shape (m,) [m].
        tensions: measured, shape (m,) [N].
    """

    target: Floats
    true: Floats
    estimate: Floats
    lengths: Floats
    command: Floats
    tensions: Floats


class World:
    """Nominal model of the arm: its trained map with prior, kinematics, limits and postures.

    Args:
        cache: folder of trained maps.
    """

    def __init__(self, cache: Path | None) -> None:
        self.cache = cache
        self.scene = asset_path(ARM)
        self.arm = NominalArm(self.scene)
        self.limits = np.column_stack([self.arm.lower, self.arm.upper])
        self.map = trained_map(cache)
        self.kinematics = ArmKinematics(self.scene, self.arm.joints)
        self.marker_residual = MarkerResidual(self.kinematics, EYE, MARKER)
        self.postures = posture_set()
        points = points_of(self.map, model_of(self.arm), cache)
        self.prior = MapPrior(self.map, self.postures, PriorOptions(), points)

    def marker(self, q: Floats) -> Floats:
        """Exact pose_marker_in_camera, shape (4, 4), at true joint angles, shape (n,) [rad]."""
        return self.kinematics.pose(MARKER, q, relative_to=EYE)

    def hand(self, q: Floats) -> Floats:
        """Grip point in the world, shape (3,) [m], at joint angles, shape (n,) [rad]."""
        return self.kinematics.pose(GRIP, q)[:3, 3]

    def owned(self) -> dict[str, NDArray[np.intp]]:
        """Indices of the joints of each group."""
        index = self.arm.joints.index
        return {name: np.array([index(j) for j in own]) for name, own in GROUP_JOINTS.items()}

    def split(self, seed: int, sizes: Sizes) -> tuple[Floats, Floats]:
        """Postures to learn from and postures to test on, each after one to start at.

        Returns:
            Joint angles, shapes (1 + learned, n) and (1 + tested, n) [rad].
        """
        order = np.random.default_rng([seed, 1]).permutation(len(self.postures))
        learn, test = order[: 1 + sizes.learned], order[-1 - sizes.tested :]
        return self.postures[learn], self.postures[test]

    def estimate(self, jmm: LengthMap, lengths: Floats, start: Floats) -> Floats:
        """Least-squares joint angles for muscle lengths, the limit of the Kalman filter at rest.

        Args:
            jmm: the map.
            lengths: shape (m,) [m].
            start: initial joint angles, shape (n,) [rad].

        Returns:
            Joint angles, shape (n,) [rad].
        """

        def residual(q: Floats) -> tuple[Floats, Floats]:
            expected, jacobian = jmm.lengths_and_jacobian(q)
            return expected - lengths, jacobian

        low, high = self.limits[:, 0] - ESTIMATE_MARGIN, self.limits[:, 1] + ESTIMATE_MARGIN
        pull = WEAK_PULL * np.eye(len(start))
        return minimise(residual, start, low, high, pull, 60).x


@cache
def known_world(maps: Path | None) -> World:
    """World of this process, with its map in the folder ``maps``."""
    return World(maps)


class Body:
    """A robot that maps move to postures.

    Args:
        world: nominal model of the arm.
        departures: of the robot from it.
        sizes: durations of movement and rest.
    """

    def __init__(self, world: World, departures: tuple[Departure, ...], sizes: Sizes) -> None:
        self.world, self.sizes = world, sizes
        self.robot = Robot(world.scene, departures, Gains())
        self._steps = [round(t / self.robot.control_period) for t in (sizes.move, sizes.hold)]
        self._at = np.zeros(len(self.robot.joints))

    def reset(self, posture: Floats, rng: np.random.Generator) -> None:
        """Put the arm at a posture, shape (n,) [rad]."""
        self.robot.reset(posture, rng)
        self._at = posture

    def go(self, target: Floats, jmm: JointMuscleMap) -> Rest:
        """Move to a target posture, shape (n,) [rad], by a map and come to rest."""
        moving, holding = self._steps
        for step in range(moving + holding):
            share = min(1.0, (step + 1) / moving)
            share *= share * (3.0 - 2.0 * share)
            self.robot.step(jmm.lengths(self._at + share * (target - self._at)))
        self._at = target
        return self._rest(target, jmm)

    def shift(self, target: Floats, command: Floats) -> Floats:
        """Move to given muscle lengths and come to rest.

        Args:
            target: joint angles that the command is meant for, shape (n,) [rad].
            command: muscle lengths, shape (m,) [m].

        Returns:
            True joint angles, shape (n,) [rad].
        """
        start, (_, holding) = self.robot.target, self._steps
        for step in range(2 * holding):
            share = min(1.0, (step + 1) / holding)
            self.robot.step(start + share * (command - start))
        self._at = target
        return self.robot.joint_angles

    def _rest(self, target: Floats, jmm: JointMuscleMap) -> Rest:
        lengths = self.robot.measured_lengths()
        return Rest(
            target,
            self.robot.joint_angles,
            self.world.estimate(jmm, lengths, target),
            lengths,
            jmm.lengths(target),
            self.robot.measured_tensions(),
        )

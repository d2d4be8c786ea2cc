"""The robots of the learnability study, and what is known without moving them."""

from __future__ import annotations

from dataclasses import dataclass
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
from kengoro.trained_maps import ARM, trained_map
from kengoro_env.assets import asset_path
from kengoro_env.names import GROUP_JOINTS
from kengoro_env.postures import posture_set
from kengoro_env.robot.draft import Departure
from kengoro_env.robot.motors import Gains
from kengoro_env.robot.nominal_model import NominalArm
from kengoro_env.robot.robot import Robot

EYE, MARKER, GRIP = "eye", "marker_hand", "grip"
ESTIMATE_MARGIN = 0.1  # [rad] by which an estimate may lie outside the joint limits
WEAK_PULL = 1e-8  # [m^2/rad^2] towards the start, for joints that no wire sees


@dataclass(frozen=True)
class Sizes:
    """How much is done.

    Attributes:
        learned: postures from which is learned.
        tested: other postures, on which the map is tested.
        move: time for a movement [s].
        hold: time to come to rest [s].
        corrections: how often a command is corrected for the floor.
    """

    learned: int = 27
    tested: int = 12
    move: float = 2.0
    hold: float = 1.5
    corrections: int = 8


class Rest(NamedTuple):
    """A robot at rest: angles (n,) [rad], lengths and command (m,) [m], tensions (m,) [N]."""

    target: Floats
    true: Floats
    estimate: Floats
    lengths: Floats
    command: Floats
    tensions: Floats


class World:
    """What is known without moving a robot: its drawn map, its kinematics, and postures."""

    def __init__(self, cache: Path | None) -> None:
        self.cache = cache
        self.scene = asset_path(ARM)
        self.arm = NominalArm(self.scene)
        self.limits = np.column_stack([self.arm.lower, self.arm.upper])
        self.map = trained_map(cache)
        self.kinematics = ArmKinematics(self.scene, self.arm.joints)
        self.sight = MarkerResidual(self.kinematics, EYE, MARKER)
        self.postures = posture_set()
        self.prior = MapPrior(self.map, self.postures, PriorOptions())

    def marker(self, q: Floats) -> Floats:
        """Exact pose_marker_in_camera (4, 4) at true angles (n,) [rad]."""
        return self.kinematics.pose(MARKER, q, relative_to=EYE)

    def hand(self, q: Floats) -> Floats:
        """Grip point (3,) [m] in the world at angles (n,) [rad]."""
        return self.kinematics.pose(GRIP, q)[:3, 3]

    def owned(self) -> dict[str, NDArray[np.intp]]:
        """Indices of the joints that each group owns."""
        index = self.arm.joints.index
        return {name: np.array([index(j) for j in own]) for name, own in GROUP_JOINTS.items()}

    def split(self, seed: int, sizes: Sizes) -> tuple[Floats, Floats]:
        """Postures to learn from, and others to test on, after one to start from each."""
        order = np.random.default_rng([seed, 1]).permutation(len(self.postures))
        learn, test = order[: 1 + sizes.learned], order[-1 - sizes.tested :]
        return self.postures[learn], self.postures[test]

    def estimate(self, jmm: LengthMap, lengths: Floats, start: Floats) -> Floats:
        """Angles (n,) [rad] that explain the lengths best: the filter's estimate at rest."""

        def residual(q: Floats) -> tuple[Floats, Floats]:
            expected, jacobian = jmm.lengths_and_jacobian(q)
            return expected - lengths, jacobian

        low, high = self.limits[:, 0] - ESTIMATE_MARGIN, self.limits[:, 1] + ESTIMATE_MARGIN
        pull = WEAK_PULL * np.eye(len(start))
        return minimise(residual, start, low, high, pull, 60).x


class Body:
    """A robot that moves to postures by a map."""

    def __init__(self, world: World, departures: tuple[Departure, ...], sizes: Sizes) -> None:
        self.world, self.sizes = world, sizes
        self.robot = Robot(world.scene, departures, Gains())
        self._steps = [round(t / self.robot.control_period) for t in (sizes.move, sizes.hold)]
        self._at = np.zeros(len(self.robot.joints))

    def reset(self, posture: Floats, rng: np.random.Generator) -> None:
        """Put the arm at a posture (n,) [rad]."""
        self.robot.reset(posture, rng)
        self._at = posture

    def go(self, target: Floats, jmm: JointMuscleMap) -> Rest:
        """Move to a target posture (n,) [rad] by a map, and come to rest."""
        moving, holding = self._steps
        for step in range(moving + holding):
            share = min(1.0, (step + 1) / moving)
            share *= share * (3.0 - 2.0 * share)
            self.robot.step(jmm.lengths(self._at + share * (target - self._at)))
        self._at = target
        return self._rest(target, jmm)

    def shift(self, target: Floats, command: Floats) -> Floats:
        """Move on to a command (m,) [m] and rest there; true angles (n,) [rad]."""
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

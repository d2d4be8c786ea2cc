"""The eight families of strange robots: each edits model, lens or sensors of a robot.

``base`` is the preset without zero posture, displaced points and bones.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import radians
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np

from experiments.strange_robots.wrappers import (
    AbsentMuscle,
    DriftingLengths,
    Env,
    SwappedMotors,
    simulated,
)
from kengoro.robots import NO_END
from kengoro_env.departures import (
    AttachmentDisplacement,
    BoneWrapping,
    EncoderError,
    LensDistortion,
    TendonStretch,
    ZeroPosture,
    actual,
)
from kengoro_env.robot.draft import Departure, Draft
from kengoro_env.robot.tendons import actuated_joints

PRESET, POINTS, BONES, SOFT, LENS = "preset", "points", "bones", "soft", "lens"
SWAPPED, ABSENT, DRIFT, NOISE = "swapped", "absent", "drift", "noise"


def base(seed: int) -> tuple[Departure, ...]:
    """The preset's departures but zero posture, displaced points and bones."""
    left_out = ZeroPosture, AttachmentDisplacement, BoneWrapping
    return tuple(one for one in actual(seed) if not isinstance(one, left_out))


@dataclass(frozen=True)
class Family:
    """A robot of the preset; the others differ from it.

    Attributes:
        title: in tables.
    """

    title: str = "the preset"

    def departures(self, seed: int) -> tuple[Departure, ...]:
        """Departures of the robot of a seed."""
        return actual(seed)

    def wrapped(self, env: Env, seed: int, elapsed: float, stays: bool) -> Env:
        """Environment of the robot.

        Args:
            env: of the robot with its departures.
            seed: of the robot.
            elapsed: time for which it has run before [s].
            stays: whether it changes no more.
        """
        return env

    def odd(self, seed: int, muscles: tuple[str, ...]) -> tuple[str, ...]:
        """Muscles that an agent should name."""
        return ()


@dataclass(frozen=True)
class DisplacedPoints(Family):
    """Every point of a wire is displaced along each axis, not clipped.

    Attributes:
        sigma: standard deviation [m].
    """

    title: str = "points displaced by 10 mm an axis, perfect zero"
    sigma: float = 0.010

    def departures(self, seed: int) -> tuple[Departure, ...]:
        """`base` and the displacement."""
        return (*base(seed), _Points(self.sigma, seed))


@dataclass(frozen=True)
class _Points:
    sigma: float
    seed: int

    def edit(self, draft: Draft) -> None:
        """Move every site of every tendon."""
        rng = np.random.default_rng([self.seed, 9001])
        for tendon in draft.spec.tendons:
            for element in tendon.path:
                if element.type == mujoco.mjtWrap.mjWRAP_SITE:
                    shift = self.sigma * rng.standard_normal(3)
                    element.target.pos = element.target.pos + shift


@dataclass(frozen=True)
class OtherBones(Family):
    """Bones are longer or shorter, and the axes of joints are turned.

    Attributes:
        distance: by which the body of each joint is moved in its parent, in a random direction [m];
            a body with several joints is moved for each.
        angle: by which each axis is turned, in a random direction [rad].
    """

    title: str = "bones 5 mm a joint and axes 3 deg off, perfect zero"
    distance: float = 0.005
    angle: float = radians(3.0)

    def departures(self, seed: int) -> tuple[Departure, ...]:
        """`base`, bones and axes."""
        return (*base(seed), _Bones(self.distance, self.angle, seed))


@dataclass(frozen=True)
class _Bones:
    distance: float
    angle: float
    seed: int

    def edit(self, draft: Draft) -> None:
        """Move the body of each joint that wires cross, and turn the joint's axis."""
        rng, crossed = np.random.default_rng([self.seed, 9003]), _crossed(draft)
        for joint in [joint for joint in draft.spec.joints if joint.name in crossed]:
            direction = rng.standard_normal(3)
            if np.any(joint.parent.pos):
                step = self.distance * direction / np.linalg.norm(direction)
                joint.parent.pos = joint.parent.pos + step
            axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
            across = np.cross(axis, rng.standard_normal(3))
            across /= np.linalg.norm(across)
            joint.axis = np.cos(self.angle) * axis + np.sin(self.angle) * across


def _crossed(draft: Draft) -> tuple[str, ...]:
    """Names of the joints that wires cross, in the drawing."""
    return actuated_joints(draft.spec.copy().compile())


@dataclass(frozen=True)
class SoftTendons(Family):
    """Wires stretch five times as far as the preset's.

    Attributes:
        compliance: stretch per tension at small tensions [m/N].
        hardening: coefficient of the quadratic term [N/m^2].
    """

    title: str = "wires five times softer"
    compliance: float = 5e-5
    hardening: float = 1.6e5

    def departures(self, seed: int) -> tuple[Departure, ...]:
        """The preset with another stretch."""
        return _replaced(actual(seed), TendonStretch(self.compliance, self.hardening))


@dataclass(frozen=True)
class BarrelLens(Family):
    """Frames are distorted, and the agent knows an ideal lens.

    Attributes:
        k1: radial coefficient [1].
    """

    title: str = "lens distortion k1 = -0.2"
    k1: float = -0.2

    def departures(self, seed: int) -> tuple[Departure, ...]:
        """The preset and the lens."""
        return (*actual(seed), LensDistortion(k1=self.k1))


@dataclass(frozen=True)
class Swapped(Family):
    """Two motors, and their sensors, are connected to each other's channels."""

    title: str = "two motors swapped"

    def _first(self, seed: int, muscles: int) -> int:
        return int(np.random.default_rng([seed, 9008]).integers(0, muscles - 1))

    def wrapped(self, env: Env, seed: int, elapsed: float, stays: bool) -> Env:
        """Exchange lengths, tensions and commands."""
        return SwappedMotors(env, self._first(seed, len(simulated(env).muscles)))

    def odd(self, seed: int, muscles: tuple[str, ...]) -> tuple[str, ...]:
        """Both muscles."""
        first = self._first(seed, len(muscles))
        return muscles[first : first + 2]


@dataclass(frozen=True)
class Absent(Family):
    """A wire was never mounted, and its motor turns without a load."""

    title: str = "a wire absent from the start"

    def wrapped(self, env: Env, seed: int, elapsed: float, stays: bool) -> Env:
        """Take the wire away after each reset."""
        return AbsentMuscle(env, self.odd(seed, simulated(env).muscles)[0])

    def odd(self, seed: int, muscles: tuple[str, ...]) -> tuple[str, ...]:
        """The muscle without its wire."""
        return (muscles[int(np.random.default_rng([seed, 9018]).integers(len(muscles)))],)


@dataclass(frozen=True)
class Drift(Family):
    """Every wire becomes longer, or shorter, all the time.

    Attributes:
        rate: of each length [m/min].
    """

    title: str = "all lengths drift by 1 mm a minute"
    rate: float = 0.001

    def wrapped(self, env: Env, seed: int, elapsed: float, stays: bool) -> Env:
        """Let the lengths drift."""
        signs = np.random.default_rng([seed, 9009]).choice([-1.0, 1.0], len(simulated(env).muscles))
        return DriftingLengths(env, self.rate * signs, elapsed, stays)


@dataclass(frozen=True)
class NoisyEncoders(Family):
    """Encoders have three times the preset's noise.

    Attributes:
        noise: standard deviation of each reading [m].
    """

    title: str = "encoder noise three times the preset's"
    noise: float = 0.0003

    def departures(self, seed: int) -> tuple[Departure, ...]:
        """The preset with other encoders."""
        robot = actual(seed)
        usual = next(one for one in robot if isinstance(one, EncoderError))
        return _replaced(robot, replace(usual, noise=self.noise))


FAMILIES: dict[str, Family] = {
    PRESET: Family(),
    POINTS: DisplacedPoints(),
    BONES: OtherBones(),
    SOFT: SoftTendons(),
    LENS: BarrelLens(),
    SWAPPED: Swapped(),
    ABSENT: Absent(),
    DRIFT: Drift(),
    NOISE: NoisyEncoders(),
}
"""The preset, which others are compared with, and the eight families."""


def make_robot(
    family: str, seed: int, camera: bool = True, elapsed: float = 0.0, stays: bool = False
) -> Env:
    """Environment of a robot, without an end.

    Args:
        family: one of `FAMILIES`.
        seed: of the robot.
        camera: whether it has a camera.
        elapsed: time for which it has run before [s].
        stays: whether it changes no more.
    """
    kind = FAMILIES[family]
    options: dict[str, Any] = {"camera": camera, "max_episode_steps": NO_END}
    env: Any = gym.make("Kengoro/Posture-v0", departures=kind.departures(seed), **options)
    return kind.wrapped(env, seed, elapsed, stays)


def _replaced(robot: tuple[Departure, ...], other: Departure) -> tuple[Departure, ...]:
    """Departures with one in place of that of its kind."""
    return tuple(other if isinstance(one, type(other)) else one for one in robot)

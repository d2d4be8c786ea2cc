"""A small robot that a Vision Updater learns, of any size, number of joints and muscles.

It was zeroed at another posture, its lengths may drift, and some of its joints are not seen.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from jmm_agent.mapping.group_map import GroupMap
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import BatchOptions, Learner, RidgeRule
from jmm_agent.mapping.prior import MapPrior, PriorOptions
from jmm_agent.types import Floats, Ints
from jmm_agent.updaters import VisionOptions, VisionUpdater
from jmm_agent.vision.marker_observation import Frames, PoseResidual

ZEROING = PriorOptions()


def map_of(
    joints: int, muscles: int, size: float, seed: int = 0, twins: bool = False
) -> JointMuscleMap:
    """A map of one group; lengths of some ``size`` times 20 mm; the first two may be twins."""
    rng = np.random.default_rng([seed, 11])
    weights = 12.0 * size * rng.normal(size=(muscles, 16))
    if twins:
        weights[1] = weights[0]
    names = tuple(f"j{i}" for i in range(joints)), tuple(f"m{i}" for i in range(muscles))
    group = GroupMap(
        "all",
        np.arange(joints),
        np.arange(muscles),
        np.zeros(joints),
        np.ones(joints),
        0.6 * rng.normal(size=(16, joints)),
        rng.normal(size=16),
        weights,
        np.zeros(muscles),
    )
    start = JointMuscleMap(*names, (group,))
    shift = 1e3 * start.lengths(np.zeros(joints))
    return start.with_output_layers({"all": (group.W2, -shift)})


def marker_residual(
    q: Floats, pose: Floats, frames: Frames | None = None, /
) -> tuple[Floats, Floats]:
    """Residual of the first four joints, all that the camera shows, and its Jacobian."""
    error = np.array([*(q[:3] - pose[:3, 3]), q[3] - pose[3, 0], 0.0, 0.0])
    return error, np.eye(6, len(q)) * (np.arange(len(q)) < 4)


class SmallRobot:
    """A Vision Updater, and a robot that it learns from.

    Args:
        joints: number of joints; the camera shows the first four.
        muscles: number of muscles.
        size: of the robot, over that of Kengoro's arm.
        seed: of its zero posture and shape, and of what is measured.
        order: muscle at each channel.
        twins: whether the first two muscles have the same path.
        residual: of a pose at a posture.
        more: options of the Vision Updater.

    Attributes:
        speeds: at which the lengths drift (m,) [m/s].
        pace: time between two observations [s].
    """

    def __init__(
        self,
        joints: int = 5,
        muscles: int = 14,
        size: float = 1.0,
        seed: int = 0,
        order: Ints | None = None,
        twins: bool = False,
        residual: PoseResidual = marker_residual,
        **more: Any,
    ) -> None:
        self.rng, self.size = np.random.default_rng([seed, 12]), size
        self.map = map_of(joints, muscles, size, twins=twins)
        self.limits = np.column_stack([-np.ones(joints), np.ones(joints)])
        scaled = {
            name: size * getattr(ZEROING, name)
            for name in ("offset", "shape", "noise", "elongation", "zeroing")
        }
        zeroed = {name: size * getattr(ZEROING, name) for name in ("zeroed_offset", "zeroed_shape")}
        prior = MapPrior(self.map, self.postures(50), replace(ZEROING, **scaled, **zeroed))
        rng = np.random.default_rng(seed)
        learner = Learner(self.map, self.limits, RidgeRule(prior), BatchOptions(), rng)
        options = VisionOptions(lengths="l", noise=0.001 * size, **more)
        self.vision = VisionUpdater(learner, prior, residual, self.limits, options)
        self.learner = learner
        self.order = np.arange(muscles) if order is None else order
        self.zero = self.rng.normal(0.0, 0.15, joints)
        self.offset = self.rng.normal(0.0, 0.001 * size, muscles)
        self.shape = map_of(joints, muscles, 0.04 * size, 1 + seed)
        self.signs = np.ones(muscles)
        self.absent: int | None = None
        self.speeds, self.time, self.pace = np.zeros(muscles), 0.0, 3.0

    def postures(self, count: int) -> Floats:
        return self.rng.uniform(-0.8, 0.8, (count, len(self.limits)))

    def lengths(self, q: Floats) -> Floats:
        """Lengths (m,) [m] of the muscles, as zeroed."""
        path = self.map.lengths(q) - self.map.lengths(self.zero) + self.shape.lengths(q)
        return np.asarray(path + self.offset + self.speeds * self.time)

    def read(self, q: Floats) -> Floats:
        """Lengths (m,) [m] as the channels read them."""
        lengths = self.signs * self.lengths(q)
        if self.absent is not None:
            lengths[self.absent] = 0.01 * self.size
        noise = self.rng.normal(0.0, 1e-4 * self.size, len(lengths))
        return np.asarray(lengths[self.order] + noise)

    def pose(self, q: Floats) -> Floats:
        """Pose (4, 4) that the camera shows, with noise; its last row has the fourth joint."""
        pose = np.eye(4)
        pose[:3, 3], pose[3, 0] = q[:3], q[3]
        pose[:3, 3] += self.rng.normal(0.0, 0.002, 3)
        return pose

    def observe(self, seen: Floats | None = None) -> bool:
        """Whether an observation at a random posture, perhaps with a pose of another one, rewires.

        Channels are read in the order that is known, as the agent does.
        """
        self.time += self.pace
        q = self.postures(1)[0]
        lengths = self.read(q)[self.vision.assignment.channels(len(self.order))]
        pose = self.pose(q if seen is None else seen)
        guess = q + self.rng.normal(0.0, 0.1, len(q))
        nothing = np.full(len(lengths), np.nan)
        self.vision.seen(pose, guess, lengths, lengths, nothing, time=self.time)
        return self.vision.find_miswiring() or self.vision.find_misplaced()

    def observe_several(self, count: int) -> None:
        for _ in range(count):
            self.observe()

    @property
    def named(self) -> list[tuple[str, tuple[int, ...]]]:
        return [(one.kind, one.muscles) for one in self.vision.assignment.named]

    def error(self) -> Floats:
        """Error of the learned map at other postures, RMS of each muscle (m,) [m]."""
        q = self.postures(40)
        true = np.array([self.lengths(one) for one in q])
        return np.asarray(np.sqrt(np.mean((self.learner.map.lengths(q) - true) ** 2, axis=0)))

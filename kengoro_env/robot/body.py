"""What can be measured of a robot, or of many of one model at once."""

from __future__ import annotations

from abc import ABC, abstractmethod
from types import SimpleNamespace
from typing import Any, NamedTuple

import mujoco
import numpy as np

from kengoro_env.robot.indexing import Index, reader
from kengoro_env.robot.motors import Motors
from kengoro_env.robot.sensors import Sensors
from kengoro_env.types import Floats

INSTANT = 1e-6
"""Simulated times closer than this are the same [s]."""


class Moment(NamedTuple):
    """What is true of a robot at one time; of many with an axis of robots before.

    Attributes:
        joint_angles: (n,) [rad].
        paths: lengths of the wires' paths from guide to end (m,) [m].
        paid_out: what encoders without error would read if nobody had zeroed them (m,) [m].
        lengths: what encoders without offset, noise and quantum would read (m,) [m].
        tensions: (m,) [N].
    """

    joint_angles: Floats
    paths: Floats
    paid_out: Floats
    lengths: Floats
    tensions: Floats


class Body(ABC):
    """What can be measured of a robot: of one, or with a leading axis of many of one model.

    Attributes:
        model: of MuJoCo.
        data: an `MjData`, or the fields of one with an axis of robots before theirs.
        motors: of the wires.
    """

    model: mujoco.MjModel
    data: Any
    motors: Motors
    _target: Floats
    _sensors: Sensors
    _position: Index
    _zero: Floats
    _none: Floats

    def _look(self) -> None:
        """Find the arrays of MuJoCo that are read in each step."""
        data, model = self.data, self.model
        places, turns = data.site_xpos, data.site_xmat
        shape = (*places.shape[:-2], 3, 3)
        self._mujoco = SimpleNamespace(
            angles=reader(data.qpos, self._position),
            sites={
                model.site(i).name: (places[..., i, :], turns[..., i, :].reshape(shape))
                for i in range(model.nsite)
            },
        )

    @property
    def target(self) -> Floats:
        """Lengths that the motors hold (m,) [m], as the encoders call them."""
        return self._target.copy()

    @property
    def joint_angles(self) -> Floats:
        """True joint angles (n,) [rad]."""
        angles: Floats = self._mujoco.angles()
        return angles

    @property
    def lengths(self) -> Floats:
        """What encoders without offset, noise and quantum would read (m,) [m]."""
        return self.measure().lengths

    @property
    def tensions(self) -> Floats:
        """True tensions (m,) [N]."""
        return self.measure().tensions

    def measure(self) -> Moment:
        """What is true now: once for all that is felt, judged and known of it."""
        paths, paid_out, tensions = self.motors.measure()
        return Moment(self._mujoco.angles(), paths, paid_out, paid_out - self._zero, tensions)

    def slack(self, target: Floats, now: Moment | None = None) -> tuple[Floats, Floats]:
        """How slack each wire is (m,) [m]: paid out beyond its path, and target beyond length."""
        now = now or self.measure()
        beyond_path = self.motors.slack(now.paths, now.paid_out)
        beyond_length = target - now.lengths
        offset = self._sensors.length_offset
        if offset is not None:
            beyond_length -= offset
        return beyond_path, np.maximum(beyond_length, self._none, out=beyond_length)

    def site_pose(self, name: str) -> Floats:
        """Pose of a site in the world (4, 4), true."""
        return pose_of(*self._mujoco.sites[name])

    def _commanded(self, target: Floats) -> Floats:
        """What is to be paid out (m,) [m] for target lengths (m,) [m] as the encoders call them.

        The controller works on what encoders read, so their offsets move the wires.
        """
        paid_out = target + self._zero
        offset = self._sensors.length_offset
        if offset is not None:
            paid_out -= offset
        return paid_out

    def sense(self, now: Moment) -> tuple[Floats, Floats]:
        """What encoders (m,) [m] and tension sensors (m,) [N] read; where it is true, ``now``'s."""
        return self._sensors.read(now.lengths, now.tensions, self._noise)

    def measured_lengths(self) -> Floats:
        """What the encoders read (m,) [m]: with offset, noise and quantum."""
        return self._sensors.read_lengths(self.lengths, self._noise)

    def measured_tensions(self) -> Floats:
        """What the tension sensors read (m,) [N]: with offset and noise, never negative."""
        return self._sensors.read_tensions(self.tensions, self._noise)

    @abstractmethod
    def _noise(self, kinds: int) -> Floats:
        """Standard normal noise (kinds, m) of the sensors, one kind's after the other's."""


def pose_of(position: Floats, rotation: Floats) -> Floats:
    """Pose (..., 4, 4) of what is at a position (..., 3) [m], turned by (..., 3, 3)."""
    pose = np.zeros((*position.shape[:-1], 4, 4))
    pose[..., :3, :3] = rotation
    pose[..., :3, 3] = position
    pose[..., 3, 3] = 1.0
    return pose

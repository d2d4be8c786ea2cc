"""Measurements of a robot, or of many robots of one model at once."""

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
"""Tolerance when simulated times are compared [s]."""


class Moment(NamedTuple):
    """True state of a robot at one time; of many robots with a leading axis of robots.

    Attributes:
        joint_angles: joint angles (n,) [rad].
        paths: lengths of the tendons' paths from guide to end (m,) [m].
        paid_out: lengths paid out by the motors (m,) [m].
        lengths: lengths paid out since the zero posture (m,) [m]: encoder readings without error.
        tensions: tensions (m,) [N].
    """

    joint_angles: Floats
    paths: Floats
    paid_out: Floats
    lengths: Floats
    tensions: Floats


class Body(ABC):
    """Base class of one robot and of many robots; arrays of many have a leading axis of robots.

    Attributes:
        model: the MuJoCo model.
        data: an `MjData`, or an object with its fields and a leading axis of robots.
        motors: the motors of the muscles.
        muscles: names of the muscles, in the order of (m,) arrays.
    """

    model: mujoco.MjModel
    data: Any
    motors: Motors
    muscles: tuple[str, ...]
    _target: Floats
    _sensors: Sensors
    _position: Index
    _zero: Floats
    _zeros: Floats

    def _find_arrays(self) -> None:
        """Find the arrays of MuJoCo that are read in each step."""
        data, model = self.data, self.model
        positions, rotations = data.site_xpos, data.site_xmat
        shape = (*positions.shape[:-2], 3, 3)
        self._mujoco = SimpleNamespace(
            angles=reader(data.qpos, self._position),
            sites={
                model.site(i).name: (positions[..., i, :], rotations[..., i, :].reshape(shape))
                for i in range(model.nsite)
            },
        )

    @property
    @abstractmethod
    def time(self) -> Any:
        """Simulated time since the last reset [s]."""

    @property
    def target(self) -> Floats:
        """Target lengths of the motors (m,) [m], as the encoders read them."""
        return self._target.copy()

    @property
    def joint_angles(self) -> Floats:
        """True joint angles (n,) [rad]."""
        angles: Floats = self._mujoco.angles()
        return angles

    @property
    def lengths(self) -> Floats:
        """True lengths since the zero posture (m,) [m]: encoder readings without error."""
        return self.measure().lengths

    @property
    def tensions(self) -> Floats:
        """True tensions (m,) [N]."""
        return self.measure().tensions

    def measure(self) -> Moment:
        """True state now."""
        paths, paid_out, tensions = self.motors.measure()
        return Moment(self._mujoco.angles(), paths, paid_out, paid_out - self._zero, tensions)

    def slack(self, target: Floats, now: Moment | None = None) -> tuple[Floats, Floats]:
        """Slack of the muscles.

        Args:
            target: target lengths (m,) [m].
            now: the true state; None: measure it.

        Returns:
            Length paid out beyond the path (m,) [m]; target length beyond the length (m,) [m].
        """
        now = now or self.measure()
        beyond_path = self.motors.slack(now.paths, now.paid_out)
        beyond_length = target - now.lengths
        offset = self._sensors.length_offset
        if offset is not None:
            beyond_length -= offset
        return beyond_path, np.maximum(beyond_length, self._zeros, out=beyond_length)

    def site_pose(self, name: str) -> Floats:
        """True pose of a site in the world (4, 4)."""
        return pose_of(*self._mujoco.sites[name])

    def _commanded(self, target: Floats) -> Floats:
        """Lengths to be paid out (m,) [m] for target lengths (m,) [m] as the encoders read them.

        The controller works on encoder readings, so offsets of encoders move the muscles.
        """
        paid_out = target + self._zero
        offset = self._sensors.length_offset
        if offset is not None:
            paid_out -= offset
        return paid_out

    def read_sensors(self, now: Moment) -> tuple[Floats, Floats]:
        """Readings of encoders (m,) [m] and tension sensors (m,) [N].

        A sensor without errors returns the array of ``now`` itself.
        """
        return self._sensors.read(now.lengths, now.tensions, self._noise)

    def measured_lengths(self) -> Floats:
        """Readings of the encoders (m,) [m], with offset, noise and quantum."""
        return self._sensors.read_lengths(self.lengths, self._noise)

    def measured_tensions(self) -> Floats:
        """Readings of the tension sensors (m,) [N], with offset and noise, never negative."""
        return self._sensors.read_tensions(self.tensions, self._noise)

    @abstractmethod
    def _noise(self, kinds: int) -> Floats:
        """Sample standard normal noise of the sensors (kinds, m)."""


def pose_of(position: Floats, rotation: Floats) -> Floats:
    """Pose (..., 4, 4) from a position (..., 3) [m] and a rotation (..., 3, 3)."""
    pose = np.zeros((*position.shape[:-1], 4, 4))
    pose[..., :3, :3] = rotation
    pose[..., :3, 3] = position
    pose[..., 3, 3] = 1.0
    return pose

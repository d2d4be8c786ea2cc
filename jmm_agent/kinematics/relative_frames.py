"""Poses and Jacobians of frames against each other, from Pinocchio's model of the arm."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jmm_agent.kinematics.pinocchio_model import KinematicsError, load_model
from jmm_agent.types import Floats


class RelativeFrames:
    """The frames of an MJCF file, some of whose joints move.

    Args:
        mjcf_path: MJCF file of the nominal model.
        joints: names of the n joints, in the order of every q.
        locked: angles of other joints [rad].

    Attributes:
        limits: lowest and highest angle of each joint (n, 2) [rad], read-only.

    Raises:
        KinematicsError: the file is missing or broken, or a joint is unknown.
    """

    def __init__(
        self, mjcf_path: str | os.PathLike[str], joints: Sequence[str], locked: Mapping[str, float]
    ) -> None:
        self._model, order, self._frames = load_model(mjcf_path, joints, locked)
        self._data = self._model.createData()
        self._rank = np.array([joints.index(name) for name in order])
        self.column = np.argsort(self._rank)
        """Pinocchio's number of each joint (n,)."""
        if self._model.nq != len(order) or self._model.nv != len(order):
            raise KinematicsError("Kinematics: every joint must be a hinge or a slide.")
        self.limits: Floats = np.column_stack(
            [self._model.lowerPositionLimit, self._model.upperPositionLimit]
        )[self.column]
        self.limits.setflags(write=False)

    def __getstate__(self) -> dict[str, Any]:
        """All but Pinocchio's working memory, which two threads or processes must not share."""
        return {name: value for name, value in vars(self).items() if name != "_data"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._data = self._model.createData()
        self.limits.setflags(write=False)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all frames."""
        return tuple(self._frames)

    def number(self, name: str | None) -> Any:
        """Pinocchio's number of a frame; None for the world, whose name is None.

        Raises:
            KinematicsError: there is no such frame.
        """
        if name is None:
            return None
        if name not in self._frames:
            raise KinematicsError(f"Kinematics: unknown frame {name!r}; frames: {self.names}.")
        return self._frames[name]

    def relative(self, q: Floats, frame: int, reference: int | None) -> Any:
        """Pose (pinocchio.SE3) of a frame in a reference at joint angles (n,) [rad]."""
        pin.computeJointJacobians(self._model, self._data, q[self._rank])
        pose = pin.updateFramePlacement(self._model, self._data, frame)
        if reference is None:
            return pose
        return pin.updateFramePlacement(self._model, self._data, reference).actInv(pose)

    def jacobian(self, frame: int, reference: int | None, relative: Any) -> Floats:
        """Twist (6, n) of a frame against a reference, in the axes of the frame.

        Args:
            frame: Pinocchio's number of the frame.
            reference: that of the reference; None: world.
            relative: result of the last call of `relative`, with the same frames.

        Returns:
            The Jacobian; its columns are in Pinocchio's order, see `column`.
        """
        local = pin.ReferenceFrame.LOCAL
        # Of a robot with one joint Pinocchio returns (6,).
        jacobian = pin.getFrameJacobian(self._model, self._data, frame, local).reshape(6, -1)
        if reference is None:
            return jacobian
        other = pin.getFrameJacobian(self._model, self._data, reference, local).reshape(6, -1)
        return jacobian - relative.toActionMatrixInverse() @ other

    def misplaced(self, frame: int, reference: int | None, relative: Any) -> Floats:
        """Twist (6, n, 6) of a frame against a reference by errors of the model's joints.

        Args:
            frame: Pinocchio's number of the frame.
            reference: that of the reference; None: world.
            relative: result of the last call of `relative`, with the same frames.

        Returns:
            For each joint, in Pinocchio's order, the twists in the axes of the frame by an offset
            of the joint along each axis of its own frame [1], and by a turn of its axis about each
            [m/rad, rad/rad], which leaves the robot as it is at the angle 0.
        """
        model, data = self._model, self._data
        twists = np.zeros((6, model.nv, 6))
        for joint in range(1, model.njoints):
            before = data.oMi[model.parents[joint]] * model.jointPlacements[joint]
            for number, sign, share in ((frame, 1.0, np.eye(6)),) + (
                () if reference is None else ((reference, -1.0, relative.toActionMatrixInverse()),)
            ):
                if joint not in model.supports[model.frames[number].parentJoint]:
                    continue
                here = data.oMf[number]
                moved = here.actInv(before).toActionMatrix()
                turned = moved[:, 3:] - here.actInv(data.oMi[joint]).toActionMatrix()[:, 3:]
                both = np.hstack([moved[:, :3], turned])
                twists[:, model.joints[joint].idx_v] += sign * share @ both
        return twists


def finite(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """An argument as an array of finite numbers.

    Args:
        name: of the argument, for the message.
        value: the argument.
        shape: that it must have.

    Raises:
        KinematicsError: the shape is another, or a number is not finite.
    """
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        array = np.array(np.nan)
    if array.shape != shape or not np.isfinite(array).all():
        raise KinematicsError(f"Kinematics: {name} must be finite numbers of shape {shape}.")
    return array

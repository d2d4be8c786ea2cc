"""Departures of the bodies: bones and joint axes, and the markers of hand and can or none."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from kengoro_env.departures.rotations import turn, turned
from kengoro_env.errors import ArgumentError
from kengoro_env.names import JOINTS
from kengoro_env.robot.draft import Draft

PLATE = "marker_plate"
"""Name of the body of the hand's marker, and of its geom."""

CAN, CAN_PLATE = "can", "marker_can_plate"
"""Names of the can's body, and of the geom of its marker."""

CAN_SIDES = 64
"""Number of sides of a can that is drawn round."""


@dataclass(frozen=True)
class BoneError:
    """Bones have other lengths and joints other axes than in the nominal model.

    The paper takes both as right (sec. II-A); those of a real robot somebody has measured.

    Attributes:
        position: standard deviation of a joint's place in the bone before it, along each axis [m],
            clipped at two sigma.
        rotation: standard deviation of a joint axis's direction, about each axis [rad].
        seed: seed of the errors.

    Raises:
        ArgumentError: a standard deviation is negative or not finite.
    """

    position: float = 0.0
    rotation: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        _check(self, self.position, self.rotation)

    def edit(self, draft: Draft) -> None:
        """Move the bodies of the arm's joints, and turn the joints' axes."""
        if self.position == 0.0 and self.rotation == 0.0:
            return
        rng = np.random.default_rng([self.seed, 107])
        joints = {joint.name: joint for joint in draft.spec.joints}
        for name in JOINTS:
            shift = self.position * np.clip(rng.standard_normal(3), -2.0, 2.0)
            vector = self.rotation * rng.standard_normal(3)
            if name not in joints:  # the scene has only a part of the arm
                continue
            joint = joints[name]
            if joint.parent.joints[0].name == name:
                joint.parent.pos = joint.parent.pos + shift
            if self.rotation > 0.0:
                joint.axis = turned(joint.axis, vector)


@dataclass(frozen=True)
class MarkerError:
    """The marker on the hand was printed and mounted otherwise than in the nominal model.

    Attributes:
        size: standard deviation of the printed side's relative error [1], clipped at three sigma.
        position: standard deviation of the mounting along each axis [m].
        rotation: standard deviation of the mounting about each axis [rad].
        seed: seed of the errors.

    Raises:
        ArgumentError: a standard deviation is negative or not finite.
    """

    size: float = 0.0
    position: float = 0.0
    rotation: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        _check(self, self.size, self.position, self.rotation)

    def edit(self, draft: Draft) -> None:
        """Move the marker's plate and change its size, if the scene has one."""
        if self.size == 0.0 and self.position == 0.0 and self.rotation == 0.0:
            return
        if PLATE not in [body.name for body in draft.spec.bodies]:
            return
        rng = np.random.default_rng([self.seed, 108])
        plate, geom = draft.spec.body(PLATE), draft.spec.geom(PLATE)
        side = 1.0 + self.size * np.clip(rng.standard_normal(), -3.0, 3.0)
        geom.size = geom.size * np.array([side, side, 1.0])
        plate.pos = plate.pos + self.position * rng.standard_normal(3)
        if self.rotation > 0.0:
            mounted = draft.spec.copy().compile().body(PLATE).quat
            turn(plate, mounted, self.rotation * rng.standard_normal(3))


@dataclass(frozen=True)
class NoHandMarker:
    """The hand carries no marker that a camera could see; the robot moves as with it, to the bit.

    The plate stays as a body that cannot be seen, with its mass.

    Attributes:
        removed: whether the marker is removed.
    """

    removed: bool = False

    def edit(self, draft: Draft) -> None:
        """Make the marker's plate invisible, if the scene has one."""
        if self.removed:
            _hide(draft, PLATE)


@dataclass(frozen=True)
class NoCanMarker:
    """The can carries no marker that a camera could see; it moves as with it, to the bit.

    It is drawn as a prism of `CAN_SIDES` sides. The camera in the head draws round geoms with few
    sides, which makes them narrower than they are; that matters only where the can is found by its
    outline.

    Attributes:
        removed: whether the marker is removed.
    """

    removed: bool = False

    def edit(self, draft: Draft) -> None:
        """Make the marker's plate invisible, if the scene has a can with one, and the can round."""
        if not self.removed or CAN not in [body.name for body in draft.spec.bodies]:
            return
        _hide(draft, CAN_PLATE)
        can = draft.spec.body(CAN)
        for number, geom in enumerate(list(can.geoms)):
            if geom.type == mujoco.mjtGeom.mjGEOM_CYLINDER:
                _draw_round(draft, can, geom, f"{CAN}_round_{number}")


def _draw_round(draft: Draft, body: mujoco.MjsBody, cylinder: mujoco.MjsGeom, name: str) -> None:
    """Draw a cylinder with more sides; it stays as a geom that cannot be seen."""
    turn = np.linspace(0.0, 2 * np.pi, CAN_SIDES, endpoint=False)
    radius, half = cylinder.size[:2]
    ring = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.full(CAN_SIDES, half)], 1)
    draft.spec.add_mesh(name=name, uservert=np.vstack([ring, ring * [1, 1, -1]]).ravel())
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=name,
        pos=cylinder.pos,
        material=cylinder.material,
        group=cylinder.group,
        contype=0,
        conaffinity=0,
        mass=0,
    )
    cylinder.material, cylinder.rgba = "", np.zeros(4)


def _hide(draft: Draft, name: str) -> None:
    """Make a geom invisible, if the scene has it."""
    if name in [geom.name for geom in draft.spec.geoms]:
        geom = draft.spec.geom(name)
        geom.material, geom.rgba = "", np.zeros(4)


def _check(departure: object, *deviations: float) -> None:
    if not all(0.0 <= one < np.inf for one in deviations):
        raise ArgumentError(f"{departure}: standard deviations must be finite and at least 0")

"""Takes the judge's pictures, and knows the truth about them.

A picture is rendered a little larger than the frame by the scene's own camera, and bent by its
lens. What of the hand is visible is counted on a canvas of three times the frame's width.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from experiments.hand_detector.appearance import Appearance
from experiments.hand_detector.optics import Image
from experiments.hand_detector.scene import (
    CAN,
    EYE,
    HAND,
    SCENE,
    finger_joints,
    hand_geoms,
    make_model,
    robot_geoms,
)
from jmm_agent.types import Floats
from kengoro_env.assets import asset_path
from kengoro_env.departures import CameraError, actual
from kengoro_env.names import JOINTS
from kengoro_env.robot.draft import Draft
from kengoro_env.robot.model_file import load_spec
from kengoro_env.vision.lens import undistorted
from kengoro_env.vision.rendering import COARSE, HEIGHT, WIDTH, open_renderer

MARGIN = (16, 12)
"""Pixels around the frame that are rendered for the lens."""
FINE = {"numslices": 28, "numstacks": 16, "numquads": 1, "offsamples": 4, "shadowsize": 1024}
"""Visual quality with round geoms, shadows and anti-aliasing."""
WIDE = 3
"""Width of the canvas for the whole hand [frames]; it has half the frame's resolution."""
TO_CAMERA = np.diag([1.0, -1.0, -1.0])
"""MuJoCo's camera has y up and z backward, ours y down and z forward."""
FLAGS = mujoco.mjtRndFlag
AS_COPY, COPY = mujoco.mjtObj.mjOBJ_SITE, -2
"""Type of object that copies have in a scene, and their number in `Studio.visible`."""
Decorate = Callable[[mujoco.MjvScene], None]


class ActualCamera(NamedTuple):
    """The camera that takes the pictures.

    Attributes:
        focal: length of its lens [px].
        k1: radial distortion of its lens [1].
    """

    focal: float
    k1: float

    @property
    def middle(self) -> Floats:
        """Its principal point (2,) [px]."""
        return np.array([WIDTH - 1.0, HEIGHT - 1.0]) / 2.0

    def bend(self, picture: Image) -> Image:
        """The frame that the lens makes of a picture that is larger by `MARGIN`."""
        columns, rows = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
        seen = np.stack([columns, rows], axis=-1).reshape(-1, 2) - self.middle
        rays = seen / self.focal
        if self.k1 != 0.0:
            rays = undistorted(rays, (self.k1, 0.0, 0.0, 0.0, 0.0))
        maps = (rays * self.focal + self.middle + MARGIN).astype(np.float32)
        x, y = maps.reshape(HEIGHT, WIDTH, 2).transpose(2, 0, 1)
        return np.asarray(cv2.remap(picture, x, y, cv2.INTER_LINEAR))

    def project(self, points: Floats) -> Floats:
        """Pixels (..., 2) of points (..., 3) in the camera; NaN behind it."""
        depth = np.where(points[..., 2:] > 0.0, points[..., 2:], np.nan)
        rays = points[..., :2] / depth
        bent = rays * (1.0 + self.k1 * np.sum(rays**2, axis=-1, keepdims=True))
        return np.asarray(bent * self.focal + self.middle)


class Visible(NamedTuple):
    """What a frame shows.

    Attributes:
        hand: pixels of the hand in the frame.
        whole: pixels of the whole hand, also outside of the frame, with nothing before it.
        arm: pixels of the robot's other parts in the frame.
        copies: pixels of copied geoms in the frame.
    """

    hand: int
    whole: int
    arm: int = 0
    copies: int = 0

    @property
    def share(self) -> float:
        """Share of the hand that is visible [1]."""
        return min(self.hand / self.whole, 1.0) if self.whole else 0.0


class Studio:
    """The scene, set up for one frame after the other.

    Attributes:
        model: the scene; `appearance` and `clutter` write into it.
        data: its state.
        appearance: writes appearances into the model.
        camera: the actual camera.
    """

    def __init__(self) -> None:
        self._spec = load_spec(asset_path(SCENE))
        self.model = make_model()
        self.data = mujoco.MjData(self.model)
        self.appearance = Appearance(self.model)
        self.hand, self._robot = hand_geoms(self.model), robot_geoms(self.model)
        self._joints = [int(self.model.joint(name).qposadr[0]) for name in JOINTS]
        self._fingers = [int(self.model.jnt_qposadr[i]) for i in finger_joints(self.model)]
        self.ranges = np.array([self.model.joint(name).range for name in JOINTS])
        self._renderers: dict[str, mujoco.Renderer] = {}
        self._pending: dict[str, set[int]] = {}
        self.set_camera(None, 0.0)

    def close(self) -> None:
        """Free the GL contexts."""
        for renderer in self._renderers.values():
            renderer.close()
        self._renderers.clear()

    def set_camera(self, seed: int | None, k1: float) -> None:
        """Mount a camera.

        Args:
            seed: of an actual robot, whose errors the camera has; None: the nominal camera.
            k1: radial distortion of its lens [1].
        """
        draft = Draft.of(self._spec)
        for departure in () if seed is None else actual(seed):
            if isinstance(departure, CameraError):
                departure.edit(draft)
        mounted, own = draft.spec.compile().camera(EYE), self.model.camera(EYE)
        own.pos[:], own.quat[:] = mounted.pos, mounted.quat
        focal = HEIGHT / 2.0 / np.tan(np.radians(float(mounted.fovy[0])) / 2.0)
        self.camera = ActualCamera(float(focal), k1)

    def set_robot(self, posture: Floats, fingers: Floats) -> None:
        """Set the joints (14,) and the fingers' joints (4,) [rad]."""
        self.data.qpos[self._joints], self.data.qpos[self._fingers] = posture, fingers
        self.update()

    def put_can(self, position: Floats) -> None:
        """Put the can's middle somewhere (3,) [m], upright."""
        self.data.joint(CAN).qpos[:] = (*position, 1.0, 0.0, 0.0, 0.0)
        self.update()

    def update(self) -> None:
        """Compute where all geoms, cameras and lamps are."""
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)

    def camera_pose(self) -> Floats:
        """Pose of the camera in the world (4, 4), x right, y down, z forward."""
        eye, pose = self.data.camera(EYE), np.eye(4)
        pose[:3, :3], pose[:3, 3] = eye.xmat.reshape(3, 3) @ TO_CAMERA, eye.xpos
        return pose

    def hand_pose(self) -> Floats:
        """Pose of the hand in the camera (4, 4)."""
        body, pose = self.data.body(HAND), np.eye(4)
        pose[:3, :3], pose[:3, 3] = body.xmat.reshape(3, 3), body.xpos
        return np.asarray(np.linalg.inv(self.camera_pose()) @ pose)

    def hand_middle(self) -> Floats:
        """Middle of the hand's geoms in the world (3,) [m]."""
        return np.asarray(self.data.geom_xpos[self.hand].mean(axis=0))

    def hand_outlines(self) -> list[Floats]:
        """Points of each of the hand's geoms in the hand's axes (n, 3) [m]: all vertices of a mesh,
        or the corners of the box around it."""
        body = self.data.body(HAND)
        signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
        found = []
        for geom in np.flatnonzero(self.hand):
            middle, half = self.model.geom_aabb[geom].reshape(2, 3)
            points = middle + signs * half
            if self.model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
                mesh = self.model.mesh(self.model.geom_dataid[geom])
                begin, count = int(mesh.vertadr[0]), int(mesh.vertnum[0])
                points = self.model.mesh_vert[begin : begin + count].astype(float)
            turn = self.data.geom_xmat[geom].reshape(3, 3)
            world = points @ turn.T + self.data.geom_xpos[geom]
            found.append((world - body.xpos) @ body.xmat.reshape(3, 3))
        return found

    def picture(self, fine: bool, tendons: bool, decorate: Decorate | None = None) -> Image:
        """The frame (480, 640, 3) of an ideal sensor, through the lens.

        Args:
            fine: whether with shadows, anti-aliasing and many faces, or as the environments render.
            tendons: whether tendons are rendered.
            decorate: changes the scene before it is rendered.
        """
        size = np.array([WIDTH, HEIGHT]) + 2 * np.array(MARGIN)
        renderer = self._renderer("fine" if fine else "plain", size, FINE if fine else COARSE)
        self._update_scene(renderer, float(size[1]) / self.camera.focal, tendons)
        renderer.scene.flags[FLAGS.mjRND_SHADOW] = fine
        if decorate is not None:
            decorate(renderer.scene)
        return self.camera.bend(renderer.render())

    def visible(self, decorate: Decorate | None = None) -> Visible:
        """What of hand and arm the frame shows, in pixels of half its resolution."""
        size = np.array([WIDTH, HEIGHT]) * WIDE // 2
        renderer = self._renderer("wide", size, COARSE)
        tangent = WIDE * HEIGHT / self.camera.focal
        self._update_scene(renderer, tangent, False)
        if decorate is not None:
            decorate(renderer.scene)
        seen = self._geoms_in(renderer)
        half = np.array([HEIGHT, WIDTH]) // 4
        top, left = np.array(seen.shape) // 2 - half
        frame = seen[top : top + 2 * half[0], left : left + 2 * half[1]]
        numbers = [np.flatnonzero(geoms) for geoms in (self.hand, self._robot & ~self.hand)]
        hand, arm = (int(np.isin(frame, own).sum()) for own in numbers)
        copies = int((frame == COPY).sum())
        self._update_scene(renderer, tangent, False)
        geoms_left_out(~self.hand)(renderer.scene)
        whole = int((self._geoms_in(renderer) >= 0).sum())
        return Visible(hand, whole, arm, copies)

    def _geoms_in(self, renderer: mujoco.Renderer) -> NDArray[np.int32]:
        """Id of the geom that each pixel shows; -1: none, `COPY`: a copy."""
        renderer.enable_segmentation_rendering()
        found = renderer.render()
        renderer.disable_segmentation_rendering()
        number, kind = found[:, :, 0], found[:, :, 1]
        geoms = np.where(kind == int(mujoco.mjtObj.mjOBJ_GEOM), number, -1)
        return np.where(kind == int(AS_COPY), COPY, geoms)

    def _update_scene(self, renderer: mujoco.Renderer, tangent: float, tendons: bool) -> None:
        """Update a scene; ``tangent`` is twice that of half the vertical angle of view."""
        visible = mujoco.MjvOption()
        visible.sitegroup[:] = 0
        visible.flags[mujoco.mjtVisFlag.mjVIS_TENDON] = tendons
        self.model.camera(EYE).fovy[:] = np.degrees(2.0 * np.arctan(tangent / 2.0))
        renderer.update_scene(self.data, EYE, visible)
        renderer.scene.flags[FLAGS.mjRND_SHADOW] = False
        renderer.scene.flags[FLAGS.mjRND_REFLECTION] = False

    def _renderer(
        self, name: str, size: NDArray[np.int64], quality: dict[str, int]
    ) -> mujoco.Renderer:
        """A renderer, with the textures as they are now."""
        for pending in self._pending.values():
            pending.update(self.appearance.changed)
        self.appearance.changed.clear()
        if name not in self._renderers:
            width, height = (int(side) for side in size)
            self._renderers[name] = open_renderer(self.model, width, height, quality)
            self._pending[name] = set()
        renderer = self._renderers[name]
        if renderer._gl_context:
            renderer._gl_context.make_current()
        for texture in sorted(self._pending[name]):
            mujoco.mjr_uploadTexture(self.model, renderer._mjr_context, texture)
        self._pending[name].clear()
        return renderer


def geoms_left_out(geoms: NDArray[np.bool_]) -> Decorate:
    """Leaves some of the model's geoms (ngeom,) out of a scene."""

    def decorate(scene: mujoco.MjvScene) -> None:
        for geom in scene.geoms[: scene.ngeom]:
            if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and geoms[geom.objid]:
                geom.type = mujoco.mjtGeom.mjGEOM_NONE

    return decorate


def add_copy(scene: mujoco.MjvScene, geom: mujoco.MjvGeom, move: Floats) -> None:
    """Add a copy of a geom to a scene, moved by a transformation of the world (4, 4)."""
    if scene.ngeom >= scene.maxgeom:
        raise ValueError(f"The scene is full: it has room for {scene.maxgeom} geoms.")
    other = scene.geoms[scene.ngeom]
    for name in dir(geom):
        value = getattr(geom, name)
        if isinstance(value, np.ndarray):
            getattr(other, name)[:] = value
        elif not name.startswith("_"):
            setattr(other, name, value)
    other.objtype, other.segid = AS_COPY, scene.ngeom
    other.pos[:] = move[:3, :3] @ geom.pos + move[:3, 3]
    other.mat[:] = move[:3, :3] @ geom.mat
    scene.ngeom += 1

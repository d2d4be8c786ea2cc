"""Labelled frames of a robot's hand: random postures and appearances, from its camera."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import mujoco
import numpy as np

from jmm_agent.vision.hand_model_file import middle_of, radius_of
from kengoro.hand_detector.appearance import Appearance, add_textures, robot_parts
from kengoro.hand_detector.hand_points import hand_geoms, hand_points
from kengoro_env.robot.subtree import subtree
from kengoro_env.types import Floats
from kengoro_env.vision.rendering import QUALITY, open_renderer

WIDTH, HEIGHT = 640, 480
SHADOW_SIZE = 1024
"""Side of the map of shadows [px]."""
TRIES = 200
"""Postures that are tried until one shows the hand."""
NEAR, FAR = 0.12, 1.5
"""Distances of the hand from the camera that are used [m]."""
FINGERS_MOVE = 0.3
"""Share of the frames in which the fingers move [1]."""
IN_VIEW = 0.85
"""Share of the frames in which the hand is in view [1]."""


class Frame(NamedTuple):
    """A frame, and what it shows.

    Attributes:
        image: (480, 640, 3) uint8.
        pose: pose_hand_in_camera (4, 4), camera x right, y down, z forward [m].
        visible: share of the hand's pixels that nothing hides [1]; 0 if it is not in the frame.
        others: middles of the model's other geoms in the camera (n, 3) [m].
    """

    image: np.ndarray
    pose: Floats
    visible: float
    others: Floats

    def middle(self, centre: Floats) -> Floats:
        """Middle of the hand in the camera (3,) [m].

        Args:
            centre: the same in the hand's axes (3,) [m].
        """
        return np.asarray(self.pose[:3, :3] @ centre + self.pose[:3, 3])

    def points_in_camera(self, points: Floats) -> Floats:
        """Points of the hand's axes (n, 3) [m] in the camera's."""
        return np.asarray(points @ self.pose[:3, :3].T + self.pose[:3, 3])


def load_model(
    path: Path, random: np.random.Generator, hidden: Sequence[str] = ()
) -> mujoco.MjModel:
    """A model with random textures, without some of its geoms.

    Args:
        path: of the MJCF.
        random: source of the textures.
        hidden: names of geoms that are not drawn, as a marker on the hand.
    """
    spec = mujoco.MjSpec.from_file(str(path))
    add_textures(spec, random)
    for name in hidden:
        spec.geom(name).group = 5
    spec.visual.quality.offsamples = 0
    return spec.compile()


class FrameMaker:
    """Makes frames of a hand.

    Args:
        model: see `load_model`.
        body: name of the hand's body.
        camera: name of the camera.
        count: number of points of the hand.

    Attributes:
        points: of the hand in its own axes (count, 3) [m].
        centre: middle of the hand in them (3,) [m].
        radius: distance of the farthest point from it [m].
        width, height: of the frames [px].
        fovy: vertical view of the camera [rad].
    """

    def __init__(self, model: mujoco.MjModel, body: str, camera: str, count: int = 16) -> None:
        self._model, self._data = model, mujoco.MjData(model)
        self._body, self._camera = model.body(body).id, model.camera(camera).id
        self._hand = subtree(model, self._body)
        self._renderer = open_renderer(model, WIDTH, HEIGHT, {**QUALITY, "shadowsize": SHADOW_SIZE})
        self._small = open_renderer(model, WIDTH // 4, HEIGHT // 4, QUALITY)
        self._visible = mujoco.MjvOption()
        self._visible.sitegroup[:] = 0
        self._visible.flags[mujoco.mjtVisFlag.mjVIS_TENDON] = False
        self._hand_geoms = hand_geoms(model, self._body)
        self._other_geoms = np.setdiff1d(np.arange(model.ngeom), list(self._hand_geoms))
        self._parts = robot_parts(model, self._body)
        turns = model.jnt_type != mujoco.mjtJoint.mjJNT_SLIDE
        free = np.where(turns[:, None], [-np.pi, np.pi], [-0.1, 0.1])
        self._ranges = np.where(model.jnt_limited[:, None] != 0, model.jnt_range, free)
        self.width, self.height = WIDTH, HEIGHT
        self.fovy = float(np.deg2rad(model.cam_fovy[self._camera]))
        self.focal = HEIGHT / 2.0 / np.tan(self.fovy / 2.0)
        self.points = hand_points(model, self._body, count, self._hand_geoms)
        self.centre, self.radius = middle_of(self.points), radius_of(self.points)

    def make(self, random: np.random.Generator, shown: bool | None = None) -> Frame:
        """A frame of a random posture and appearance.

        Args:
            random: source of all.
            shown: whether the hand is in view; None: mostly. Where no posture takes it out of
                view it is left out; a part of it may be at the border.
        """
        if shown is None:
            shown = bool(random.random() < IN_VIEW)
        for _ in range(TRIES):
            self._pose(random)
            pose = self._pose_in_camera()
            if self._is_in_view(pose) == shown:
                break
        scene = self._renderer.scene
        self._renderer.update_scene(self._data, self._camera, self._visible)
        scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        appearance = Appearance(self._model, self._parts, random)
        eye = self._data.cam_xpos[self._camera]
        hand = self._data.xpos[self._body] + self._data.xmat[self._body].reshape(3, 3) @ self.centre
        appearance.colour(scene)
        appearance.light(scene, hand)
        appearance.add_walls(scene, eye, -self._data.cam_xmat[self._camera].reshape(3, 3)[:, 2])
        appearance.add_objects(scene, eye, hand)
        absent = not shown and self._is_in_view(pose)  # no posture takes it out of view
        if absent:
            self._leave_out(scene, hand=True)
        image = self._renderer.render().copy()
        visible = 0.0 if absent else self._share_in_frame(pose)
        if visible > 0.0:
            visible *= self._share_visible(scene)
        return Frame(image, pose, visible, self._others())

    def _pose(self, random: np.random.Generator) -> None:
        """A random posture; fingers mostly stay as they are in the model."""
        model, data = self._model, self._data
        data.qpos[:] = model.qpos0
        fingers_move = random.random() < FINGERS_MOVE
        for joint in range(model.njnt):
            kind, address = model.jnt_type[joint], model.jnt_qposadr[joint]
            if kind == mujoco.mjtJoint.mjJNT_FREE:
                data.qpos[address : address + 2] += random.normal(0.0, 0.1, 2)
                continue
            body = model.jnt_bodyid[joint]
            if self._hand[body] and body != self._body and not fingers_move:
                continue
            if kind == mujoco.mjtJoint.mjJNT_BALL:
                _turn_ball(data.qpos[address : address + 4], self._ranges[joint], random)
            else:
                data.qpos[address] = random.uniform(*self._ranges[joint])
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)  # which some cameras follow
        mujoco.mj_camlight(model, data)

    def _pose_in_camera(self) -> Floats:
        """pose_hand_in_camera (4, 4), camera x right, y down, z forward [m]."""
        axes = self._data.cam_xmat[self._camera].reshape(3, 3) * [1.0, -1.0, -1.0]
        pose = np.eye(4)
        pose[:3, :3] = axes.T @ self._data.xmat[self._body].reshape(3, 3)
        pose[:3, 3] = axes.T @ (self._data.xpos[self._body] - self._data.cam_xpos[self._camera])
        return pose

    def _others(self) -> Floats:
        """Middles of the geoms that are not the hand's, in the camera (n, 3) [m]."""
        axes = self._data.cam_xmat[self._camera].reshape(3, 3) * [1.0, -1.0, -1.0]
        away = self._data.geom_xpos[self._other_geoms] - self._data.cam_xpos[self._camera]
        return np.asarray(away @ axes)

    def _is_in_view(self, pose: Floats) -> bool:
        x, y, z = pose[:3, :3] @ self.centre + pose[:3, 3]
        if not NEAR <= z <= FAR:
            return False
        return bool(
            abs(x / z) * self.focal < 0.5 * WIDTH and abs(y / z) * self.focal < 0.5 * HEIGHT
        )

    def _share_in_frame(self, pose: Floats) -> float:
        """Share of the hand's points that lie within the frame's borders."""
        x, y, z = pose[:3, :3] @ self.points.T + pose[:3, 3:]
        inside = (z > 0) & (abs(x) * self.focal < 0.5 * WIDTH * z)
        return float(np.mean(inside & (abs(y) * self.focal < 0.5 * HEIGHT * z)))

    def _share_visible(self, scene: mujoco.MjvScene) -> float:
        """Share of the hand's pixels that nothing hides, from two pictures of its segments."""
        renderer = self._small
        renderer._scene = scene  # the one that was decorated
        flags = scene.flags
        flags[mujoco.mjtRndFlag.mjRND_SEGMENT], flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = 1, 1
        both = []
        for alone in (False, True):
            for geom in scene.geoms[: scene.ngeom]:
                geom.segid = 0 if self._is_of_hand(geom) else 1
            if alone:
                self._leave_out(scene, hand=False)
            picture = renderer.render()
            both.append(int(((picture[..., 0] == 1) & (picture[..., 1] == 0)).sum()))
        flags[mujoco.mjtRndFlag.mjRND_SEGMENT], flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = 0, 0
        return both[0] / both[1] if both[1] else 0.0

    def _leave_out(self, scene: mujoco.MjvScene, hand: bool) -> None:
        """Leave the hand out of a scene, or all but the hand."""
        for geom in scene.geoms[: scene.ngeom]:
            if self._is_of_hand(geom) == hand:
                geom.type = mujoco.mjtGeom.mjGEOM_NONE

    def _is_of_hand(self, geom: mujoco.MjvGeom) -> bool:
        return geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and geom.objid in self._hand_geoms


def _turn_ball(quaternion: Floats, limits: Floats, random: np.random.Generator) -> None:
    """Set the quaternion (4,) of a ball joint to a random rotation within its range [rad]."""
    axis = random.normal(0.0, 1.0, 3)
    angle = random.uniform(0.0, limits[1])
    mujoco.mju_axisAngle2Quat(quaternion, axis / np.linalg.norm(axis), angle)


def develop(image: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """What a camera makes of an image: blur, exposure, white balance, noise and compression.

    Args:
        image: (h, w, 3) uint8.
        random: source of all.
    """
    picture = image
    if random.random() < 0.2:
        picture = cv2.filter2D(picture, -1, _motion(random))
    if random.random() < 0.6:
        picture = cv2.GaussianBlur(picture, (0, 0), float(random.choice([0.6, 1.0, 2.0])))
    picture = cv2.LUT(picture, _exposure(picture, random))
    noise = random.choice([0.0, 2.0, 5.0, 12.0], p=[0.3, 0.3, 0.25, 0.15])
    if noise:
        cv2.setRNGSeed(int(random.integers(2**31)))
        grain = np.empty(picture.shape, dtype=np.int16)
        cv2.randn(grain, np.zeros(3), np.full(3, noise))
        picture = cv2.add(picture, grain, dtype=cv2.CV_8U)
    if random.random() < 0.4:
        quality = [cv2.IMWRITE_JPEG_QUALITY, int(random.choice([12, 25, 50, 85]))]
        code = cv2.imencode(".jpg", picture[..., ::-1], quality)[1]
        picture = np.asarray(cv2.imdecode(code, cv2.IMREAD_COLOR_RGB))
    return np.asarray(picture, dtype=np.uint8)


def _exposure(picture: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Values (256, 1, 3) uint8 that pixels get: to a random mean brightness, and a colour cast."""
    mean = max(float(picture[::8, ::8].mean()), 8.0) / 255.0
    gamma = random.uniform(0.7, 1.4)
    gain = random.uniform(0.12, 0.75) / mean if random.random() < 0.6 else random.uniform(0.6, 1.4)
    cast = 1.0 + random.normal(0.0, random.choice([0.03, 0.15]), 3)
    offset = random.normal(0.0, 0.03)
    values = np.linspace(0.0, 1.0, 256)[:, None] ** gamma * min(gain, 4.0) * cast + offset
    return np.rint(255.0 * np.clip(values, 0.0, 1.0)).astype(np.uint8)[:, None]


def _motion(random: np.random.Generator) -> np.ndarray:
    """Kernel of the blur along a line, normalised."""
    kernel = np.zeros((15, 15), dtype=np.float32)
    direction, half = random.uniform(0.0, np.pi), random.uniform(1.0, 6.5)
    step = half * np.array([np.cos(direction), np.sin(direction)])
    ends = [tuple(np.rint(7.0 + sign * step).astype(int).tolist()) for sign in (-1.0, 1.0)]
    cv2.line(kernel, ends[0], ends[1], 1.0)
    return kernel / kernel.sum()

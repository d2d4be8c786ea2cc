"""A marker plate in front of a chequered wall, rendered by MuJoCo with an exact camera."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from jmm_agent.vision.camera import Camera

TEXTURES = Path(__file__).parents[3] / "assets/mjcf/kengoro_arm/textures"
OPENCV_IN_MUJOCO = np.diag([1.0, -1.0, -1.0, 1.0])
CAMERA = Camera.from_fovy(640, 480, np.deg2rad(45))
SIDE, PLATE = 0.050, 0.060  # black square and white plate of the hand's marker [m]

SCENE = """
<mujoco>
  <visual>
    <global offwidth="640" offheight="480"/>
    <headlight ambient=".4 .4 .4" diffuse=".5 .5 .5" specular="0 0 0"/>
    <quality offsamples="0" shadowsize="0"/>
    <map znear=".01" zfar="5"/>
  </visual>
  <asset>
    <texture name="marker" type="cube" filefront="{texture}" rgb1="1 1 1"/>
    <material name="marker" texture="marker" specular="0" reflectance="0"/>
    <texture name="wall" type="2d" builtin="checker"
      rgb1=".35 .4 .45" rgb2=".55 .5 .45" width="256" height="256"/>
    <material name="wall" texture="wall" texrepeat="7 5" specular="0" reflectance="0"/>
  </asset>
  <worldbody>
    <camera name="eye" fovy="45"/>
    <geom type="box" size="2 2 .01" pos="0 0 -1.5" material="wall"/>
    <body name="plate" mocap="true">
      <geom type="box" size="{half} {half} .001" pos="0 0 -.001" material="marker"/>
    </body>
  </worldbody>
</mujoco>
"""


class MarkerScene:
    """The plate, rendered in `CAMERA`.

    Args:
        texture: name of the marker's texture.
        plate: side of the plate [m].
    """

    def __init__(self, texture: str = "marker_hand", plate: float = PLATE) -> None:
        xml = SCENE.format(half=plate / 2, texture=TEXTURES / f"{texture}.png")
        self._model = mujoco.MjModel.from_xml_string(xml)
        self._data = mujoco.MjData(self._model)
        self._renderer = mujoco.Renderer(self._model, CAMERA.height, CAMERA.width)

    def render(self, pose_marker_in_camera: np.ndarray) -> np.ndarray:
        """Frame (480, 640, 3) uint8 with the marker at a pose (4, 4) in OpenCV's axes."""
        pose = OPENCV_IN_MUJOCO @ pose_marker_in_camera
        self._data.mocap_pos[0] = pose[:3, 3]
        self._data.mocap_quat[0] = Rotation.from_matrix(pose[:3, :3]).as_quat(scalar_first=True)
        mujoco.mj_forward(self._model, self._data)
        self._renderer.update_scene(self._data, "eye")
        return self._renderer.render()

    def close(self) -> None:
        """Free the GL context."""
        self._renderer.close()


def random_pose(rng: np.random.Generator) -> np.ndarray:
    """Pose (4, 4) of the hand's marker in `CAMERA`, its plate at least 2 px inside the frame.

    Distance (0.3 to 0.7 m), tilt from the line of sight (0 to 60 deg) and pixel are uniform.
    """
    half = PLATE / 2
    plate = np.array([[x, y, 0, 1] for x in (-half, half) for y in (-half, half)])
    last_px = np.array([CAMERA.width - 1, CAMERA.height - 1])
    while True:
        ray = np.linalg.solve(CAMERA.matrix, [*rng.uniform(0, last_px), 1.0])
        ray /= np.linalg.norm(ray)
        azimuth, roll = rng.uniform(0, 2 * np.pi, size=2)
        tilt = rng.uniform(0, np.pi / 3) * np.array([np.cos(azimuth), np.sin(azimuth), 0])
        facing = Rotation.align_vectors([-ray], [[0, 0, 1]])[0]
        turn = facing * Rotation.from_rotvec(tilt) * Rotation.from_rotvec([0, 0, roll])
        pose = np.eye(4)
        pose[:3, :3] = turn.as_matrix()
        pose[:3, 3] = rng.uniform(0.3, 0.7) * ray
        image = (CAMERA.matrix @ (pose @ plate.T)[:3]).T
        corners = image[:, :2] / image[:, 2:]
        if (corners >= 2).all() and (corners <= last_px - 2).all():
            return pose


def pose_error(pose: np.ndarray, true: np.ndarray) -> tuple[float, float]:
    """Distance [m] and angle [rad] between two poses (4, 4)."""
    turn = Rotation.from_matrix(pose[:3, :3].T @ true[:3, :3])
    return float(np.linalg.norm(pose[:3, 3] - true[:3, 3])), float(turn.magnitude())


def noisy(frame: np.ndarray, rng: np.random.Generator, sigma: float) -> np.ndarray:
    """The frame with independent normal noise of ``sigma`` grey levels in each value."""
    noise = rng.normal(0, sigma, frame.shape)
    return np.clip(np.rint(frame + noise), 0, 255).astype(np.uint8)

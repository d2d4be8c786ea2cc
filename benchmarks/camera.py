"""Frame rate of the head camera compared with MuJoCo's renderer, and errors of marker poses.

`kengoro_env.vision.rendering.Painter` and `mujoco.Renderer` with MuJoCo's default quality (shadows,
reflections, four samples per pixel) alternately draw the same robot from the same camera, at 640 x
480 pixels, in postures of the posture set. The hand's marker is detected in both pictures. Target:
ten times the frame rate at the same error of the marker's pose.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

from collections.abc import Callable
from copy import deepcopy
from time import perf_counter

import cv2
import gymnasium as gym
import mujoco
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from benchmarks.marker_pose import OPENCV_IN_MUJOCO, SIDE, Tally
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.marker_detector import MarkerDetector
from kengoro_env.departures.camera import EYE
from kengoro_env.env import KengoroEnv
from kengoro_env.postures import posture_set
from kengoro_env.robot.robot import Robot
from kengoro_env.vision.rendering import COARSE, HEIGHT, WIDTH, Image, Painter, open_renderer

IDS = ("Kengoro/Posture-v0", "Kengoro/CanGrasp-v0")

POSES, PER_POSE = 120, 2
"""Postures, and frames of each posture; the faster frame counts."""

DEFAULT_SAMPLES, DEFAULT_SHADOW = 4, 4096
"""MuJoCo's default samples per pixel, and size of its shadow maps [pixels]."""


class DefaultPainter:
    """`mujoco.Renderer` of a robot's model at MuJoCo's default quality."""

    def __init__(self, model: mujoco.MjModel) -> None:
        plain = deepcopy(model)
        plain.vis.quality.offsamples = DEFAULT_SAMPLES
        plain.vis.quality.shadowsize = DEFAULT_SHADOW
        self._renderer = mujoco.Renderer(plain, HEIGHT, WIDTH)

    def draw(self, data: mujoco.MjData, camera: str) -> Image:
        """Draw the view of a camera, shape (480, 640, 3) uint8."""
        self._renderer.update_scene(data, camera)
        return self._renderer.render()

    def close(self) -> None:
        """Free the GL context."""
        self._renderer.close()


def pose_marker_in_eye(robot: Robot) -> np.ndarray:
    """True pose of the hand's marker in the head camera, with OpenCV's axes, shape (4, 4)."""
    eye = robot.data.camera(EYE)
    pose_eye_in_world = np.eye(4)
    pose_eye_in_world[:3, :3], pose_eye_in_world[:3, 3] = eye.xmat.reshape(3, 3), eye.xpos
    in_mujoco = np.linalg.inv(pose_eye_in_world) @ robot.site_pose("marker_hand")
    return np.asarray(OPENCV_IN_MUJOCO @ in_mujoco)


def timed(draw: Callable[[], Image]) -> tuple[float, Image]:
    """Shortest time of `PER_POSE` calls [s], and the picture of the last one."""
    times = []
    for _ in range(PER_POSE):
        begin = perf_counter()
        frame = draw()
        times.append(perf_counter() - begin)
    return min(times), frame


def compare(env_id: str, poses: int) -> tuple[dict[str, Tally], dict[str, float]]:
    """Errors of marker poses, and frames per second, of each painter in one environment."""
    env = gym.make(env_id, camera=False).unwrapped
    assert isinstance(env, KengoroEnv)
    robot = env.robot
    open_renderer(robot.model).close()  # selects a GL library that works
    painters: dict[str, Painter | DefaultPainter] = {
        "Painter": Painter(robot.model, quality=COARSE),
        "mujoco.Renderer": DefaultPainter(robot.model),
    }
    fovy = np.radians(robot.model.camera(EYE).fovy[0])
    detector = MarkerDetector(Camera.from_fovy(WIDTH, HEIGHT, fovy), {0: SIDE})
    tallies = {name: Tally() for name in painters}
    seconds: dict[str, list[float]] = {name: [] for name in painters}
    rng = np.random.default_rng(0)
    order = rng.permutation(len(posture_set()))[:poses]
    console = Console(stderr=True)
    for posture in track(posture_set()[order], env_id, console=console):
        robot.reset(posture, rng)
        true = pose_marker_in_eye(robot)
        for name, painter in painters.items():
            shortest, frame = timed(lambda painter=painter: painter.draw(robot.data, EYE))  # type: ignore[misc]
            seconds[name].append(shortest)
            tallies[name].add(detector.detect(frame), true)
    for painter in painters.values():
        painter.close()
    return tallies, {name: 1.0 / float(np.median(times)) for name, times in seconds.items()}


def main(poses: int = POSES) -> None:
    """Print the table."""
    cv2.setNumThreads(1)
    table = Table(title=f"Head camera, {WIDTH} x {HEIGHT} px, hand's marker in {poses} postures")
    for column in ("environment", "painter", "frames/s", "ratio", "mm: median / 95 % / max"):
        table.add_column(
            column, justify="left" if column in ("environment", "painter") else "right"
        )
    table.add_column("deg: median / 95 % / max", justify="right")
    table.add_column("missed", justify="right")
    for env_id in IDS:
        tallies, rates = compare(env_id, poses)
        reference = rates["mujoco.Renderer"]
        for name, tally in tallies.items():
            mm, deg, missed, *_ = tally.row()
            rate = rates[name]
            table.add_row(env_id, name, f"{rate:.0f}", f"{rate / reference:.1f}", mm, deg, missed)
    Console(width=140).print(table)


if __name__ == "__main__":
    main()

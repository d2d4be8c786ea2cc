"""Make the pictures of README.md: the robot from its model, the result from a run's video.

    python docs/pictures/make_pictures.py                    # robot.png
    python docs/pictures/make_pictures.py out/can-grasping   # robot.png and result.png

``robot.png`` is rendered by MuJoCo. ``result.png`` puts three moments of ``episode.mp4`` side by
side, outside view above what the robot sees: the first approach just before the fingers close,
the hand before the eyes, the end.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import cv2
import gymnasium as gym
import imageio.v3 as imageio
import numpy as np
from numpy.typing import NDArray

import kengoro_env.names  # importing the package registers the environments and chooses GL

Image = NDArray[np.uint8]

FOLDER = Path(__file__).resolve().parent
POSTURE_DEG = {
    "neck_yaw": -15,
    "neck_pitch": 18,
    "sc_roll": -8,
    "sh_pitch": -40,
    "sh_roll": -20,
    "sh_yaw": 10,
    "elbow": 75,
}
"""Joint angles in robot.png; joints left out are at zero."""

WIDTH, HEIGHT = 1280, 860
TITLE = (slice(0, 40), slice(640, 970))
"""Where the video names the stage: its pixels change when the stage does."""

CLOSING = 26
"""Frames from the closing of the fingers to the end of an approach that missed (5.1 s)."""


def robot_picture() -> Image:
    """The drawing at the table (HEIGHT, WIDTH, 3)."""
    env: Any = gym.make("Kengoro/CanGrasp-v0", camera=False).unwrapped
    posture = [np.radians(POSTURE_DEG.get(joint, 0)) for joint in kengoro_env.names.JOINTS]
    env.reset(seed=0, options={"posture": posture, "can": (0.40, -0.15)})

    import mujoco  # after gym.make: the environment has found a GL library that draws

    model, data = env.robot.model, env.robot.data
    model.vis.quality.offsamples, model.vis.quality.shadowsize = 8, 4096
    camera = mujoco.MjvCamera()
    camera.lookat[:] = (0.14, -0.10, -0.05)
    camera.distance, camera.azimuth, camera.elevation = 1.15, 140.0, -14.0
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
        renderer.update_scene(data, camera)
        picture = renderer.render().copy()
    env.close()
    return picture


def stage_starts(frames: NDArray[np.uint8]) -> list[int]:
    """Numbers of the frames (K, 480, 1280, 3) at which a stage of the trial begins."""
    titles = frames[:, *TITLE].astype(float)
    changed = np.abs(np.diff(titles, axis=0)).mean(axis=(1, 2, 3)) > 3.0
    return [0, *(np.flatnonzero(changed) + 1).tolist()]


def result_picture(video: Path) -> Image:
    """Three moments of a run's video in columns (640, 1280, 3)."""
    frames = imageio.imread(video)
    starts = [*stage_starts(frames), len(frames)]
    moments = [starts[1] - CLOSING, (starts[1] + starts[2]) // 2, len(frames) - 1]
    columns = [np.vstack([frames[i][:, 640:], frames[i][:, :640]]) for i in moments]
    picture = cv2.resize(np.hstack(columns), (1280, 640), interpolation=cv2.INTER_AREA)
    return np.asarray(picture, dtype=np.uint8)


def main(arguments: list[str]) -> None:
    """Write robot.png, and result.png if the folder of a run is given."""
    imageio.imwrite(FOLDER / "robot.png", robot_picture())
    for run in arguments[:1]:
        imageio.imwrite(FOLDER / "result.png", result_picture(Path(run) / "episode.mp4"))


if __name__ == "__main__":
    main(sys.argv[1:])

"""A data set of two made-up robots, each with two short episodes."""

from __future__ import annotations

from pathlib import Path

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from kengoro.demonstrations.episode import Episode
from kengoro.demonstrations.frames import open_frames
from kengoro.demonstrations.lerobot import video_path, write_lerobot
from kengoro.demonstrations.minari import write_minari
from kengoro.demonstrations.robot_file import RobotEpisodes

MUSCLES = tuple(f"muscle_{i}" for i in range(36))
STEPS = (23, 20, 31, 7)
"""Control steps of each episode."""
FRAMES = (3, 2, 4, 1)
"""Frames of each episode: one for each begun period of ten steps."""


def made_episode(number: int) -> Episode:
    """An episode whose entries tell step and episode."""
    steps = STEPS[number]
    rng = np.random.default_rng(number)
    poses = np.tile(np.eye(4), (steps + 1, 1, 1))
    poses[:, 0, 3] = 0.01 * np.arange(steps + 1)
    lifted = np.arange(steps + 1) >= steps - 1
    return Episode(
        lengths=rng.uniform(-0.05, 0.05, (steps + 1, 36)),
        tensions=rng.uniform(0.0, 300.0, (steps + 1, 36)),
        frame_time=0.02 * np.arange(steps + 1.0)[:, None],
        actions=rng.uniform(-1, 1, (steps, 37)).astype(np.float32),
        rewards=np.arange(steps) / 100.0,
        terminations=np.zeros(steps, dtype=bool),
        can_pose=poses,
        grasped=lifted,
        rise=0.05 * lifted,
        success=lifted if number % 2 == 0 else np.zeros_like(lifted),
    )


def frame_of(number: int, row: int) -> np.ndarray:
    """A frame of one grey, which video keeps."""
    return np.full((480, 640, 3), 40 + 50 * number + 10 * row, dtype=np.uint8)


def made_robot(folder: Path, position: int) -> RobotEpisodes:
    """Episodes of a robot, and its video in the data set of the folder."""
    numbers = range(2 * position, 2 * position + 2)
    histograms = []
    with open_frames(video_path(folder, position)) as video:
        for number in numbers:
            for row in range(FRAMES[number]):
                video.add(frame_of(number, row))
            histograms.append(video.pop_histogram())
    return RobotEpisodes(5 + position, tuple(map(made_episode, numbers)), tuple(histograms))


def write_both(out: Path) -> None:
    """Both data sets, in the folders of `kengoro dataset`."""
    robots = [made_robot(out / "lerobot", position) for position in range(2)]
    write_lerobot(out / "lerobot", MUSCLES, robots)
    box = spaces.Box(-1.0, 1000.0, (36,), np.float64)
    observation = spaces.Dict(
        {
            "lengths": box,
            "tensions": box,
            "frame": spaces.Box(0, 255, (480, 640, 3), np.uint8),
            "frame_time": spaces.Box(0.0, 86_400.0, (1,), np.float64),
        }
    )
    assert gym.spec("Kengoro/CanGrasp-v0")
    write_minari(out / "minari", observation, spaces.Box(-1, 1, (37,), np.float32), robots)

"""The camera in the head exposes at its own rate; its frames arrive with a delay."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
import pytest

from kengoro_env.departures import FrameDelay
from kengoro_env.env import KengoroEnv
from kengoro_env.vision.head_camera import PERIOD, HeadCamera


class Painter:
    """Paints the time on every pixel, and counts."""

    def __init__(self) -> None:
        self.pictures = 0

    def draw(self, data: Any, camera: str, visible: mujoco.MjvOption) -> np.ndarray:
        assert camera == "eye"
        assert not visible.sitegroup.any()
        self.pictures += 1
        return np.full((480, 640, 3), round(data.time * 100), np.uint8)


class Clock:
    time = 0.0


@pytest.mark.parametrize("delay", [0.0, 0.1, 0.25, 0.5])
def test_newest_frame_that_has_come(delay: float) -> None:
    painter, clock = Painter(), Clock()
    camera = HeadCamera(painter, delay)  # type: ignore[arg-type]
    camera.reset(clock)  # type: ignore[arg-type]
    for step in range(1, 101):
        clock.time = 0.02 * step
        camera.update(clock)  # type: ignore[arg-type]
        time, frame = camera.newest()
        expected = max(0.0, PERIOD * np.floor((clock.time - delay + 1e-9) / PERIOD))
        assert time == pytest.approx(expected)
        assert np.all(frame == round(time * 100))
    assert painter.pictures == 1 + 2.0 / PERIOD


def test_a_frame_belongs_to_who_asked() -> None:
    camera = HeadCamera(Painter(), 0.0)  # type: ignore[arg-type]
    camera.reset(Clock())  # type: ignore[arg-type]
    camera.newest()[1][...] = 77
    assert np.all(camera.newest()[1] == 0)


def test_the_environments_frames_are_late_by_the_departures_delay() -> None:
    env = gym.make("Kengoro/Posture-v0", departures=(FrameDelay(0.1),), camera=True).unwrapped
    assert isinstance(env, KengoroEnv)
    observation, _ = env.reset(seed=0)
    action = env.lengths_to_action(env.robot.target)
    times = []
    for _ in range(20):
        observation, *_ = env.step(action)
        times.append(observation["frame_time"][0])
    env.close()
    # Exposed at 0.2 s, seen from 0.3 s on, which is after 15 steps.
    assert times[:14] == [0.0] * 14
    assert times[14:] == pytest.approx([0.2] * 6)

"""A lens distorts the head's frames as OpenCV defines it."""

from __future__ import annotations

from typing import Any

import cv2
import gymnasium as gym
import numpy as np
import pytest

from kengoro_env.departures import BoneError, FrameTimeError, LensDistortion, MarkerError
from kengoro_env.env import KengoroEnv
from kengoro_env.errors import ArgumentError
from kengoro_env.vision.lens import Lens, undistorted

LENSES = [(-0.2, 0.0, 0.0, 0.0, 0.0), (0.15, -0.05, 0.002, -0.003, 0.01)]


@pytest.mark.parametrize("coefficients", LENSES)
def test_rays_are_those_of_opencv(coefficients: tuple[float, ...]) -> None:
    rays = np.random.default_rng(0).uniform(-0.6, 0.6, (200, 2))
    corners = np.column_stack([rays, np.ones(len(rays))])
    nothing = np.zeros(3)
    seen, _ = cv2.projectPoints(corners, nothing, nothing, np.eye(3), np.array(coefficients))
    assert np.allclose(undistorted(seen[:, 0], coefficients), rays, atol=1e-7)


def frame(*departures: Any, **options: Any) -> tuple[np.ndarray, float]:
    """First frame of an episode, and the camera's focal length [px]."""
    env = gym.make("Kengoro/CanGrasp-v0", departures=departures, camera=True, **options)
    observation, _ = env.reset(seed=3)
    assert isinstance(env.unwrapped, KengoroEnv)
    fovy = float(env.unwrapped.robot.model.camera("eye").fovy[0])
    env.close()
    return observation["frame"], 240 / np.tan(np.radians(fovy) / 2)


def shift(picture: np.ndarray, ideal: np.ndarray) -> float:
    """Largest shift of a part of a picture [px], of parts with something to see."""
    found = []
    for row in range(80, 400, 80):
        for column in range(80, 560, 80):
            part = np.s_[row : row + 80, column : column + 80, 1]
            there, here = picture[part].astype(float), ideal[part].astype(float)
            if min(here.std(), there.std()) > 15.0:
                window = cv2.createHanningWindow((80, 80), cv2.CV_64F)
                (x, y), _ = cv2.phaseCorrelate(there, here, window)
                found.append(np.hypot(x, y))
    assert len(found) > 3
    return float(np.max(found))


@pytest.mark.parametrize("coefficients", LENSES)
def test_what_opencv_undistorts_is_the_ideal_frame(coefficients: tuple[float, ...]) -> None:
    ideal, focal = frame()
    bent, _ = frame(LensDistortion(*coefficients))
    matrix = np.array([[focal, 0, 319.5], [0, focal, 239.5], [0, 0, 1.0]])
    straight = cv2.undistort(bent, matrix, np.array(coefficients))
    shifts = {name: shift(picture, ideal) for name, picture in (("bent", bent), ("ours", straight))}
    assert shifts["bent"] > 1.0  # pixels
    assert shifts["ours"] < 0.25  # of two interpolations


def test_a_lens_that_folds_the_picture_is_refused() -> None:
    with pytest.raises(ArgumentError, match=r"LensDistortion.*corners have no ray"):
        Lens((-1.5, 0.0, 0.0, 0.0, 0.0), 45.0, 640, 480)


def test_the_marker_is_smaller_and_elsewhere() -> None:
    ideal, _ = frame()
    moved, _ = frame(MarkerError(size=0.05, position=0.01, rotation=0.1, seed=2))
    assert np.mean(np.abs(moved.astype(float) - ideal) > 20) > 0.001


@pytest.mark.parametrize("period", [0.02, 0.05])
def test_stamps_are_late_uneven_and_of_another_clock(period: float) -> None:
    stamps: dict[bool, list[float]] = {}
    for wrong in (False, True):
        error = FrameTimeError(offset=0.03, jitter=0.004, drift=0.01, seed=1)
        env = gym.make(
            "Kengoro/Posture-v0",
            departures=(error,) if wrong else (),
            camera=True,
            control_period=period,
        )
        observation, _ = env.reset(seed=0)
        stamps[wrong] = []
        for _ in range(round(4.0 / period)):
            observation = env.step(env.action_space.sample() * 0.0)[0]
            stamps[wrong].append(float(observation["frame_time"][0]))
        env.close()
    right, late = (np.unique(np.array(stamps[wrong])[-round(3.0 / period) :]) for wrong in (0, 1))
    error_of = late - 1.01 * right - 0.03
    assert len(right) == len(late)
    assert np.abs(error_of).max() < 2 * 0.004 + 1e-6
    assert error_of.std() > 0.002


def test_jitter_is_not_negative() -> None:
    with pytest.raises(ArgumentError, match=r"jitter is -1\.0 s"):
        FrameTimeError(jitter=-1.0)


@pytest.mark.parametrize(
    "build",
    [
        lambda: FrameTimeError(offset=np.nan),
        lambda: FrameTimeError(drift=-2.0),
        lambda: MarkerError(position=np.nan),
        lambda: MarkerError(size=-0.1),
        lambda: BoneError(rotation=np.inf),
        lambda: LensDistortion(k1=np.nan),
    ],
)
def test_numbers_that_are_none_are_refused(build: Any) -> None:
    with pytest.raises(ArgumentError, match=r"FrameTimeError|MarkerError|BoneError|LensDist"):
        build()

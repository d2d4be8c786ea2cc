"""Hand without a marker on simulated frames: each fault is found, and right poses cause none."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.guard import faults
from jmm_agent.guard.camera_monitor import CameraMonitorOptions, HandMonitor
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.hand_finder import HandMissed, HandSeen

ABSENT, UNCLEAR = HandMissed("absent", "not there"), HandMissed("unclear", "blurred")
DOUBLED, MIRRORED = HandMissed("doubled", "two"), HandMissed("mirrored", "a left hand")
DEVIATION = 0.004
COVARIANCE = np.diag([DEVIATION**2] * 3 + [3e-4] * 3)
FRAMES = ("hand", "eye")


def pose_at(x: float, y: float = 0.0, z: float = 0.5, turned: float = 0.0) -> np.ndarray:
    """Pose of a hand that shows its back or, turned by half a turn about y [rad], its palm."""
    c, s = np.cos(turned), np.sin(turned)
    pose = np.eye(4)
    pose[:3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    pose[:3, 3] = x, y, z
    return pose


def seen(x: float, y: float = 0.0, z: float = 0.5) -> HandSeen:
    return HandSeen(pose_at(x, y, z), FRAMES, COVARIANCE)


@pytest.fixture
def monitor() -> HandMonitor:
    return HandMonitor(Camera(640, 480, 580.0, 580.0, 319.5, 239.5), CameraMonitorOptions())


def found(monitor: HandMonitor) -> list[str]:
    return list(monitor.found("hand"))


def shown(pose: np.ndarray) -> bool:
    return True


@pytest.mark.parametrize("turned", [0.0, np.pi / 2, np.pi])
def test_a_hand_that_must_be_in_view_is_missed_from_any_side(
    monitor: HandMonitor, turned: float
) -> None:
    first = HandSeen(pose_at(0.0, turned=turned), FRAMES, COVARIANCE)
    monitor.update(0.0, first, pose_at(0.0, turned=turned), around=shown)
    for k in (1, 2):
        monitor.update(0.2 * k, ABSENT, pose_at(0.0, turned=turned), around=shown)
    assert found(monitor) == [faults.HAND_HIDDEN]


def test_a_hand_that_a_detector_does_not_expect_to_see_is_not_missed(monitor: HandMonitor) -> None:
    monitor.update(0.0, seen(0.0), pose_at(0.0), around=lambda pose: False)
    for k in (1, 2, 3):
        monitor.update(0.2 * k, ABSENT, pose_at(0.0), around=lambda pose: False)
    assert found(monitor) == []


def test_a_hand_that_is_there_without_a_clear_pose_is_not_hidden(monitor: HandMonitor) -> None:
    monitor.update(0.0, seen(0.0), pose_at(0.0), around=shown)
    for k in range(1, 6):
        monitor.update(0.2 * k, UNCLEAR, pose_at(0.0), around=shown)
    assert found(monitor) == []


@pytest.mark.parametrize(
    ("missed", "kind"), [(DOUBLED, faults.SECOND_HAND), (MIRRORED, faults.MIRRORED_HAND)]
)
def test_a_second_hand_and_a_mirrored_one_are_named_at_once(
    monitor: HandMonitor, missed: HandMissed, kind: str
) -> None:
    monitor.update(0.0, missed, None)
    assert found(monitor) == [kind]
    monitor.update(0.2, seen(0.0), pose_at(0.0), around=shown)
    assert found(monitor) == []


@pytest.mark.parametrize("trusted", [True, False])
def test_a_picture_of_a_hand_does_not_move_with_the_arm(
    monitor: HandMonitor, trusted: bool
) -> None:
    named = []
    for k, x in enumerate(np.arange(-0.15, 0.16, 0.01)):
        monitor.update(0.2 * k, seen(0.05, 0.02), pose_at(x), trusted, shown)
        named.append(found(monitor))
    assert named[0] == []
    assert named[-1] == [faults.OTHER_HAND]


@pytest.mark.parametrize("wrong", [0.0, 0.4])
def test_the_own_hand_moves_with_the_arm_although_its_map_is_wrong(
    monitor: HandMonitor, wrong: float
) -> None:
    """Errors of the poses are random, and a map that is not trusted turns all movements."""
    rng, c, s = np.random.default_rng(0), np.cos(wrong), np.sin(wrong)
    for k, phase in enumerate(np.arange(0.0, 60.0, 0.2)):
        x, y = 0.15 * np.sin(phase), 0.1 * np.sin(1.7 * phase)
        error = DEVIATION * rng.standard_normal(3)
        true = np.array([c * x - s * y, s * x + c * y, 0.5]) + error
        monitor.update(0.2 * k, seen(*true), pose_at(x, y), wrong == 0.0, shown)
        assert found(monitor) == []


def test_one_pose_that_is_far_off_is_named_and_the_next_is_believed(monitor: HandMonitor) -> None:
    for k in range(3):
        monitor.update(0.2 * k, seen(0.01 * k), pose_at(0.01 * k), True, shown)
    monitor.update(0.6, seen(0.13), pose_at(0.03), True, shown)
    assert found(monitor) == [faults.OTHER_HAND]
    monitor.update(0.8, seen(0.04), pose_at(0.04), True, shown)
    assert found(monitor) == []


def test_what_stays_elsewhere_for_long_is_believed(monitor: HandMonitor) -> None:
    monitor.update(0.0, seen(0.0), pose_at(0.0), True, shown)
    named = []
    for k in range(1, 100):
        monitor.update(0.2 * k, seen(0.2), pose_at(0.0), True, shown)
        named.append(found(monitor))
    longest = CameraMonitorOptions().longest / 0.2
    assert named.count([faults.OTHER_HAND]) == pytest.approx(longest, abs=1)
    assert named[-1] == []


def test_another_map_cannot_be_compared(monitor: HandMonitor) -> None:
    monitor.update(0.0, seen(0.0), pose_at(0.0), True, shown)
    monitor.forget_estimate()
    monitor.update(0.2, seen(0.0), pose_at(0.3), True, shown)
    assert found(monitor) == []

"""Errors of the camera: poses that a lens distorts are found again, and their derivatives."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats
from jmm_agent.vision.camera_unknowns import (
    CameraPrior,
    camera_columns,
    corrected,
    corrected_observations,
)
from jmm_agent.vision.marker_observation import MarkerObservation, ObservationWeights
from jmm_agent.vision.pose_errors import PoseErrors
from jmm_agent.vision.square_pose import solve_square, square_corners

FOCAL = 579.4
MATRIX = np.array([[FOCAL, 0.0, 319.5], [0.0, FOCAL, 239.5], [0.0, 0.0, 1.0]])


def poses(count: int, distance: float = 0.5) -> list[Floats]:
    """Poses of a marker all over the frame, tilted by 20 to 60 deg from facing the camera."""
    rng, found = np.random.default_rng(4), []
    for _ in range(count):
        pose, tilt = np.eye(4), rng.uniform(np.radians(20.0), np.radians(60.0))
        side = rng.uniform(0.0, 2.0 * np.pi)
        tilted = cv2.Rodrigues(tilt * np.array([np.cos(side), np.sin(side), 0.0]))[0]
        turned = cv2.Rodrigues(np.array([0.0, 0.0, rng.uniform(-3.0, 3.0)]))[0]
        pose[:3, :3] = tilted @ np.diag([1.0, -1.0, -1.0]) @ turned
        depth = distance * rng.uniform(0.7, 1.4)
        pose[:3, 3] = depth * np.array([*rng.uniform(-1.0, 1.0, 2) * (0.45, 0.33), 1.0])
        found.append(pose)
    return found


def shown(pose: Floats, side: float, focal: float, k1: float) -> Floats:
    """Pose of a marker that a camera with other optics shows to an agent."""
    square, matrix = square_corners(side), MATRIX.copy()
    matrix[0, 0] = matrix[1, 1] = FOCAL * (1.0 + focal)
    lens = np.array([k1, 0.0, 0.0, 0.0])
    turn = cv2.Rodrigues(pose[:3, :3])[0]
    corners = cv2.projectPoints(square, turn, pose[:3, 3], matrix, lens)[0].reshape(4, 2)
    found = solve_square(square, corners, MATRIX, pose)
    assert found is not None
    return found.pose


def apart(one: Floats, other: Floats) -> tuple[float, float]:
    """Distance [m] and angle [rad] between poses."""
    turn = cv2.Rodrigues(one[:3, :3].T @ other[:3, :3])[0]
    return float(np.linalg.norm(one[:3, 3] - other[:3, 3])), float(np.linalg.norm(turn))


@pytest.mark.parametrize(
    ("side", "distance", "focal", "k1"),
    [(0.05, 0.5, 0.0, -0.2), (0.05, 0.5, 0.02, 0.1), (0.01, 0.15, -0.01, -0.3)],
)
def test_poses_are_found_again(side: float, distance: float, focal: float, k1: float) -> None:
    unknowns = np.array([0.0] * 6 + [focal, k1])
    before, after = [], []
    for pose in poses(40, distance):
        seen = shown(pose, side, focal, k1)
        before.append(apart(seen, pose))
        after.append(apart(corrected(seen, unknowns), pose))
    was, now = np.percentile(before, 90, axis=0), np.percentile(after, 90, axis=0)
    assert was[0] > 0.01 * distance
    assert now[0] < 0.05 * was[0]
    assert now[1] < 0.06 * was[1]


def test_a_camera_that_is_mounted_otherwise_is_undone() -> None:
    unknowns = np.array([0.01, -0.02, 0.005, 0.02, 0.01, -0.03, 0.0, 0.0])
    mounted = np.eye(4)
    mounted[:3, :3], mounted[:3, 3] = cv2.Rodrigues(unknowns[3:6])[0], unknowns[:3]
    [pose] = poses(1)
    np.testing.assert_allclose(corrected(np.linalg.inv(mounted) @ pose, unknowns), pose, atol=1e-12)


def test_columns_are_the_derivatives_of_the_corrected_pose() -> None:
    unknowns = np.array([0.002, -0.001, 0.003, 1e-3, -2e-3, 1e-3, 0.01, -0.12])
    for pose in poses(10):
        here, found = corrected(pose, unknowns), camera_columns(pose, unknowns)
        for number, step in enumerate(1e-3 * np.eye(8)):
            ends = [corrected(pose, unknowns + sign * step) for sign in (1.0, -1.0)]
            moved = here[:3, :3].T @ (ends[0][:3, 3] - ends[1][:3, 3]) / 2e-3
            turned = cv2.Rodrigues(ends[1][:3, :3].T @ ends[0][:3, :3])[0].ravel() / 2e-3
            # Rotation vectors are added, which is right to first order.
            np.testing.assert_allclose(found[:3, number], moved, atol=3e-3)
            np.testing.assert_allclose(found[3:, number], turned, atol=1e-2)


def test_poses_of_other_frames_stay() -> None:
    pose, none = poses(1)[0], np.zeros(3)
    other = MarkerObservation(pose, none, none, ("grip", None))
    own = MarkerObservation(pose, none, none)
    lens = np.array([0.0] * 7 + [-0.2])
    left, moved = corrected_observations([other, own], lens, "eye")
    assert left.pose is pose
    assert apart(moved.pose, pose)[0] > 1e-3
    assert corrected_observations([own], None, "eye")[0].pose is pose


def test_poses_of_other_parts_in_the_camera_are_corrected_too() -> None:
    """Such as those of a hand that is seen without a marker."""
    pose, none = poses(1)[0], np.zeros(3)
    hand = MarkerObservation(pose, none, none, ("hand", "eye"))
    unknowns = np.array([0.003, 0.0, 0.0, 0.0, 0.01, 0.0, 0.004, -0.1])
    [moved] = corrected_observations([hand], unknowns, "eye")
    np.testing.assert_array_equal(moved.pose, corrected(pose, unknowns, solid=True))
    for camera in ("other", None):
        [stays] = corrected_observations([hand], unknowns, camera)
        assert stays.pose is pose


def tumbled(count: int) -> list[Floats]:
    """Poses all over the frame, turned by any angle: some show their x-y plane from its edge."""
    rng, found = np.random.default_rng(5), poses(count)
    for pose in found:
        pose[:3, :3] = cv2.Rodrigues(rng.uniform(-2.0, 2.0, 3))[0]
    edge = found[0]
    toward = edge[:3, 3] / np.linalg.norm(edge[:3, 3])
    across = np.cross(toward, [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    edge[:3, :3] = np.column_stack([toward, across, np.cross(toward, across)])
    return found


def seen_solid(pose: Floats, focal: float, k1: float) -> Floats:
    """Pose of a cloud of points that a camera with other optics shows to an agent (OpenCV)."""
    points = 0.05 * np.random.default_rng(6).uniform(-1.0, 1.0, (30, 3))
    matrix = MATRIX.copy()
    matrix[0, 0] = matrix[1, 1] = FOCAL * (1.0 + focal)
    turn, lens = cv2.Rodrigues(pose[:3, :3])[0], np.array([k1, 0.0, 0.0, 0.0])
    pixels = cv2.projectPoints(points, turn, pose[:3, 3], matrix, lens)[0]
    start = turn.copy(), pose[:3, 3:].copy()
    _, turn, position = cv2.solvePnP(points, pixels, MATRIX, None, *start, useExtrinsicGuess=True)
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = cv2.Rodrigues(turn)[0], position.ravel()
    return found


@pytest.mark.parametrize(("focal", "k1"), [(0.0, -0.2), (0.02, 0.1), (-0.01, -0.3)])
def test_poses_of_solid_bodies_are_found_again_from_any_side(focal: float, k1: float) -> None:
    unknowns = np.array([0.0] * 6 + [focal, k1])
    before, after = [], []
    for pose in tumbled(40):
        seen = seen_solid(pose, focal, k1)
        before.append(apart(seen, pose))
        after.append(apart(corrected(seen, unknowns, solid=True), pose))
    was, now = np.median(before, axis=0), np.median(after, axis=0)
    assert was[0] > 0.02
    assert now[0] < 0.2 * was[0]  # a cube is no cloud of points
    assert now[1] < was[1]
    assert np.max(after, axis=0)[0] < 0.3 * np.max(before, axis=0)[0]


def test_columns_of_solid_bodies_are_derivatives_of_their_poses() -> None:
    unknowns = np.array([0.004, -0.002, 0.003, 0.01, -0.008, 0.006, 0.005, -0.05])
    for pose in tumbled(5):
        here, found = corrected(pose, unknowns, True), camera_columns(pose, unknowns, True)
        for number in range(8):
            step = 1e-4 * np.eye(8)[number]
            ends = [corrected(pose, unknowns + sign * step, True) for sign in (1.0, -1.0)]
            moved = here[:3, :3].T @ (ends[0][:3, 3] - ends[1][:3, 3]) / 2e-4
            change = Rotation.from_matrix(ends[1][:3, :3].T @ ends[0][:3, :3])
            turned = change.as_rotvec() / 2e-4
            missed = np.linalg.norm(found[:3, number] - moved)
            assert missed < 0.05 * np.linalg.norm(moved) + 1e-3
            np.testing.assert_allclose(found[3:, number], turned, atol=2e-2)


def test_a_prior_has_no_negative_widths() -> None:
    with pytest.raises(AgentError, match="at least 0"):
        CameraPrior(lens=-0.1)
    assert not CameraPrior(0.0, 0.0, 0.0, 0.0).enabled


@pytest.mark.parametrize("lens", [-0.15, -0.25, -0.4, -1.0])
@pytest.mark.parametrize("solid", [False, True])
def test_no_lens_folds_the_view(lens: float, solid: bool) -> None:
    """At the border of a wide view a polynomial of the slope would turn back, and no pose fit."""
    unknowns = np.array([0.0] * 7 + [lens])
    slopes = []
    for pose in poses(1) * 40:
        turned, aside = pose.copy(), len(slopes) / 40.0
        turned[:3, 3] = 0.6 * np.array([aside, 0.3 * aside, 1.0])
        straight = corrected(turned, unknowns, solid)
        assert 0.3 < straight[2, 3] < 1.0
        assert np.abs(camera_columns(turned, unknowns, solid)).max() < 60.0
        slopes.append(float(straight[0, 3] / straight[2, 3]))
    assert np.all(np.diff(slopes) > 0.0)


@pytest.mark.parametrize("depth", [-0.5, 0.0, 0.02])
@pytest.mark.parametrize("solid", [False, True])
def test_a_pose_that_no_camera_shows_is_not_straightened(depth: float, solid: bool) -> None:
    """Such as one that a user observed in other axes, or a body that reaches behind the camera."""
    pose = np.eye(4)
    pose[:3, 3] = 0.3, 0.1, depth
    unknowns = np.array([0.0] * 6 + [0.01, -0.1])
    found = corrected(pose, unknowns, solid)
    assert np.isfinite(found).all()
    assert np.linalg.norm(found[:3, 3] - pose[:3, 3]) < 0.1
    if depth < 0.0:
        np.testing.assert_array_equal(found, pose)


@pytest.mark.parametrize("position", [(0.0, 0.0, 0.0), (0.3, 0.1, 0.0), (0.3, 0.1, -0.5)])
@pytest.mark.parametrize("solid", [False, True])
def test_a_pose_that_no_camera_shows_is_moved_by_the_mounting_alone(
    position: tuple[float, float, float], solid: bool
) -> None:
    pose = np.eye(4)
    pose[:3, 3] = position
    columns = camera_columns(pose, np.zeros(8), solid)
    assert np.isfinite(columns).all()
    np.testing.assert_array_equal(columns[:, 6:], 0.0)
    np.testing.assert_array_equal(columns[:3, :3], np.eye(3))


def test_hands_at_the_border_of_the_view_leave_the_fit_solvable() -> None:
    """The pose, and the believed lens, at which learning from a robot's hand ended."""
    turn, offset = poses(1)[0], np.array([0.409, -0.164, 0.587])
    turn[:3, 3] = offset
    hand = MarkerObservation(turn, np.zeros(3), np.zeros(3), ("hand", "eye"))
    camera = np.array([0.0, 0.001, 0.0, -0.003, -0.001, 0.002, 0.0, -0.235])
    weights = ObservationWeights([hand], 0.005, 0.01, 0.01)
    errors = PoseErrors([hand], CameraPrior(), camera, np.zeros((1, 6, 0)), weights, "eye")
    left, cost = errors.remaining(np.full((1, 6), 0.01))
    assert np.all(np.abs(left) < 0.1)
    assert np.isfinite(cost)

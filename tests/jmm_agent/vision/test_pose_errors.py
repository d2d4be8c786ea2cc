"""Errors that all poses share: integrated out as a dense covariance, and found from poses."""

from __future__ import annotations

from pathlib import Path

import cv2
import mujoco
import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.types import Floats
from jmm_agent.vision.camera_unknowns import CameraPrior, corrected_observations
from jmm_agent.vision.marker_observation import MarkerObservation, ObservationWeights
from jmm_agent.vision.marker_residual import MarkerResidual
from jmm_agent.vision.pose_errors import JointPrior, PoseErrors, joint_columns
from tests.jmm_agent.nominal_arm import ARM, JOINTS
from tests.jmm_agent.vision.test_camera_unknowns import shown

EYE, MARKER = "eye", "marker_hand"
NONE = np.zeros(3)
JOINTS_OFF = JointPrior(0.003, 0.035)


def seen_postures(arm: ArmKinematics, count: int) -> list[Floats]:
    """Postures at which the marker is in front of the camera."""
    rng, found = np.random.default_rng(2), []
    low, high = arm.limits.T
    while len(found) < count:
        q = rng.uniform(0.6 * low, 0.6 * high)
        x, y, z = arm.pose(MARKER, q, EYE)[:3, 3]
        away = arm.pose(MARKER, q, EYE)[2, 2]
        if z > 0.25 and abs(x) < 0.5 * z and abs(y) < 0.38 * z and away < -0.4:
            found.append(q)
    return found


def test_errors_are_integrated_out_as_a_dense_covariance(arm: ArmKinematics) -> None:
    residual, angles = MarkerResidual(arm, EYE, MARKER), seen_postures(arm, 3)
    observations = [MarkerObservation(arm.pose(MARKER, q, EYE), NONE, q) for q in angles]
    weights, prior = ObservationWeights(observations, 0.003, 0.01, 0.005), CameraPrior()
    joints = joint_columns(observations, np.array(angles), residual, JOINTS_OFF)
    assert joints.shape == (3, 6, 84)
    camera = np.array([0.003, 0.0, -0.002, 0.004, 0.0, 0.0, 0.0, 0.05])
    errors = PoseErrors(observations, prior, camera, joints, weights)
    missed = 0.004 * np.random.default_rng(1).standard_normal((3, 6))
    left, own = errors.remaining(missed)
    columns = errors._columns.reshape(18, -1)
    mean = columns @ -np.append(camera / prior.widths, np.zeros(84))
    dense = np.diag(np.tile(np.repeat([0.003**2, 0.01**2], 3), 3)) + columns @ columns.T
    away = missed.ravel() - mean
    expected = away @ np.linalg.solve(dense, away)
    assert weights.cost(np.array(angles), left) + own == pytest.approx(expected, rel=1e-9)
    slopes = [residual(q, found.pose)[1] for q, found in zip(angles, observations, strict=True)]
    block = np.zeros((18, 42))
    for k, slope in enumerate(slopes):
        block[6 * k : 6 * k + 6, 14 * k : 14 * k + 14] = slope
    plain = np.tile(np.repeat([0.003**-2, 0.01**-2], 3), 3)[:, None] * block
    np.testing.assert_allclose(
        block.T @ plain - errors.taken(slopes), block.T @ np.linalg.solve(dense, block), atol=1e-4
    )
    assert errors.log_det == pytest.approx(
        np.linalg.slogdet(dense)[1] - 18 * np.log(0.003 * 0.01), rel=1e-6
    )


@pytest.mark.parametrize(("k1", "focal"), [(-0.2, 0.0), (0.12, -0.01), (0.0, 0.0)])
def test_the_lens_is_found_from_poses_at_known_postures(
    arm: ArmKinematics, k1: float, focal: float
) -> None:
    """The estimate is repeated about the one before, as in a fit."""
    residual, angles = MarkerResidual(arm, EYE, MARKER), seen_postures(arm, 25)
    poses = [shown(arm.pose(MARKER, q, EYE), 0.05, focal, k1) for q in angles]
    observations = [MarkerObservation(pose, NONE, NONE) for pose in poses]
    weights = ObservationWeights(observations, 0.003, 0.01, 0.005)
    camera, none = np.zeros(8), np.zeros((len(angles), 6, 0))
    for _ in range(5):
        errors = PoseErrors(observations, CameraPrior(), camera, none, weights)
        pairs = zip(angles, corrected_observations(observations, camera, None), strict=True)
        missed = [residual(q, found.pose)[0] for q, found in pairs]
        camera = errors.camera(np.array(missed))
    assert camera[7] == pytest.approx(k1, abs=0.02)
    assert camera[6] == pytest.approx(focal, abs=0.004)
    assert np.abs(camera[:6]).max() < 0.004


def test_columns_of_joints_are_those_of_a_model_with_other_joints(
    arm: ArmKinematics, tmp_path: Path
) -> None:
    """Joints of the MJCF file are moved, and their axes turned."""
    residual, q = MarkerResidual(arm, EYE, MARKER), seen_postures(arm, 1)[0]
    pose = arm.pose(MARKER, q, EYE)
    for name in ("neck_yaw", "elbow", "sh_roll"):
        if name not in JOINTS:
            continue
        spec = mujoco.MjSpec.from_file(str(ARM))
        joint = spec.joint(name)
        axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
        across = np.cross(axis, [0.3, -0.5, 0.8])
        across *= 1e-3 / np.linalg.norm(across)
        joint.axis = axis + across
        spec.compile()
        path = tmp_path / f"{name}.xml"
        path.write_text(spec.to_xml())
        other = ArmKinematics(path, JOINTS).pose(MARKER, q, EYE)
        turn = cv2.Rodrigues(pose[:3, :3].T @ other[:3, :3])[0].ravel()
        moved = np.concatenate([pose[:3, :3].T @ (other[:3, 3] - pose[:3, 3]), turn])
        columns = residual.misplaced(q)[:, JOINTS.index(name), 3:]
        fitted = columns @ np.linalg.lstsq(columns, moved, rcond=None)[0]
        assert np.linalg.norm(moved) > 1e-5
        np.testing.assert_allclose(fitted, moved, atol=0.02 * np.linalg.norm(moved))
        turned = np.linalg.norm(np.linalg.lstsq(columns, moved, rcond=None)[0])
        assert turned == pytest.approx(1e-3, rel=0.02)


def test_joints_are_right_where_nothing_is_known_of_their_errors() -> None:
    found = [MarkerObservation(np.eye(4), NONE, NONE)]
    assert joint_columns(found, np.zeros((1, 3)), object(), JOINTS_OFF).shape == (1, 6, 0)
    with pytest.raises(AgentError, match="turn"):
        JointPrior(turn=np.nan)

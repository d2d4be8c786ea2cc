"""Measured angles of some joints, beside the muscle lengths."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.kalman_filter import JointEstimator
from jmm_agent.kalman_filter_options import EstimatorError, EstimatorOptions
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from tests.jmm_agent.moving_arm import MovingArm
from tests.jmm_agent.nominal_arm import JOINTS, posture_set
from tests.jmm_agent.test_updaters import MIDDLE, UpdaterTrial

POSTURES = posture_set()[1:7]
ELBOW = JOINTS.index("elbow")
BOX = np.tile([-3.0, 3.0], (3, 1))
ARMS = np.random.default_rng(4).normal(0, 5e-3, (6, 3))
ARMS[:, 2] *= 1e-2  # a joint that the muscles hardly show


class Linear:
    def lengths_and_jacobian(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return ARMS @ q, ARMS


class EncodedArm(MovingArm):
    """A moving arm with encoders on elbow and wrist."""

    offset = 0.0

    def readings(self, **more: Any) -> Any:
        angles = np.full(14, np.nan)
        for joint in ("elbow", "wrist_flex"):
            number = JOINTS.index(joint)
            angles[number] = self.q[number] + self.rng.normal(0, 1e-3)
        angles[ELBOW] += self.offset
        return super().readings(joint_angles=angles, **more)


def test_on_a_linear_map_it_is_the_exact_posterior() -> None:
    """Lengths and angles, each with its own noise, are used once each."""
    rng = np.random.default_rng(0)
    options = EstimatorOptions(
        encoder_noise=1e-3, motion_noise=0.3, process_noise=1e-9, joint_noise=0.02
    )
    estimator = JointEstimator(Linear(), BOX, options)
    q, covariance = np.zeros(3), 0.5**2 * np.eye(3)
    true, measured = np.array([0.2, -0.1, 0.3]), np.array([np.nan, -0.09, 0.31])
    rows = np.vstack([ARMS / 1e-3, np.eye(3)[1:] / 0.02])
    for _ in range(20):
        lengths = ARMS @ true + rng.normal(0, 1e-3, 6)
        found = estimator.update(lengths, 0.02, measured)
        covariance = covariance + 0.3**2 * 0.02 * np.eye(3)
        information = np.linalg.inv(covariance) + rows.T @ rows
        pull = np.linalg.solve(covariance, q) + rows.T @ np.r_[lengths / 1e-3, measured[1:] / 0.02]
        q, covariance = np.linalg.solve(information, pull), np.linalg.inv(information)
        np.testing.assert_allclose(found.q, q, atol=1e-6)
        np.testing.assert_allclose(found.covariance, covariance, rtol=1e-4, atol=1e-12)


def test_without_measured_angles_it_is_the_same_to_the_bit(nominal_map: JointMuscleMap) -> None:
    limits = np.tile([-2.0, 2.0], (14, 1))
    one, other = (JointEstimator(nominal_map, limits, q=POSTURES[0]) for _ in range(2))
    rng = np.random.default_rng(0)
    for _ in range(5):
        lengths = nominal_map.lengths(POSTURES[1]) + rng.normal(0, 1e-3, 36)
        one.update(lengths, 0.02)
        other.update(lengths, 0.02, np.full(14, np.nan))
    assert one.q.tobytes() == other.q.tobytes()
    assert one.covariance.tobytes() == other.covariance.tobytes()


def test_encoders_of_two_joints_improve_the_estimate_and_what_is_learned(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    seen, encoded = MovingArm(nominal_map, arm), EncodedArm(nominal_map, arm)
    for trial in (seen, encoded):
        trial.visit(POSTURES[0])
    before = np.degrees(np.abs(seen.agent.joint_angles - seen.q)[ELBOW])
    after = np.degrees(np.abs(encoded.agent.joint_angles - encoded.q)[ELBOW])
    assert after < 0.3
    assert before > 2.0 * after
    for trial in (seen, encoded):
        trial.visit(*POSTURES[1:4])
    observations = encoded.agent.vision.memory
    for angles, q in zip(observations.angles, POSTURES, strict=False):
        np.testing.assert_allclose(angles[ELBOW], q[ELBOW], atol=0.01)
    assert encoded.error < seen.error


def test_an_encoder_with_a_wrong_zero_is_named(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    """5 deg off while the map is right."""
    limits = arm.limits
    estimator = JointEstimator(nominal_map, limits, q=POSTURES[0])
    angles = np.full(14, np.nan)
    angles[ELBOW] = POSTURES[0][ELBOW] + np.radians(5.0)
    lengths = nominal_map.lengths(POSTURES[0])
    for _ in range(60):
        estimator.update(lengths, 0.02, angles)
    encoders = estimator.joint_encoders
    assert np.flatnonzero(encoders.contradicted).tolist() == [ELBOW]
    np.testing.assert_allclose(np.degrees(encoders.differences[ELBOW]), 5.0, atol=1.0)
    angles[ELBOW] = POSTURES[0][ELBOW]
    for _ in range(60):
        estimator.update(lengths, 0.02, angles)
    assert not encoders.contradicted.any()


def test_an_agent_names_the_joint_and_an_encoder_in_degrees_is_not_used(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = EncodedArm(nominal_map, arm)
    trial.offset = 57.0
    trial.visit(POSTURES[0], POSTURES[0])
    assert list(trial.agent.contradicted_joints) == ["elbow"]
    assert trial.agent.contradicted_joints["elbow"] == pytest.approx(57.0, abs=0.5)
    assert trial.agent.vision.fired == 1


@pytest.mark.parametrize("fit", ["together", "alone"])
def test_an_encoder_that_contradicts_the_hands_pose_is_named(fit: str) -> None:
    """The marker of this small map shows each joint."""
    trial = UpdaterTrial(fit=fit)
    angles = np.full(4, np.nan)
    angles[2] = MIDDLE[2] + 0.1
    trial.observe(MIDDLE, joint_angles=angles)
    reason = f"the joint encoder of {trial.start.joints[2]} contradicts the hand's pose"
    assert trial.vision.dropped == {reason: 1}
    angles[2] = MIDDLE[2]
    assert trial.observe(MIDDLE, joint_angles=angles).learned


@pytest.mark.parametrize("angles", [np.zeros(3), np.full(14, np.inf), "none", np.zeros((14, 1))])
def test_wrong_joint_angles_are_refused_and_nothing_is_changed(
    nominal_map: JointMuscleMap, arm: ArmKinematics, angles: Any
) -> None:
    trial = MovingArm(nominal_map, arm)
    trial.step(trial.q)
    before = trial.agent.joint_angles
    with pytest.raises(EstimatorError, match="joint angles must be"):
        trial.step(trial.q, joint_angles=angles)
    np.testing.assert_array_equal(trial.agent.joint_angles, before)
    trial.step(trial.q)


def test_a_joint_noise_that_is_not_positive_is_refused() -> None:
    with pytest.raises(AgentError, match="joint_noise is 0"):
        EstimatorOptions(joint_noise=0.0)

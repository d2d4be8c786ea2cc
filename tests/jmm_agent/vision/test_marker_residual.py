"""Residual of the marker's pose, and its Jacobian, for any site and any camera."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.vision.marker_residual import MarkerResidual
from tests.jmm_agent.nominal_arm import posture_set

SITES = ("marker_hand", "grip")


@pytest.mark.parametrize("site", SITES)
def test_the_jacobian_is_the_derivative_of_the_error(arm: ArmKinematics, site: str) -> None:
    residual = MarkerResidual(arm, "eye", site)
    rng = np.random.default_rng(0)
    for q in posture_set()[:4]:
        seen = arm.pose(site, q + rng.normal(0.0, 0.2, 14), relative_to="eye")
        numeric = [
            (residual(q + 1e-6 * axis, seen)[0] - residual(q - 1e-6 * axis, seen)[0]) / 2e-6
            for axis in np.eye(14)
        ]
        error, jacobian = residual(q, seen)
        assert np.linalg.norm(error) > 0.01
        np.testing.assert_allclose(jacobian, np.transpose(numeric), atol=2e-8)


def test_the_error_is_offset_and_turn_in_the_seen_markers_axes(arm: ArmKinematics) -> None:
    residual = MarkerResidual(arm, "eye", "marker_hand")
    q = posture_set()[0]
    here = arm.pose("marker_hand", q, relative_to="eye")
    np.testing.assert_allclose(residual(q, here)[0], np.zeros(6), atol=1e-12)
    offset, turn = np.array([0.01, -0.02, 0.03]), np.array([0.1, 0.2, -0.15])
    away = np.eye(4)
    away[:3, :3], away[:3, 3] = pin.exp3(turn), offset
    # Expected pose = seen pose, moved by `away` in the seen marker's axes.
    seen = here @ np.linalg.inv(away)
    np.testing.assert_allclose(residual(q, seen)[0], [*offset, *turn], atol=1e-12)


def test_unknown_frames_are_named(arm: ArmKinematics) -> None:
    for camera, site in (("eye", "marker_foot"), ("third_eye", "marker_hand")):
        with pytest.raises(AgentError, match=r"marker_foot|third_eye"):
            MarkerResidual(arm, camera, site)

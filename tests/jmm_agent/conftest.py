"""Rendering without a display, chosen before MuJoCo is imported; fixtures of Kengoro's arm."""

from __future__ import annotations

import os
import sys
from ctypes.util import find_library

if sys.platform == "linux" and "DISPLAY" not in os.environ:
    os.environ.setdefault("MUJOCO_GL", "egl" if find_library("EGL") else "osmesa")

import pytest

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from tests.jmm_agent.nominal_arm import ARM, JOINTS, trained_map


@pytest.fixture(scope="session")
def arm() -> ArmKinematics:
    """Kinematics of Kengoro's arm."""
    return ArmKinematics(ARM, JOINTS)


@pytest.fixture(scope="session")
def nominal_map(request: pytest.FixtureRequest) -> JointMuscleMap:
    """The nominal map of Kengoro's arm."""
    return trained_map(request)

"""True moment arms of a robot."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.robots.robot_arms import RobotArms
from jmm_agent.types import Floats
from kengoro.trained_maps import ARM
from kengoro_env.assets import asset_path
from kengoro_env.departures import actual
from kengoro_env.robot.nominal_model import NominalArm
from kengoro_env.robot.robot import Robot


@pytest.mark.parametrize("seed", [None, 3])
def test_moment_arms_of_a_robot_are_slopes_of_its_paths(seed: int | None) -> None:
    robot = Robot(asset_path(ARM), () if seed is None else actual(seed))
    arms = RobotArms(robot)
    rng = np.random.default_rng(0)

    def paths(posture: Floats) -> Floats:
        robot.reset(posture, np.random.default_rng(0))
        return robot.motors.paths()

    for _ in range(3):
        posture = robot.lower + (robot.upper - robot.lower) * rng.uniform(
            0.1, 0.9, len(robot.lower)
        )
        found = arms.jacobian(posture)
        for joint, moved in enumerate(1e-5 * np.eye(len(posture))):
            slopes = (paths(posture + moved) - paths(posture - moved)) / 2e-5
            np.testing.assert_allclose(found[:, joint], slopes, atol=1e-6)


def test_a_robot_without_departures_has_the_moment_arms_of_the_nominal_model() -> None:
    scene = asset_path(ARM)
    posture = np.random.default_rng(1).uniform(-0.2, 0.2, 14)
    np.testing.assert_allclose(
        RobotArms(Robot(scene)).jacobian(posture),
        NominalArm(scene).moment_arms(posture),
        atol=1e-12,
    )

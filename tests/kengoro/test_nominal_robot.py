"""Nominal model of a robot: its kinematics, camera, motors and statics are those of its file."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from jmm_agent import AgentOptions, MotorControl
from kengoro.nominal_robot import NominalRobot
from kengoro.robots import CAMERA, arm_scene

SCENE = """<mujoco><compiler autolimits="true" angle="degree" eulerseq="zyx"/>
<default><joint axis="0 1 0" range="-40 60"/></default>
<worldbody>
  <site name="s0" pos="-0.05 0 -0.02"/><site name="s1" pos="-0.05 0 0.02"/>
  <body name="base" pos="0.1 0 0.2" euler="20 30 -40">
    <camera name="eye" pos="0 -1 0.1" euler="0 0 80" fovy="50" resolution="800 600"/>
    <site name="r0" pos="-0.04 0.01 0.03"/>
    <body name="link" pos="0.02 0 0">
      <joint name="shifted" pos="0.01 0.02 0.03" ref="15"/>
      <geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.01" mass="0.2"/>
      <site name="t0" pos="0.05 0 -0.02"/><site name="t1" pos="0.05 0 0.02"/>
      <body pos="0.2 0 0" euler="0 0 15">
        <joint name="slide" type="slide" axis="1 0 1" range="-0.02 0.03"/>
        <geom size="0.02" mass="0.1"/>
        <site name="marker_hand" pos="0.01 0.02 0.03" euler="10 20 30"/>
      </body>
    </body>
  </body>
</worldbody>
<tendon>
  <spatial name="low"><site site="r0"/><site site="t0"/><site site="marker_hand"/></spatial>
  <spatial name="up"><site site="s1"/><site site="t1"/><site site="marker_hand"/></spatial>
</tendon></mujoco>"""


@pytest.fixture
def robot(tmp_path: Path) -> NominalRobot:
    path = tmp_path / "robot.xml"
    path.write_text(SCENE)
    return NominalRobot(path)


def test_poses_of_frames_are_those_of_mujoco(robot: NominalRobot) -> None:
    model, joints = robot.arm.model, robot.arm.joints
    assert set(joints) == {"shifted", "slide"}
    kinematics, data = robot.kinematics(joints, AgentOptions()), mujoco.MjData(model)
    for q in np.random.default_rng(0).uniform(robot.arm.lower, robot.arm.upper, (5, 2)):
        for joint, angle in zip(joints, q, strict=True):
            data.joint(joint).qpos[0] = angle
        mujoco.mj_kinematics(model, data)
        mujoco.mj_camlight(model, data)
        site, camera = data.site("marker_hand"), data.cam("eye")
        turned = camera.xmat.reshape(3, 3)
        pose = kinematics.pose("marker_hand", q)
        np.testing.assert_allclose(pose[:3, 3], site.xpos, atol=1e-12)
        np.testing.assert_allclose(pose[:3, :3], site.xmat.reshape(3, 3), atol=1e-12)
        seen = kinematics.pose("marker_hand", q, relative_to="eye")[:3, 3]
        distance = np.linalg.norm(turned.T @ (site.xpos - camera.xpos))
        assert np.linalg.norm(seen) == pytest.approx(distance)
    np.testing.assert_allclose(
        kinematics.limits, np.column_stack([robot.arm.lower, robot.arm.upper])
    )


def test_a_camera_has_the_resolution_and_the_angle_of_the_file(robot: NominalRobot) -> None:
    camera = robot.camera("eye")
    assert (camera.width, camera.height) == (800, 600)
    assert camera.fy == pytest.approx(300.0 / np.tan(np.radians(25.0)))
    assert robot.cameras == ("eye",)
    assert robot.camera("") == NominalRobot(arm_scene()).camera("eye") == CAMERA


def test_statics_have_the_given_gains(robot: NominalRobot) -> None:
    posture = 0.5 * (robot.arm.lower + robot.arm.upper)
    for bias in (1.0, 3.0):
        hold = robot.statics(MotorControl(20_000.0, bias, 60.0)).hold(posture)
        assert hold.tension >= bias

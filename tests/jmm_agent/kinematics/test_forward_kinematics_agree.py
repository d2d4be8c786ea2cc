"""Pinocchio and MuJoCo read the same file as the same robot."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from jmm_agent.kinematics.arm_kinematics import ArmKinematics, KinematicsError
from tests.jmm_agent.nominal_arm import ARM, JOINTS

OPENCV_IN_MUJOCO = np.diag([1.0, -1.0, -1.0])

# All that Pinocchio's own reader gets wrong, in one file.
TRAPS = """
<mujoco>
  <compiler angle="degree"/>
  <default>
    <joint range="-90 90"/>
    <default class="d"><site size="0.01"/></default>
  </default>
  <worldbody>
    <site name="in_world" pos="1 2 3" euler="10 20 30"/>
    <body name="base" pos="0.1 0.2 0.3" euler="10 20 30">
      <geom size="0.1"/>
      <site name="on_base" pos="0.1 0 0" zaxis="1 1 0"/>
      <body name="head" pos="0 0 0.2" quat="0.9 0.1 0.2 0.3">
        <joint name="yaw" axis="0 0 1" pos="0.05 0 0"/>
        <joint name="pitch" axis="0 1 0" pos="0 0.03 0"/>
        <joint name="roll" axis="1 0 0"/>
        <geom size="0.02"/>
        <camera name="eye" pos="0.05 0 0.1" xyaxes="0 -1 0 0.5 0 0.8660254"/>
        <site name="nose" class="d" pos="0.01 0.02 0.03" euler="5 6 7"/>
      </body>
    </body>
    <body name="second" pos="0 -0.1 0">
      <joint name="swing" axis="0 1 1"/>
      <geom size="0.02"/>
      <body name="hand" pos="0 0 -.3"><joint name="reach" type="slide" axis="1 0 0" range="0 1"/>
        <geom size="0.02"/>
        <body name="swing" euler="0 60 0"><geom size="0.01"/>
          <site name="tip" pos="0 0 -0.03"/></body>
      </body>
    </body>
    <body name="can" pos="0.4 0 0"><freejoint/><geom size="0.03"/><site name="label"/></body>
  </worldbody>
</mujoco>
"""


def check(kinematics: ArmKinematics, model: mujoco.MjModel, postures: np.ndarray) -> None:
    data = mujoco.MjData(model)
    address = [int(model.joint(name).qposadr[0]) for name in kinematics.joints]
    for q in postures:
        data.qpos[address] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_camlight(model, data)
        for frame in kinematics.frames:
            if frame.startswith("pinocchio_") or "_joint_" in frame:
                continue
            if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, frame) >= 0:
                there = data.camera(frame)
                position, rotation = there.xpos, there.xmat.reshape(3, 3) @ OPENCV_IN_MUJOCO
            elif mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, frame) >= 0:
                position, rotation = data.site(frame).xpos, data.site(frame).xmat.reshape(3, 3)
            else:
                position, rotation = data.body(frame).xpos, data.body(frame).xmat.reshape(3, 3)
            pose = kinematics.pose(frame, q)
            assert np.abs(pose[:3, 3] - position).max() < 1e-9, frame
            assert np.abs(pose[:3, :3] - rotation).max() < 1e-9, frame


def test_every_frame_of_the_arm_agrees_to_a_nanometre() -> None:
    model = mujoco.MjModel.from_xml_path(str(ARM))
    kinematics = ArmKinematics(ARM, JOINTS)
    ranges = np.array([model.joint(name).range for name in JOINTS])
    assert np.abs(kinematics.limits - ranges).max() < 1e-12
    assert {"eye", "marker_hand", "grip", "thorax", "head", "hand"} <= set(kinematics.frames)
    assert {model.site(i).name for i in range(model.nsite)} <= set(kinematics.frames)
    random = np.random.default_rng(0)
    check(kinematics, model, random.uniform(ranges[:, 0], ranges[:, 1], (50, 14)))


@pytest.mark.parametrize(
    "joints",
    [("yaw", "pitch", "roll", "swing", "reach"), ("reach", "roll", "yaw", "swing", "pitch")],
)
def test_the_traps_of_the_reader_are_avoided_in_any_order_of_joints(
    tmp_path: Path, joints: tuple[str, ...]
) -> None:
    (tmp_path / "traps.xml").write_text(TRAPS)
    whole = tmp_path / "whole.xml"
    whole.write_text('<mujoco><include file="traps.xml"/></mujoco>')
    model = mujoco.MjModel.from_xml_path(str(whole))
    kinematics = ArmKinematics(whole, joints)
    assert {"eye", "nose", "on_base", "in_world", "tip", "base"} <= set(kinematics.frames)
    assert "label" not in kinematics.frames
    random = np.random.default_rng(0)
    low, high = np.array([model.joint(name).range for name in joints]).T
    check(kinematics, model, random.uniform(low, high, (20, 5)))


def test_other_joints_are_locked_where_asked(tmp_path: Path) -> None:
    path = tmp_path / "traps.xml"
    path.write_text(TRAPS)
    whole = ArmKinematics(path, ("yaw", "pitch", "roll", "swing", "reach"))
    part = ArmKinematics(path, ("roll", "yaw"), {"pitch": 0.3})
    expected = whole.pose("eye", [0.1, 0.3, 0.2, 0, 0], "tip")
    assert np.abs(part.pose("eye", [0.2, 0.1], "tip") - expected).max() < 1e-12


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<mujoco><worldbody", "cannot be read"),
        ("<mujoco/>", "no <mujoco> with a <worldbody>"),
        (TRAPS.replace('name="roll"', 'name="roll" ref="5"'), "has a ref"),
        (TRAPS.replace('<site name="in_world"', '<frame/><site name="in_world"'), "<frame>"),
        (TRAPS.replace('<site size="0.01"/>', '<site pos="0 0 1"/>'), "default pose of a site"),
        (TRAPS.replace('axis="0 1 1"', 'type="wheel"'), "Pinocchio refuses"),
        (TRAPS.replace('"roll"', '"other"'), "unknown joint 'roll'; joints are"),
    ],
)
def test_a_file_that_cannot_be_used_gets_one_sentence(
    tmp_path: Path, text: str, message: str
) -> None:
    path = tmp_path / "arm.xml"
    with pytest.raises(KinematicsError, match="no such file"):
        ArmKinematics(path, ("roll",))
    path.write_text(text)
    with pytest.raises(KinematicsError, match=message):
        ArmKinematics(path, ("roll",))

"""The kinematic tree as plain MJCF: another reader finds the poses of MuJoCo."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from kengoro_env.robot.kinematic_tree import kinematic_tree

WITH_REFS = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="link" pos="0.1 0.2 0.3">
      <joint name="reach" type="slide" axis="1 0 1" ref="0.01" range="-0.1 0.1"/>
      <joint name="swing" type="hinge" axis="0 1 0" ref="0.4" pos="0 0 0.1" range="-1 1"/>
      <geom size="0.02"/>
      <site name="tip" pos="0.05 0 0.2"/>
    </body>
  </worldbody>
</mujoco>
"""


def test_joints_whose_position_in_the_file_is_not_zero(tmp_path: Path) -> None:
    model = mujoco.MjModel.from_xml_string(WITH_REFS)
    path = tmp_path / "tree.xml"
    path.write_text(kinematic_tree(model))
    data = mujoco.MjData(model)
    data.qpos[:] = 0.02, -0.3
    mujoco.mj_kinematics(model, data)
    pose = ArmKinematics(path, ("reach", "swing")).pose("tip", data.qpos)
    np.testing.assert_allclose(pose[:3, 3], data.site("tip").xpos, atol=1e-9)
    np.testing.assert_allclose(pose[:3, :3], data.site("tip").xmat.reshape(3, 3), atol=1e-9)

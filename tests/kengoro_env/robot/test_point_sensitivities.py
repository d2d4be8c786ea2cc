"""What displaced points of attachment do to muscle lengths, against models with moved sites."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from kengoro_env.assets import asset_path
from kengoro_env.robot.nominal_model import NominalArm

FINGER = """
<mujoco>
  <worldbody>
    <site name="root" pos="-0.02 0.01 0.03"/>
    <site name="shared" pos="0.005 -0.015 0.0"/>
    <body pos="0 0 0" euler="20 0 0">
      <joint name="first" axis="0 1 0" range="-40 60"/>
      <geom type="capsule" fromto="0 0 0 0.05 0 0" size="0.006"/>
      <geom name="pulley" type="cylinder" size="0.008 0.02" euler="90 0 0"/>
      <site name="over" pos="0.01 0 0.03"/>
      <site name="middle" pos="0.03 0.004 0.012"/>
      <body pos="0.05 0 0" euler="0 0 35">
        <joint name="second" axis="0 1 0" range="0 70"/>
        <geom type="capsule" fromto="0 0 0 0.03 0 0" size="0.005"/>
        <site name="tip" pos="0.02 -0.003 0.01"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <spatial name="bend">
      <site site="root"/><geom geom="pulley" sidesite="over"/><site site="middle"/>
      <site site="tip"/>
    </spatial>
    <spatial name="stretch"><site site="shared"/><site site="tip"/></spatial>
    <spatial name="short"><site site="shared"/><site site="middle"/></spatial>
  </tendon>
  <actuator>
    <general tendon="bend"/><general tendon="stretch"/><general tendon="short"/>
  </actuator>
</mujoco>
"""


@pytest.fixture(params=["arm", "finger"])
def scene(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Kengoro's arm, or a finger with a pulley and muscles that share points."""
    if request.param == "arm":
        return asset_path("mjcf/kengoro_arm/arm.xml")
    (tmp_path / "finger.xml").write_text(FINGER)
    return tmp_path / "finger.xml"


def test_a_length_changes_by_the_sensitivity_times_the_displacement_of_its_points(
    scene: Path,
) -> None:
    arm = NominalArm(scene)
    rng = np.random.default_rng(0)
    q = rng.uniform(arm.lower, arm.upper, (4, len(arm.joints)))
    found = arm.point_sensitivities(q).reshape(4, len(arm.muscles), -1, 3)
    data = mujoco.MjData(arm.model)
    addresses = [arm.model.joint(joint).qposadr[0] for joint in arm.joints]
    for muscle, name in enumerate(arm.muscles):
        tendon = arm.model.tendon(name).id
        begin = arm.model.tendon_adr[tendon]
        path = range(begin, begin + arm.model.tendon_num[tendon])
        sites = [
            arm.model.wrap_objid[k]
            for k in path
            if arm.model.wrap_type[k] == mujoco.mjtWrap.mjWRAP_SITE
        ]
        assert not found[:, muscle, len(sites) :].any()
        shift = 1e-5 * rng.normal(size=(len(sites), 3))
        lengths = []
        for sign in (1.0, -1.0):
            arm.model.site_pos[sites] += sign * shift
            for posture in q:
                data.qpos[:] = arm.model.qpos0
                data.qpos[addresses] = posture
                mujoco.mj_fwdPosition(arm.model, data)
                lengths.append(data.ten_length[tendon])
            arm.model.site_pos[sites] -= sign * shift
        change = (np.array(lengths[:4]) - lengths[4:]) / 2.0
        expected = np.sum(found[:, muscle, : len(sites)] * shift, axis=(1, 2))
        np.testing.assert_allclose(expected, change, atol=1e-3 * np.abs(shift).max())


def test_lengths_are_as_before(scene: Path) -> None:
    arm = NominalArm(scene)
    middle = (arm.lower + arm.upper)[None] / 2.0
    before = arm.lengths(middle)
    arm.point_sensitivities(middle)
    np.testing.assert_array_equal(arm.lengths(middle), before)

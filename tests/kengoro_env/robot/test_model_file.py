"""Models that people have: without names, with actuators, of other suffixes, in several folders."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from kengoro_env.errors import ModelError
from kengoro_env.robot.model_file import load_spec
from kengoro_env.robot.motor_gains import gains_of
from kengoro_env.robot.muscle_law import DEFAULT_GAINS
from kengoro_env.robot.nominal_model import NominalArm
from kengoro_env.robot.robot import Robot

BODY = """
  <worldbody>
    <site name="s0" pos="-0.05 0 -0.02"/><site name="s1" pos="-0.05 0 0.02"/>
    <body>
      {joint}
      <geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.01" mass="0.2"/>
      <site name="t0" pos="0.05 0 -0.02"/><site name="t1" pos="0.05 0 0.02"/>
    </body>
  </worldbody>
  <tendon>
    <spatial {first}><site site="s0"/><site site="t0"/></spatial>
    <spatial name="up"><site site="s1"/><site site="t1"/></spatial>
  </tendon>
"""
HINGE = '<joint axis="0 1 0" range="-40 40"/>'


def write(path: Path, more: str = "", joint: str = HINGE, first: str = "") -> Path:
    text = BODY.format(joint=joint, first=first)
    path.write_text(f'<mujoco><compiler autolimits="true"/>{text}{more}</mujoco>')
    return path


def test_joints_and_tendons_without_a_name_get_one(tmp_path: Path) -> None:
    arm = NominalArm(write(tmp_path / "m.xml"))
    assert (arm.joints, arm.muscles) == (("joint_0",), ("tendon_0", "up"))


@pytest.mark.parametrize("kind", [str, Path])
def test_the_text_of_a_model_given_as_its_path_is_not_repeated(kind: type) -> None:
    text = f"<mujoco>{'<!-- long -->' * 100}</mujoco>"
    with pytest.raises(ModelError, match="by its path, not by its text") as caught:
        load_spec(kind(text))
    assert len(str(caught.value)) < 200


@pytest.mark.parametrize("suffix", ["mjcf", "MJCF", "txt"])
def test_a_model_of_another_suffix_is_read_with_its_includes(tmp_path: Path, suffix: str) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "site.xml").write_text(
        '<mujoco><default><site size="0.007"/></default></mujoco>'
    )
    path = write(tmp_path / f"m.{suffix}", '<include file="parts/site.xml"/>')
    assert NominalArm(path).model.site_size[0, 0] == 0.007


def test_actuators_of_the_file_are_replaced_and_give_the_motors_limit(tmp_path: Path) -> None:
    path = write(
        tmp_path / "m.xml",
        """<actuator>
          <motor name="up" tendon="up" gear="60" ctrlrange="-1 0"/>
          <general name="low" tendon="low" forcerange="-80 0"/>
        </actuator>
        <sensor><actuatorfrc actuator="up"/></sensor>
        <keyframe><key ctrl="0 0"/></keyframe>""",
        first='name="low"',
    )
    found = gains_of(path)
    assert found.source == "actuators"
    assert found.gains.limit == 60.0
    robot = Robot(path)
    robot.reset(np.zeros(1), np.random.default_rng(0))
    robot.step(robot.target)
    assert robot.muscles == ("low", "up")
    assert robot.model.nu == 2


def test_without_force_limits_the_load_determines_the_motors_limit(tmp_path: Path) -> None:
    found = gains_of(write(tmp_path / "m.xml"))
    assert found.source == "load"
    hold = 0.2 * 9.81 * 0.1 / 0.02  # [N], at the horizontal
    assert 2.0 * hold < found.gains.limit < 20.0 * hold
    heavy = write(tmp_path / "heavy.xml")
    heavy.write_text(heavy.read_text().replace('mass="0.2"', 'mass="2"'))
    assert gains_of(heavy).gains.limit == pytest.approx(10.0 * found.gains.limit, rel=0.02)


def test_kengoros_arm_has_the_default_gains() -> None:
    from kengoro_env.assets import asset_path
    from kengoro_env.robot.motor_gains import LOAD, TRAVEL, load, ratio

    arm = NominalArm(asset_path("mjcf/kengoro_arm/arm.xml"))
    assert ratio(arm.travel, TRAVEL) == ratio(load(arm), LOAD) == 1.0
    assert gains_of(asset_path("mjcf/kengoro_arm/arm.xml")).gains == DEFAULT_GAINS


def test_files_of_a_folder_that_the_user_allows_are_read(tmp_path: Path) -> None:
    shared, own = tmp_path / "shared", tmp_path / "own"
    shared.mkdir()
    own.mkdir()
    (shared / "site.xml").write_text('<mujoco><default><site size="0.007"/></default></mujoco>')
    path = write(own / "m.xml", '<include file="../shared/site.xml"/>')
    with pytest.raises(ModelError, match=r"lies outside .*, or name its folder in `folders`"):
        load_spec(path)
    assert NominalArm(path, [shared]).model.site_size[0, 0] == 0.007
    assert Robot(path, folders=[shared]).muscles == ("tendon_0", "up")


@pytest.mark.parametrize(
    ("joint", "message"),
    [
        ("<freejoint/>", "crosses the free or ball joint"),
        ('<joint type="ball"/>', "crosses the free or ball joint"),
        ('<joint name="j" axis="0 1 0"/>', "no range of the joint 'j'"),
        ("", "no joint that a muscle crosses"),
    ],
)
def test_joints_that_muscles_cannot_move_are_named(
    tmp_path: Path, joint: str, message: str
) -> None:
    with pytest.raises(ModelError, match=message):
        NominalArm(write(tmp_path / "m.xml", joint=joint))


def test_a_model_without_muscles_reports_what_a_muscle_is(tmp_path: Path) -> None:
    path = tmp_path / "m.xml"
    path.write_text(
        '<mujoco><worldbody><body><joint name="j" range="-1 1"/><geom size="0.1"/></body>'
        '</worldbody><tendon><fixed name="f"><joint joint="j" coef="1"/></fixed></tendon></mujoco>'
    )
    with pytest.raises(ModelError, match="no muscles: a muscle is a <spatial> in <tendon>"):
        NominalArm(path)


def test_a_coupling_of_joints_is_no_muscle(tmp_path: Path) -> None:
    path = write(
        tmp_path / "m.xml",
        '<tendon><fixed name="f"><joint joint="j" coef="1"/></fixed></tendon>',
        joint='<joint name="j" axis="0 1 0" range="-40 40"/>',
    )
    assert NominalArm(path).muscles == Robot(path).muscles == ("tendon_0", "up")

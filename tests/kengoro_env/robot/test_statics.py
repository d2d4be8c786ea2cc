"""Postures that muscles can hold, and the sentence for those that they cannot."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kengoro_env.errors import ArgumentError
from kengoro_env.robot.motor_gains import gains_of
from kengoro_env.robot.muscle_law import Gains
from kengoro_env.robot.nominal_model import NominalArm
from kengoro_env.robot.robot import Robot
from kengoro_env.robot.statics import Statics, least_tensions

PENDULUM = """<mujoco><compiler autolimits="true"/><worldbody>
<site name="s0" pos="-0.05 0 -0.02"/><site name="s1" pos="-0.05 0 0.02"/>
<body><joint name="j" axis="0 1 0" range="-40 40"/>
<geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.01" mass="0.2"/>
<site name="t0" pos="0.05 0 -0.02"/><site name="t1" pos="0.05 0 0.02"/></body>
</worldbody><tendon>
<spatial name="low"><site site="s0"/><site site="t0"/></spatial>
<spatial name="up"><site site="s1"/><site site="t1"/></spatial></tendon></mujoco>"""
WEIGHT = 0.2 * 9.81 * 0.1
"""Torque of gravity at the horizontal [N m]."""
GAINS = Gains(20_000.0, 1.0, 60.0)


@pytest.fixture
def pendulum(tmp_path: Path) -> Path:
    path = tmp_path / "pendulum.xml"
    path.write_text(PENDULUM)
    return path


def test_the_tension_balances_gravity_and_the_other_muscle(pendulum: Path) -> None:
    hold = Statics(NominalArm(pendulum), GAINS).hold(np.zeros(1))
    assert hold.reachable
    assert hold.reason == ""
    assert hold.tension == pytest.approx(WEIGHT / 0.02 + GAINS.bias)


def test_a_robot_holds_a_posture_by_commands_that_are_shorter_by_the_stretch(
    pendulum: Path,
) -> None:
    arm, posture = NominalArm(pendulum), np.array([0.2])
    robot = Robot(pendulum, (), GAINS)
    tensions, missing = least_tensions(arm.moment_arms(posture), arm.gravity(posture), GAINS.bias)
    assert abs(missing[0]) < 1e-6
    held = (tensions - GAINS.bias) / GAINS.stiffness
    for stretch, least, most in ((held, 0.0, 0.01), (0.0, 0.5, 5.0)):
        robot.reset(posture, np.random.default_rng(0))
        for _ in range(100):
            robot.step(arm.lengths(posture)[0] - stretch)
        assert least <= np.degrees(np.abs(robot.joint_angles - posture)[0]) <= most


def test_a_limit_below_the_weight_is_named(pendulum: Path) -> None:
    weak = Statics(NominalArm(pendulum), replace(GAINS, limit=8.0))
    hold = weak.hold(np.zeros(1))
    assert not hold.reachable
    assert "'up' would have to pull with 10.8 N, above the motors' limit of 8 N" in hold.reason


def test_a_joint_that_no_muscle_can_hold_is_named(tmp_path: Path) -> None:
    path = tmp_path / "low.xml"
    up = '<spatial name="up"><site site="s1"/><site site="t1"/></spatial>'
    path.write_text(PENDULUM.replace(up, ""))
    hold = Statics(NominalArm(path), GAINS).hold(np.zeros(1))
    assert not hold.reachable
    assert "balances joint 'j', where 0.22 N m are missing" in hold.reason


@pytest.fixture
def top_heavy(tmp_path: Path) -> Path:
    """Upright, 20 kg; each muscle at T_bias has the stiffness K_stiff (0.02 m)^2 one way only."""
    path = tmp_path / "top_heavy.xml"
    path.write_text(PENDULUM.replace('mass="0.2"', 'mass="20"').replace("0.2 0 0", "0 0 0.2"))
    return path


def test_a_posture_in_which_the_muscles_do_not_keep_the_joint_is_unstable(top_heavy: Path) -> None:
    path, falls = top_heavy, 20.0 * 9.81 * 0.1 / 0.02**2  # [N/m]
    soft = Statics(NominalArm(path), Gains(0.99 * falls, 1.0, 500.0)).hold(np.zeros(1))
    assert not soft.reachable
    assert soft.reason == "joint 'j' is unstable there"
    assert Statics(NominalArm(path), Gains(100_000.0, 1.0, 500.0)).hold(np.zeros(1)).reachable


def test_a_posture_that_needs_exact_lengths_names_the_error_that_it_withstands(
    top_heavy: Path,
) -> None:
    arm, stiffness, bends = NominalArm(top_heavy), 50_000.0, 0.1 / 4  # [m], of a chord of 0.1 m
    margin = stiffness * 0.02**2 - 20.0 * 9.81 * 0.1 - 2.0 * bends
    error = margin / (stiffness * bends * np.sqrt(2.0))  # 0.19 mm
    hold = Statics(arm, Gains(stiffness, 1.0, 500.0)).hold(np.zeros(1))
    assert not hold.reachable
    assert hold.reason == (
        f"joint 'j' would be unstable there if lengths were wrong by {1e3 * error:.2g} mm"
    )
    held = [Statics(arm, Gains(k, 1.0, 500.0)).hold(np.zeros(1)) for k in (52_000.0, 53_000.0)]
    assert [hold.reachable for hold in held] == [False, True]  # 0.08 of the muscles' travel


def test_a_posture_must_be_stable_in_both_directions(top_heavy: Path) -> None:
    # One muscle with twice the arm against two: half as stiff in the direction of the two.
    extra = '<spatial name="low2"><site site="s0"/><site site="t0"/></spatial></tendon>'
    text = top_heavy.read_text().replace("</tendon>", extra)
    for end in ('"s1" pos="-0.05 0 0.02"', '"t1" pos="0.05 0 0.02"'):
        text = text.replace(end, end.replace("0 0.02", "0 0.04"))
    top_heavy.write_text(text)
    arm, falls = NominalArm(top_heavy), 20.0 * 9.81 * 0.1 / (2.0 * 0.02**2)  # [N/m]
    for share, reachable in ((0.9, False), (1.3, True)):
        hold = Statics(arm, Gains(share * falls, 1.0, 500.0)).hold(np.zeros(1))
        assert hold.reachable == reachable


def test_kengoros_postures_are_reachable() -> None:
    from kengoro_env.assets import asset_path
    from kengoro_env.postures import posture_set

    scene = asset_path("mjcf/kengoro_arm/arm.xml")
    statics = Statics(NominalArm(scene), gains_of(scene).gains)
    assert all(statics.hold(posture).reachable for posture in posture_set()[::50])


def test_a_posture_of_another_shape_is_refused(pendulum: Path) -> None:
    with pytest.raises(ArgumentError, match="1 finite angles"):
        Statics(NominalArm(pendulum), GAINS).hold(np.zeros(2))

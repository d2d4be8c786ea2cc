"""Scales of a robot: Kengoro's arm keeps its options, another robot's derive, given ones stay."""

from __future__ import annotations

import re
from dataclasses import fields, is_dataclass, replace
from typing import Any

import pytest

from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import MotorControl
from jmm_agent.guard.guard import GuardOptions
from jmm_agent.mapping.prior import PriorOptions
from jmm_agent.options import AgentOptions
from jmm_agent.posture_feedback import FeedbackOptions
from jmm_agent.scales import SCALED, RobotScales
from jmm_agent.updaters import VisionOptions
from jmm_agent.vision.balance import BalanceOptions
from jmm_agent.vision.hold_out import HoldOutOptions
from jmm_agent.vision.pose_errors import JointPrior

HELD_OUT = AgentOptions(vision=VisionOptions(hold_out=HoldOutOptions()))


def test_kengoros_arm_keeps_all_options_to_the_bit() -> None:
    assert set(RobotScales().ratios.values()) == {1.0}
    assert RobotScales().agent_options(HELD_OUT) == HELD_OUT
    assert RobotScales().guard_options() == GuardOptions()


def records() -> dict[str, Any]:
    """All records of options of agent and guard, by name."""
    found: dict[str, Any] = {}

    def collect(record: Any) -> None:
        found[type(record).__name__] = record
        for option in fields(record):
            if is_dataclass(getattr(record, option.name)):
                collect(getattr(record, option.name))

    collect(HELD_OUT)
    collect(FeedbackOptions())
    collect(GuardOptions())
    return found


def test_each_scaled_option_exists_and_follows_a_known_ratio() -> None:
    known = records()
    for name, table in SCALED.items():
        for option, ratio in table.items():
            assert hasattr(known[name], option), f"{name}.{option}"
            assert ratio in RobotScales().ratios


def test_each_option_in_units_of_a_robot_is_scaled() -> None:
    unscaled = {
        f"{name}.{option.name}"
        for name, record in records().items()
        for option in fields(record)
        if re.search(rf"^ +{option.name}: [^:]*\[(m|N|rad|px)\b", record.__doc__, re.MULTILINE)
        and option.name not in SCALED.get(name, {})
    }
    encoders = {f"EstimatorOptions.joint_{what}" for what in ("noise", "tolerance")}
    angles_in_the_image = ("turned", "still_rad", "facing", "mirrored")
    assert unscaled == {
        "ObservationFitOptions.joint_noise",
        "CameraPrior.rotation",
        "JointPrior.turn",
        *encoders,
        *(f"CanShape.{size}" for size in ("radius", "height", "rim")),
        *(f"CameraMonitorOptions.{option}" for option in angles_in_the_image),
    }


def test_the_same_arm_at_half_its_size_and_an_eighth_of_its_limit() -> None:
    arm = RobotScales()
    half = replace(
        arm,
        travel=arm.travel / 2,
        reach=arm.reach / 2,
        distance=arm.distance / 2,
        marker_side=arm.marker_side / 2,
        motors=MotorControl(7500.0, 3.75, 62.5),
    )
    options, guard = half.agent_options(), half.guard_options()
    assert options.prior.offset == 0.0125
    assert options.prior.shape == 0.0025
    assert options.prior.noise == 0.0005
    assert options.prior.elongation == 0.01
    assert options.settling.change == pytest.approx(0.0004)
    assert options.settling.release == pytest.approx(0.002)
    assert options.vision.saturation == pytest.approx(56.25)  # 0.9 of the limit
    assert options.vision.position_residual == pytest.approx(0.01)
    assert options.vision.rotation_residual == VisionOptions().rotation_residual
    assert options.vision.distance == VisionOptions().distance
    assert guard.disturbance.least == pytest.approx(22.0 / 8.0, rel=0.01)
    assert guard.camera.margin == GuardOptions().camera.margin


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_a_scale_that_is_not_positive_and_finite_is_refused(value: float) -> None:
    with pytest.raises(AgentError, match=r"RobotScales: reach is .*, but must be positive"):
        RobotScales(reach=value)


def test_an_option_that_was_given_stays() -> None:
    given = AgentOptions(prior=PriorOptions(offset=0.003))
    scales = replace(RobotScales(), travel=2.0 * RobotScales().travel)
    prior = scales.agent_options(given).prior
    assert (prior.offset, prior.shape, prior.elongation) == (0.003, 0.01, 0.04)


def test_torques_follow_moment_arms_and_tensions() -> None:
    """Muscles that move twice as far over half the range have four times the moment arm."""
    own = RobotScales()
    other = RobotScales(
        travel=2.0 * own.travel,
        joint_range=0.5 * own.joint_range,
        motors=MotorControl(limit=3.0 * own.motors.limit),
    )
    assert other.ratios["torque"] == pytest.approx(12.0)
    balance = other.agent_options().vision.balance
    assert balance.noise == pytest.approx(12.0 * BalanceOptions().noise)
    assert balance.arm == pytest.approx(4.0 * BalanceOptions().arm)
    assert balance.share == BalanceOptions().share


def test_bones_that_do_not_fit_a_small_robot_are_off_by_less() -> None:
    own = RobotScales()
    vision = replace(own, reach=0.1 * own.reach).agent_options().vision
    assert vision.misplaced.offset == pytest.approx(0.1 * VisionOptions().misplaced.offset)
    assert vision.misplaced.turn == VisionOptions().misplaced.turn
    assert not vision.joints.enabled
    given = AgentOptions(vision=VisionOptions(misplaced=JointPrior(0.001, 0.01)))
    given = replace(own, reach=0.1 * own.reach).agent_options(given)
    assert given.vision.misplaced == JointPrior(0.001, 0.01)

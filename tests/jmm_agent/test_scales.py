"""Scales of a robot: Kengoro's arm keeps its options, another robot's derive, given ones stay."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import Any

import pytest

from jmm_agent.guard.faults import MotorControl
from jmm_agent.guard.guard import GuardOptions
from jmm_agent.mapping.prior import PriorOptions
from jmm_agent.options import AgentOptions
from jmm_agent.scales import SCALED, RobotScales
from jmm_agent.updaters import VisionOptions
from jmm_agent.vision.hold_out import HoldOutOptions

HELD_OUT = AgentOptions(vision=VisionOptions(hold_out=HoldOutOptions()))


def test_kengoros_arm_keeps_all_options_to_the_bit() -> None:
    assert set(RobotScales().ratios.values()) == {1.0}
    assert RobotScales().agent_options(HELD_OUT) == HELD_OUT
    assert RobotScales().guard_options() == GuardOptions()


def test_each_scaled_option_exists_and_follows_a_known_ratio() -> None:
    records: dict[str, Any] = {}

    def collect(record: Any) -> None:
        records[type(record).__name__] = record
        for option in fields(record):
            if is_dataclass(getattr(record, option.name)):
                collect(getattr(record, option.name))

    collect(HELD_OUT)
    collect(GuardOptions())
    for name, table in SCALED.items():
        for option, ratio in table.items():
            assert hasattr(records[name], option), f"{name}.{option}"
            assert ratio in RobotScales().ratios


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
    assert guard.camera.margin == GuardOptions().camera.margin  # as many pixels


def test_an_option_that_was_given_stays() -> None:
    given = AgentOptions(prior=PriorOptions(offset=0.003))
    scales = replace(RobotScales(), travel=2.0 * RobotScales().travel)
    prior = scales.agent_options(given).prior
    assert (prior.offset, prior.shape, prior.elongation) == (0.003, 0.01, 0.04)

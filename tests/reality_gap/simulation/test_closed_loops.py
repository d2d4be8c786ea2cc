"""Closed loops: joints without an encoder begin where the constraints of the model put them."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from reality_gap.simulation.closed_loops import set_state

SCALES = (0.1, 1.0, 10.0)


def five_bar(size: float, jacobian: str = "auto") -> mujoco.MjModel:
    """A parallel robot of two motors, whose lower links meet below; links of 120 and 160 sizes."""
    arms = "".join(
        f'<body pos="{side * 0.05 * size} 0 0" euler="0 {-side * 0.55} 0">'
        f'<joint name="motor_{name}" axis="0 1 0"/>'
        f'<geom type="capsule" fromto="0 0 0 0 0 {-0.12 * size}" size="{0.01 * size}"/>'
        f'<body name="{name}" pos="0 0 {-0.12 * size}" euler="0 {side * 1.331740110175} 0">'
        f'<joint name="passive_{name}" axis="0 1 0"/>'
        f'<geom type="capsule" fromto="0 0 0 0 0 {-0.16 * size}" size="{0.01 * size}"/>'
        "</body></body>"
        for name, side in (("left", -1), ("right", 1))
    )
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="radian"/><option jacobian="{jacobian}"/>'
        f"<worldbody>{arms}</worldbody><equality>"
        f'<connect body1="left" body2="right" anchor="0 0 {-0.16 * size}"/></equality></mujoco>'
    )


def gap(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Return the distance between the ends of the lower links [m]."""
    mujoco.mj_forward(model, data)
    end = model.eq_data[0, 2]
    ends = [
        data.body(name).xpos + end * data.body(name).xmat[[2, 5, 8]] for name in ("left", "right")
    ]
    return float(np.linalg.norm(ends[0] - ends[1]))


@pytest.mark.parametrize("size", SCALES)
@pytest.mark.parametrize("jacobian", ["dense", "sparse"])
def test_a_linkage_is_closed_and_does_not_turn_over(size: float, jacobian: str) -> None:
    model = five_bar(size, jacobian)
    data = mujoco.MjData(model)
    assert gap(model, data) < 1e-9 * size
    set_state(model, data, {"motor_left": 0.9, "motor_right": 0.5}, {})
    assert data.joint("motor_left").qpos == pytest.approx(0.9)
    assert data.joint("motor_right").qpos == pytest.approx(0.5)
    assert gap(model, data) < 1e-8
    left, right = (data.body(name).xpos for name in ("left", "right"))
    tip = left + model.eq_data[0, 2] * data.body("left").xmat[[2, 5, 8]]
    assert tip[2] < min(left[2], right[2])  # the elbows of the model


def test_the_velocities_are_those_of_the_closed_linkage() -> None:
    model = five_bar(1.0)
    data = mujoco.MjData(model)
    joints, speeds = (
        {"motor_left": 0.3, "motor_right": 0.1},
        {"motor_left": 2.0, "motor_right": -1.0},
    )
    set_state(model, data, joints, speeds)
    step, later = 1e-6, mujoco.MjData(model)
    moved = {name: joints[name] + step * speeds[name] for name in joints}
    set_state(model, later, moved, speeds)
    assert (later.qpos - data.qpos) / step == pytest.approx(data.qvel, abs=1e-4)


@pytest.mark.parametrize("ratio", [1.0, -2.0])
def test_a_coupled_finger_begins_with_the_other_one(ratio: float) -> None:
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body><joint name="a"/><geom size="0.1"/></body><body pos="1 0 0">'
        '<joint name="b"/><geom size="0.1"/></body><body pos="2 0 0"><joint name="c"/>'
        '<geom size="0.1"/></body></worldbody><equality>'
        f'<joint joint1="b" joint2="a" polycoef="0 {ratio} 0 0 0"/></equality></mujoco>'
    )
    data = mujoco.MjData(model)
    set_state(model, data, {"a": 0.7}, {"a": 0.2})
    assert data.qpos == pytest.approx([0.7, ratio * 0.7, 0.0])
    assert data.qvel == pytest.approx([0.2, ratio * 0.2, 0.0])


def test_readings_that_break_a_constraint_are_kept() -> None:
    """All joints were read, with their errors: there is nothing left to close the loop with."""
    model = five_bar(1.0)
    data = mujoco.MjData(model)
    names = [model.joint(i).name for i in range(model.njnt)]
    read = dict(zip(names, (0.1, 0.0, -0.1, 0.05), strict=True))
    set_state(model, data, read, dict.fromkeys(names, 0.5))
    assert data.qpos == pytest.approx(list(read.values()))
    assert data.qvel == pytest.approx([0.5] * 4)

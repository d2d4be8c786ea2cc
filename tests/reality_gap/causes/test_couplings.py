"""Couplings of joints: in the model with another ratio, and missing in the model."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap.causes import CATALOGUE
from reality_gap.causes.support.joint_tree import joint_before, passive_joints
from reality_gap.simulation.hypothesis import build
from reality_gap.study.measurements import measured
from reality_gap.study.system import System, compile_system
from tests.reality_gap.causes.candidates import candidate, with_cause
from tests.reality_gap.causes.machines import ARM, HAND, arm_study, hand_study, predict

RATIO = 0.3


@pytest.mark.parametrize(
    ("location", "excess", "old", "new"),
    [
        ("distal (with middle)", 0.25, 'polycoef="0 0.8 0 0 0"', 'polycoef="0 1 0 0 0"'),
        ("both (with end)", -0.4, 'joint="end" coef="0.5"', 'joint="end" coef="0.3"'),
    ],
)
def test_a_wrong_ratio_is_the_model_edited_by_hand(
    systems: dict[str, System], tmp_path: Path, location: str, excess: float, old: str, new: str
) -> None:
    system = systems["hand"]
    assert old in HAND
    by_hand = compile_system(hand_study(tmp_path, model=HAND.replace(old, new)))
    found, expected = (
        with_cause(system, "coupling_ratio", location, excess=excess),
        predict(by_hand),
    )

    assert np.abs(expected - predict(system)).max() > 10.0
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_only_joints_that_nothing_moves_may_be_coupled(systems: dict[str, System]) -> None:
    hand, arm = systems["hand"], systems["arm"]

    assert passive_joints(hand) == ("tip",)
    assert joint_before(hand, "tip") == "thumb"
    assert joint_before(hand, "thumb") == ""
    assert [str(p) for p in CATALOGUE["joint_coupling"].locations(hand)] == [
        "tip (with thumb)",
        "tip (against thumb)",
    ]
    assert CATALOGUE["joint_coupling"].locations(arm) == ()


def test_a_rigid_coupling_is_an_equality_constraint(
    systems: dict[str, System], tmp_path: Path
) -> None:
    system = systems["hand"]
    tied = '<joint joint1="tip" joint2="thumb" polycoef="0 -0.5 0 0 0" solref="0.004 1"/>'
    model = HAND.replace("<equality>", "<equality>" + tied)
    expected, free = predict(compile_system(hand_study(tmp_path, model=model))), predict(system)
    found = with_cause(system, "joint_coupling", "tip (against thumb)", rigidity=12.0, ratio=-0.5)
    tip = np.isin(measured(system.study).channel, (4,))

    missed = np.abs(found - expected)[tip].mean()
    assert missed < 0.1 * np.abs(free - expected)[tip].mean()


def test_candidates_of_couplings_are_few(systems: dict[str, System]) -> None:
    for name in ("elbow", "arm", "screw", "effort"):
        system = systems[name]
        count = sum(
            len(CATALOGUE[id].locations(system))
            for id in ("coupling_ratio", "joint_coupling", "motor_coupling")
        )
        assert count <= 2 * (len(system.joints) - 1)


def coupled_arm(folder: Path) -> System:
    """The arm with a motor at its base, whose belt leads over the shoulder to the elbow."""
    belt = f"""<tendon><fixed name="belt"><joint joint="elbow" coef="1"/>
      <joint joint="shoulder" coef="{RATIO}"/></fixed></tendon><actuator>"""
    model = ARM.replace("<actuator>", belt).replace(
        '<position name="elbow" joint="elbow"', '<position name="elbow" tendon="belt"'
    )
    return compile_system(arm_study(folder, model=model))


def test_a_motor_that_turns_along_is_one_with_a_belt(
    systems: dict[str, System], tmp_path: Path
) -> None:
    system, belt = systems["arm"], coupled_arm(tmp_path)
    readings = measured(system.study)
    found = with_cause(system, "motor_coupling", "elbow (with shoulder)", ratio=RATIO)
    expected = predict(belt)
    of = {
        sensor: expected[readings.channel == c] * readings.noise[readings.channel == c]
        for c, sensor in enumerate(channel.sensor for channel in system.study.channels)
    }
    own = readings.channel == 1
    noise = readings.noise[own]
    on_motor = of["position_elbow"] + RATIO * of["position_shoulder"]

    for c in (0, 3, 4):
        at = readings.channel == c
        np.testing.assert_allclose(found[at], expected[at], atol=1e-6)
    np.testing.assert_allclose(found[own], on_motor / noise, atol=1e-6)


def test_absolute_angles_move_nothing(systems: dict[str, System]) -> None:
    system = systems["arm"]
    readings, before = measured(system.study), predict(system)
    location = "elbow (with shoulder, reading only)"
    found = with_cause(system, "motor_coupling", location, ratio=1.0)
    own = readings.channel == 1
    sums = before[own] * readings.noise[own] + (before * readings.noise)[readings.channel == 0]

    np.testing.assert_allclose(found[own] * readings.noise[own], sums, atol=1e-9)
    changed = np.unique(readings.channel[np.abs(found - before) > 1e-9])
    assert set(changed) == {1, 2}, "position and velocity of the elbow"


def test_a_motor_that_turns_along_is_written_with_the_model(systems: dict[str, System]) -> None:
    system = systems["arm"]
    one = candidate(system, "motor_coupling", "elbow (with shoulder)")
    spec = build(system, [(one, {"ratio": RATIO})]).spec
    spec.compile()
    model = mujoco.MjModel.from_xml_string(spec.to_xml())

    assert int(model.actuator("elbow").trntype[0]) == int(mujoco.mjtTrn.mjTRN_TENDON)
    np.testing.assert_allclose(sorted(model.wrap_prm), [RATIO, 1.0])


def test_a_compensation_of_gravity_acts_on_a_motor_that_turns_along(
    systems: dict[str, System],
) -> None:
    system = systems["arm"]
    one = candidate(system, "motor_coupling", "elbow (with shoulder)")
    other = candidate(system, "gravity_compensation", "elbow")
    both = predict(system, (one, {"ratio": 1e-9}), (other, {"share": 0.5}))

    np.testing.assert_allclose(both, predict(system, (other, {"share": 0.5})), atol=1e-3)


def test_the_order_of_causes_at_one_motor_does_not_matter(systems: dict[str, System]) -> None:
    system = systems["arm"]
    parts = []
    for id, location, values in (
        ("motor_coupling", "elbow (with shoulder)", {"ratio": 0.2}),
        ("force_limit", "elbow", {"limit": 1.0}),
        ("torque_speed_curve", "elbow", {"drop": 0.1}),
    ):
        one = candidate(system, id, location)
        parts.append((one, one.null_values() | values))

    np.testing.assert_array_equal(predict(system, *parts), predict(system, *reversed(parts)))


def test_a_motor_that_turns_along_is_zeroed_where_the_model_is(tmp_path: Path) -> None:
    bent = ARM.replace('name="shoulder" axis="0 1 0"', 'name="shoulder" axis="0 1 0" ref="30"')
    assert bent != ARM
    system = compile_system(arm_study(tmp_path, model=bent))
    one = candidate(system, "motor_coupling", "elbow (with shoulder)")
    model = build(system, [(one, {"ratio": RATIO})]).spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)

    assert data.joint("shoulder").qpos[0] == pytest.approx(np.radians(30.0))
    assert data.actuator("elbow").force[0] == pytest.approx(0.0, abs=1e-9)

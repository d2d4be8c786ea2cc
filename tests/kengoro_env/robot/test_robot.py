"""Robot: muscle stiffness control, sensors with errors, and errors for invalid input."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from kengoro_env.assets import asset_path
from kengoro_env.departures import (
    Elongation,
    EncoderError,
    TendonStretch,
    TensionSensorError,
    ZeroPosture,
    actual,
)
from kengoro_env.errors import KengoroError, UnknownNameError
from kengoro_env.names import JOINTS
from kengoro_env.postures import posture_set
from kengoro_env.robot.draft import Departure
from kengoro_env.robot.muscle_law import Gains
from kengoro_env.robot.nominal_model import NominalArm
from kengoro_env.robot.robot import Robot
from kengoro_env.robot.tendons import actuated_joints
from tests.kengoro_env.environments import EveryOtherStretches

ARM = asset_path("mjcf/kengoro_arm/arm.xml")
ELBOW = asset_path("mjcf/kengoro_arm/elbow.xml")


def settle(robot: Robot, target: np.ndarray, steps: int = 100) -> None:
    for _ in range(steps):
        robot.step(target)


@pytest.mark.parametrize("seed", [None, 1])
@pytest.mark.parametrize(("scene", "joints"), [("can_grasp", JOINTS), ("elbow", ("elbow",))])
def test_joints_are_those_that_tendons_cross(
    scene: str, joints: tuple[str, ...], seed: int | None
) -> None:
    """Joints of the can, the fingers and the spools do not count."""
    path = asset_path(f"mjcf/kengoro_arm/{scene}.xml")
    assert Robot(path, () if seed is None else actual(seed)).joints == joints
    assert NominalArm(path).joints == joints


def test_a_tendon_within_one_body_crosses_nothing() -> None:
    model = mujoco.MjModel.from_xml_string("""
    <mujoco><worldbody>
      <body><joint name="inner"/><geom size="0.1"/><site name="a"/><site name="b" pos="1 0 0"/>
        <body pos="1 0 0"><joint name="slide" type="slide"/><geom size="0.1"/><site name="c"/>
          <body pos="1 0 0"><joint name="outer"/><geom size="0.1"/><site name="d"/></body>
        </body>
      </body></worldbody>
      <tendon>
        <spatial name="still"><site site="a"/><site site="b"/></spatial>
        <spatial name="moved"><site site="a"/><site site="c"/></spatial>
      </tendon>
    </mujoco>""")
    assert actuated_joints(model) == ("slide",)


@pytest.mark.parametrize(
    "departures",
    [
        (),
        (TendonStretch(1e-5, 4e6),),
        (Elongation("biceps", 0.01),),
        (TendonStretch(1e-5, 4e6), Elongation("biceps", 0.01)),
    ],
    ids=["ideal", "stretch", "given", "stretch and given"],
)
def test_muscle_stiffness_control(departures: tuple[Departure, ...]) -> None:
    """T = T_bias + max(0, K (l - l_target)), cut at T_max (paper, sec. III-B)."""
    gains = Gains(stiffness=20_000.0, bias=20.0, limit=150.0)
    robot = Robot(ELBOW, departures, gains)
    robot.reset(np.array([1.0]), np.random.default_rng(0))
    for shift in ([0.0, 0.0, 0.0], [-0.02, 0.002, 0.001], [0.005, -0.003, 0.0]):
        target = robot.lengths + shift
        settle(robot, target, 300)
        pull = gains.bias + np.maximum(0.0, gains.stiffness * (robot.lengths - target))
        assert np.allclose(robot.tensions, np.minimum(pull, gains.limit), atol=0.05)


def test_a_stretched_tendon_is_path_minus_stretch() -> None:
    compliance, hardening = 1e-5, 4e6
    robot = Robot(ELBOW, (TendonStretch(compliance, hardening),))
    robot.reset(np.array([0.7]), np.random.default_rng(0))
    path = NominalArm(ELBOW)
    settle(robot, robot.lengths - 0.004, 300)
    tension = robot.tensions
    # Root of T = x / compliance + hardening x^2; the tendons were zeroed while they pulled T_bias.
    stretch, zeroed = (
        (np.sqrt(1.0 / compliance**2 + 4 * hardening * t) - 1.0 / compliance) / (2 * hardening)
        for t in (tension, robot.motors.bias)
    )
    assert np.all(tension > 40.0)
    expected = path.lengths(robot.joint_angles)[0] - stretch + zeroed
    assert np.allclose(robot.lengths, expected, rtol=0.0, atol=1e-6)


def test_every_other_tendon_may_stretch() -> None:
    """Each follows its stiffness control, and has friction in proportion to its tension."""
    gains = Gains(stiffness=20_000.0, bias=20.0, limit=150.0)
    robot = Robot(ELBOW, (EveryOtherStretches(),), gains)
    robot.reset(np.array([1.0]), np.random.default_rng(0))
    nominal = NominalArm(ELBOW)
    target = robot.lengths - 0.002
    settle(robot, target, 300)
    tensions, lengths = robot.tensions, robot.lengths
    pull = gains.bias + np.maximum(0.0, gains.stiffness * (lengths - target))
    assert np.all(tensions > 25.0)
    stretches = [robot.model.joint(j).name for j in range(robot.model.njnt)][1:]
    assert stretches == [f"spool_{muscle}" for muscle in robot.muscles[::2]]
    assert robot.model.tendon_frictionloss.tolist() == [0.0] * 3
    loss = robot.model.dof_frictionloss
    assert loss[0] == 0.0
    # A spool that rubs holds with what its motor pulls, give or take the friction.
    assert np.allclose(tensions[::2], pull[::2], atol=1.1 * loss[1:].max())
    assert np.allclose(loss[1:], 0.1 * pull[::2], rtol=0.02)
    assert tensions[1] == pytest.approx(pull[1], abs=0.05)
    straight = nominal.lengths(robot.joint_angles)[0]
    stretch = straight - lengths
    assert abs(stretch[1]) < 1e-9
    assert np.all(stretch[::2] > 1e-4)


def test_lengths_are_zero_at_the_posture_called_zero() -> None:
    sigma = np.radians(10.0)
    robot = Robot(
        ARM, (ZeroPosture(shoulder=sigma, scapula=sigma, forearm=sigma, neck=sigma, seed=4),)
    )
    nominal = NominalArm(ARM)
    robot.reset(posture_set()[0], np.random.default_rng(0))
    offset = nominal.lengths(posture_set()[0])[0] - robot.lengths
    draws = np.array([robot._sensor_errors.zero_posture[joint] for joint in robot.joints])
    assert np.allclose(offset, nominal.lengths(draws)[0], atol=1e-12)
    assert np.abs(offset).max() > 0.003


def test_noise_offset_and_quantum() -> None:
    departures = (
        EncoderError(offset=0.002, noise=0.0003, quantum=0.0001, seed=1),
        TensionSensorError(noise=2.0, offset=3.0, seed=1),
    )
    robot = Robot(ARM, departures)
    robot.reset(posture_set()[0], np.random.default_rng(0))
    lengths = np.array([robot.measured_lengths() for _ in range(2000)])
    error = lengths - robot.lengths
    assert np.allclose(lengths / 0.0001, np.round(lengths / 0.0001), atol=1e-6)
    assert error.std(axis=0).mean() == pytest.approx(np.hypot(0.0003, 0.0001 / np.sqrt(12)), 0.03)
    assert error.mean(axis=0).std() == pytest.approx(0.002, rel=0.4)
    tensions = np.array([robot.measured_tensions() for _ in range(2000)])
    error = tensions - robot.tensions
    assert error.std(axis=0).mean() == pytest.approx(2.0, rel=0.05)
    assert error.mean(axis=0).std() == pytest.approx(3.0, rel=0.4)
    assert tensions.min() >= 0.0


@pytest.mark.parametrize(
    "departures",
    [(), actual(0), (EncoderError(noise=0.001),), (TensionSensorError(noise=2.0, offset=1.0),)],
    ids=["true", "actual", "noisy lengths", "noisy tensions"],
)
def test_both_sensors_read_as_one_after_the_other(departures: tuple[Departure, ...]) -> None:
    at_once, in_turn = (Robot(ELBOW, departures) for _ in range(2))
    for robot in (at_once, in_turn):
        robot.reset(np.array([0.7]), np.random.default_rng(3))
    for _ in range(3):
        lengths, tensions = at_once.read_sensors(at_once.measure())
        assert np.array_equal(lengths, in_turn.measured_lengths())
        assert np.array_equal(tensions, in_turn.measured_tensions())


def test_offsets_of_encoders_move_the_arm() -> None:
    """The controller holds the reading of the encoders, not the true length."""
    robot = Robot(ELBOW, (EncoderError(offset=0.003, seed=2),))
    nominal = NominalArm(ELBOW)
    robot.reset(np.array([1.0]), np.random.default_rng(0))
    robot.motors.set_stiffness(100_000.0, 20.0)
    target = nominal.lengths(np.array([1.0]))[0]
    settle(robot, target)
    pulls = robot.tensions > 21.0
    assert pulls.any()
    assert np.allclose(robot.measured_lengths()[pulls], target[pulls], atol=5e-3)
    assert abs(robot.joint_angles[0] - 1.0) > np.radians(1.0)


def test_slack_metrics() -> None:
    robot = Robot(ELBOW, (TendonStretch(1e-5),))
    robot.reset(np.array([1.0]), np.random.default_rng(0))
    target = robot.target
    assert np.all(robot.slack(target)[0] == 0.0)
    long = target + np.array([0.01, 0.0, 0.0])
    assert np.allclose(robot.slack(long)[1], [0.01, 0.0, 0.0], atol=1e-12)
    # A tendon that is elongated by 20 mm is slack until its motor has wound up the elongation.
    robot.elongate("biceps", 0.02)
    mujoco.mj_forward(robot.model, robot.data)
    assert robot.slack(target)[0][0] > 0.015
    assert np.all(robot.tensions[0] == 0.0)
    assert np.all(robot.slack(target)[0][1:] == 0.0)


@pytest.mark.parametrize("departures", [(), actual(2)], ids=["nominal", "actual"])
def test_the_bits_are_those_of_mj_step_alone(departures: tuple[Departure, ...]) -> None:
    """Also if the state is changed between two control periods."""
    robot, plain = Robot(ELBOW, departures), Robot(ELBOW, departures)
    for one in (robot, plain):
        one.reset(np.array([1.0]), np.random.default_rng(0))
    hinge = robot.model.joint("elbow").qposadr[0]
    for k in range(6):
        target = robot.target - 0.002 * k
        robot.step(target)
        plain.motors.command(plain._commanded(target))
        for _ in range(10):
            plain.motors.update_friction()
            mujoco.mj_step(plain.model, plain.data)
        assert np.array_equal(robot.data.qpos, plain.data.qpos), k
        assert np.array_equal(robot.data.qvel, plain.data.qvel), k
        if k == 2:
            robot.data.qpos[hinge] = plain.data.qpos[hinge] = 0.5
        if k == 3:
            robot.data.qvel[hinge] = plain.data.qvel[hinge] = 2.0


def test_the_elbow_alone_is_the_arms_elbow() -> None:
    """elbow.xml repeats numbers of arm.xml: positions, masses, tendons and joint agree."""
    arm, elbow = (mujoco.MjModel.from_xml_path(str(path)) for path in (ARM, ELBOW))
    whole, part = mujoco.MjData(arm), mujoco.MjData(elbow)
    hinge = arm.joint("elbow").qposadr[0]
    for angle in (0.0, 0.9):
        whole.qpos[hinge] = part.qpos[0] = angle
        mujoco.mj_forward(arm, whole)
        mujoco.mj_forward(elbow, part)
        for kind, count in (("body", elbow.nbody), ("geom", elbow.ngeom), ("site", elbow.nsite)):
            for i in range(count):
                name = getattr(elbow, kind)(i).name
                if kind == "geom" and not name:  # visuals have no name, but meshes of their own
                    mesh = elbow.mesh(int(elbow.geom_dataid[i])).name
                    (same,) = np.flatnonzero(arm.geom_dataid == arm.mesh(mesh).id)
                    ours, theirs = part.geom(i), whole.geom(int(same))
                else:
                    ours, theirs = getattr(part, kind)(name), getattr(whole, kind)(name)
                assert np.allclose(ours.xpos, theirs.xpos, atol=1e-12), name
                assert np.allclose(ours.xmat, theirs.xmat, atol=1e-12), name
        for i in range(elbow.ntendon):
            length = whole.ten_length[arm.tendon(elbow.tendon(i).name).id]
            assert part.ten_length[i] == pytest.approx(length, abs=1e-12)
        dof = arm.joint("elbow").dofadr[0]
        inertia = np.zeros((arm.nv, arm.nv)), np.zeros((1, 1))
        mujoco.mj_fullM(arm, whole, inertia[0])
        mujoco.mj_fullM(elbow, part, inertia[1])
        assert inertia[1][0, 0] == pytest.approx(inertia[0][dof, dof], rel=1e-9)
        assert part.qfrc_bias[0] == pytest.approx(whole.qfrc_bias[dof], rel=1e-9)
    for name in ("ulna", "radius", "wrist_link", "hand", "humerus", "scapula"):
        assert elbow.body(name).mass == pytest.approx(arm.body(name).mass)
    ours, theirs = elbow.joint("elbow"), arm.joint("elbow")
    for field in ("range", "damping", "armature", "axis"):
        assert np.array_equal(getattr(ours, field), getattr(theirs, field)), field
    assert {elbow.tendon(i).name for i in range(elbow.ntendon)} == {
        "biceps",
        "brachialis",
        "triceps",
    }


def test_a_start_beyond_the_stops_is_at_the_stops() -> None:
    robot = Robot(ELBOW)
    robot.reset(np.array([9.0]), np.random.default_rng(0))
    assert np.array_equal(robot.joint_angles, robot.upper)


def test_bad_input_is_named(tmp_path: Path) -> None:
    with pytest.raises(KengoroError, match=r"no model file at .*nowhere.xml"):
        Robot(tmp_path / "nowhere.xml")
    with pytest.raises(KengoroError, match=r"no model file at .*xxx"):
        Robot(tmp_path / ("x" * 5000))
    broken = tmp_path / "broken.xml"
    broken.write_text("<mujoco><worldbody><bod/></worldbody></mujoco>")
    with pytest.raises(KengoroError, match=r"broken\.xml does not compile: XML Error"):
        Robot(broken)
    with pytest.raises(KengoroError, match=r"control_period is 0.3, but must be from 0.001"):
        Robot(ELBOW, control_period=0.3)
    with pytest.raises(UnknownNameError, match="unknown muscle 'deltoid'; known: biceps"):
        Robot(ELBOW).elongate("deltoid", 0.01)

"""The grasp is physical: the hand on a soft rig lifts the can, and so does the nominal arm."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from kengoro_env.assets import asset_path
from kengoro_env.names import FINGER_JOINTS, JOINTS
from kengoro_env.postures import RANGES_DEG
from kengoro_env.robot.fingers import FINGERS, add_fingers
from kengoro_env.robot.model_file import load_spec
from kengoro_env.robot.muscle_law import Gains
from kengoro_env.robot.nominal_model import NominalArm
from kengoro_env.robot.robot import Robot
from kengoro_env.stepping.tracked_object import TrackedObject
from kengoro_env.tasks.lift_monitor import LIFT_TIME, LiftMonitor
from kengoro_env.types import Floats

SCENE = asset_path("mjcf/kengoro_arm/can_grasp.xml")
ARM = asset_path("mjcf/kengoro_arm/arm.xml")
CAN_HEIGHT = -0.3225  # of a standing can's centre [m]
STAND_OFF = np.array([0.0, -0.94, 0.33])  # from where the hand comes, in its own frame
ABOVE = 0.010  # the grip point is aimed this far above the can's centre [m]
STEP = 0.002
RIG = ("x", "y", "z", "roll", "pitch", "yaw")


# --- the hand alone, carried by springs as soft as the arm ---------------------------------------


@pytest.fixture(scope="module")
def rig() -> mujoco.MjModel:
    """The can's scene with the hand on six springs instead of the robot: 700 N/m, 12 N m/rad."""
    scene, arm = load_spec(SCENE), load_spec(ARM)
    for spec in (scene, arm):
        for tendon in list(spec.tendons):
            spec.delete(tendon)
    scene.delete(scene.body("thorax"))
    arm.delete(arm.joint("wrist_dev"))
    base = scene.worldbody.add_body(name="base", gravcomp=1.0, mass=0.9, inertia=np.full(3, 1e-3))
    base.explicitinertial = True
    for index, name in enumerate(RIG):
        slides = index < 3
        base.add_joint(
            name=name,
            type=mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE,
            axis=np.eye(3)[index % 3],
            stiffness=np.array([700.0 if slides else 12.0, 0.0, 0.0]),
            damping=np.array([40.0 if slides else 0.5, 0.0, 0.0]),
        )
    # Thumb up, palm to the left, fingers forward.
    frame = base.add_frame(quat=np.sqrt([0.5, 0.0, 0.5, 0.0]) * [1.0, 0.0, -1.0, 0.0])
    frame.attach_body(arm.body("hand"), "rig_", "")
    for joint in FINGER_JOINTS:
        scene.joint(f"rig_{joint}").name = joint
    for body in ("hand", "fingers_proximal"):
        scene.body(f"rig_{body}").name = body
    scene.site("rig_grip").name = "grip"
    add_fingers(scene)
    return scene.compile()


def grasp(
    rig: mujoco.MjModel,
    error: Sequence[float] | Floats = (0.0, 0.0, 0.0),
    tilt: Sequence[float] | Floats = (0.0, 0.0, 0.0),
    close: float = 1.0,
) -> tuple[LiftMonitor, mujoco.MjData]:
    """Approach, close, lift by 80 mm and hold, with the grip point displaced and the hand tilted.

    Args:
        error: of the grip point [m], forward, to the left, up.
        tilt: of the hand about the same axes [deg].
        close: command to the fingers when they close.
    """
    data = mujoco.MjData(rig)
    mujoco.mj_forward(rig, data)
    grip = data.site("grip").xpos.copy()
    stands = data.body("can").xpos.copy()
    turn = np.radians(tilt)
    goal = stands + error + [0.0, 0.0, ABOVE] - Rotation.from_euler("XYZ", turn).apply(grip)
    away = 0.12 * np.array([-STAND_OFF[2], STAND_OFF[1], 0.0])
    first = rig.joint("x").qposadr[0]
    springs = rig.qpos_spring
    springs[first + 3 : first + 6] = turn
    data.qpos[first : first + 6] = [*(goal + away), *turn]
    mujoco.mj_forward(rig, data)
    can = TrackedObject(rig, "can")
    monitor = LiftMonitor(can.observe(data), data.time)
    for step in range(round(4.4 / STEP)):
        time = step * STEP
        rise = np.interp(time, [2.2, 3.0], [0.0, 0.08])
        springs[first : first + 3] = goal + max(0.0, 1.0 - time) * away + [0.0, 0.0, rise]
        data.ctrl[rig.actuator(FINGERS).id] = -1.0 if time < 1.2 else close
        mujoco.mj_step(rig, data)
        if step % 10 == 9:
            monitor.update(can.observe(data), data.time)
    return monitor, data


def force_on_can(model: mujoco.MjModel, data: mujoco.MjData, part: str) -> float:
    """Normal force [N] with which the geoms named ``part`` press the can."""
    force, total, can = np.zeros(6), 0.0, model.geom("can").id
    for index, contact in enumerate(data.contact):
        if can in contact.geom:
            other = contact.geom[0] if contact.geom[1] == can else contact.geom[1]
            mujoco.mj_contactForce(model, data, index, force)
            total += force[0] if part in model.geom(other).name else 0.0
    return total


def test_can_hand_and_friction_are_as_promised() -> None:
    """66 x 115 mm, 0.1 kg or more; friction at most 1; nothing that sticks."""
    model = mujoco.MjModel.from_xml_path(str(SCENE))
    can = model.geom("can")
    np.testing.assert_allclose(2 * can.size[:2], [0.066, 0.115])
    assert model.body("can").mass[0] >= 0.1
    assert model.geom_friction.max() <= 1.0
    assert model.neq == 0
    robot = Robot(SCENE).model
    assert robot.neq == 0
    assert np.all(robot.actuator_trntype != mujoco.mjtTrn.mjTRN_BODY)  # adhesion


def test_the_hand_opens_no_wider_than_120_mm(rig: mujoco.MjModel) -> None:
    data = mujoco.MjData(rig)
    mujoco.mj_forward(rig, data)

    def tip(name: str) -> Floats:
        geom, half = data.geom(name), rig.geom(name).size[1]
        return geom.xpos + half * geom.xmat.reshape(3, 3)[:, 2]

    thumb = tip("rig_thumb_distal")
    for finger in ("index", "middle", "ring", "little"):
        assert 0.09 < np.linalg.norm(tip(f"rig_{finger}_tip") - thumb) <= 0.120


def test_the_hand_lifts_the_can_and_holds_it_still(rig: mujoco.MjModel) -> None:
    monitor, data = grasp(rig)
    assert monitor.grasped
    assert monitor.lifted
    assert monitor.rise == pytest.approx(0.08, abs=0.02)
    assert 10.0 < force_on_can(rig, data, "thumb") < 40.0
    assert 10.0 < sum(force_on_can(rig, data, f"_{p}") for p in ("proximal", "tip")) < 40.0
    fingers = [rig.joint(joint).dofadr[0] for joint in FINGER_JOINTS]
    assert np.abs(data.qvel[fingers]).max() < 0.1


def test_the_hand_forgives_30_mm_and_10_degrees(rig: mujoco.MjModel) -> None:
    """Grip point wrong by up to 30 mm sideways and 25 mm in height, hand by 10 deg each way."""
    rng = np.random.default_rng(0)
    lifted = []
    for _ in range(20):
        distance, angle = 0.030 * np.sqrt(rng.uniform()), rng.uniform(0, 2 * np.pi)
        error = (distance * np.cos(angle), distance * np.sin(angle), rng.uniform(-0.025, 0.025))
        lifted.append(grasp(rig, error, rng.uniform(-10, 10, 3))[0].lifted)
    assert np.mean(lifted) >= 0.9


@pytest.mark.parametrize("error", [(-0.10, 0.0, 0.0), (0.10, 0.0, 0.0), (0.0, -0.09, 0.0)])
def test_a_hand_that_is_far_off_lifts_nothing(
    rig: mujoco.MjModel, error: tuple[float, float, float]
) -> None:
    monitor, _ = grasp(rig, error)
    assert not monitor.lifted


@pytest.mark.parametrize("close", [-1.0, -0.9])
def test_open_fingers_lift_nothing(rig: mujoco.MjModel, close: float) -> None:
    monitor, _ = grasp(rig, close=close)
    assert not monitor.lifted


def test_fingers_follow_their_command(rig: mujoco.MjModel) -> None:
    """-1 opens, +1 makes a fist, and the hand opens again."""
    data = mujoco.MjData(rig)
    data.joint("x").qpos[0] = -0.5  # away from the can
    rig.qpos_spring[rig.joint("x").qposadr[0]] = -0.5
    coupling = []
    for command in (-1.0, -0.5, 0.0, 1.0, -1.0):
        data.ctrl[rig.actuator(FINGERS).id] = command
        mujoco.mj_step(rig, data, 1000)
        coupling.append(data.tendon(FINGERS).length[0])
    rig.qpos_spring[rig.joint("x").qposadr[0]] = 0.0
    opened, quarter, half, fist, again = coupling
    assert abs(opened) < 0.05
    assert abs(again) < 0.05
    assert 0.3 < quarter < half - 0.3 < fist - 0.6


# --- what lifts it? ------------------------------------------------------------------------------


def carried(body: str, tilt: float = 0.0, seconds: float = 1.5) -> LiftMonitor:
    """A can that is set 50 mm up, for a while, and a ball on ``body`` (if any) that touches it."""
    pose = [np.cos(tilt / 2), np.sin(tilt / 2), 0.0, 0.0]
    spec = load_spec(SCENE)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    below = data.body("can").xpos + np.array([0.0, 0.0, 0.05 - 0.0575 - 0.009])
    if body:
        parent = data.body(body)
        spec.body(body).add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=np.full(3, 0.01),
            pos=parent.xmat.reshape(3, 3).T @ (below - parent.xpos),
            contype=3,
            conaffinity=3,
        )
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
    data.time = 10.0
    can = TrackedObject(model, "can")
    monitor = LiftMonitor(can.observe(data), data.time)
    data.joint("can").qpos[2] += 0.05
    data.joint("can").qpos[3:] = pose
    mujoco.mj_forward(model, data)
    assert bool(can.observe(data).touched) == bool(body)
    for _ in range(round(seconds / 0.02)):
        data.time += 0.02
        monitor.update(can.observe(data), data.time)
    return monitor


def test_carried_by_the_hand_counts() -> None:
    monitor = carried("hand")
    assert monitor.lifted
    assert monitor.rise == pytest.approx(0.05)


def test_too_short_does_not_count() -> None:
    assert not carried("hand", seconds=LIFT_TIME - 0.1).lifted


def test_not_upright_does_not_count() -> None:
    assert not carried("hand", tilt=np.radians(40.0)).lifted


@pytest.mark.parametrize("body", ["", "world", "ulna"])
def test_carried_by_anything_else_does_not_count(body: str) -> None:
    monitor = carried(body)
    assert monitor.rise == pytest.approx(0.05)
    assert not monitor.lifted


# --- the whole nominal arm -----------------------------------------------------------------------


class Reach:
    """Postures by least squares on the nominal model: thumb up, grip point at a position."""

    def __init__(self) -> None:
        self.model = mujoco.MjModel.from_xml_path(str(SCENE))
        self.data = mujoco.MjData(self.model)
        self.address = [self.model.joint(joint).qposadr[0] for joint in JOINTS]
        self.low, self.high = np.radians([RANGES_DEG[joint] for joint in JOINTS]).T

    def hand(self, posture: Floats) -> tuple[Floats, Floats]:
        """Grip point (3,) and orientation of the hand (3, 3)."""
        self.data.qpos[self.address] = posture
        mujoco.mj_kinematics(self.model, self.data)
        grip, hand = self.data.site("grip"), self.data.body("hand")
        return grip.xpos.copy(), hand.xmat.reshape(3, 3).copy()

    def __call__(self, grip: Floats, near: Floats, turn: Floats | None = None) -> Floats:
        """The posture near ``near`` (14,) that brings the grip point there, within the ranges."""
        span = self.high - self.low

        def residual(posture: Floats) -> Floats:
            position, matrix = self.hand(posture)
            wrong = 3.0 * matrix[:2, 0] if turn is None else 10.0 * (matrix - turn).ravel()
            return np.concatenate([(position - grip) / 0.005, wrong, 0.2 * (posture - near) / span])

        start = np.clip(near, self.low + 1e-6, self.high - 1e-6)
        return least_squares(residual, start, bounds=(self.low, self.high)).x


@pytest.fixture(scope="module")
def reach() -> Reach:
    return Reach()


@pytest.mark.parametrize("standing", [(0.30, -0.30), (0.32, 0.0), (0.40, -0.15), (0.46, -0.28)])
def test_the_nominal_arm_lifts_the_can(reach: Reach, standing: tuple[float, float]) -> None:
    can = np.array([*standing, CAN_HEIGHT])
    grip = can + np.array([0.0, 0.0, ABOVE])
    at = reach(grip, (reach.low + reach.high) / 2)
    position, turn = reach.hand(at)
    np.testing.assert_allclose(position, grip, atol=0.005)
    away = 0.11 * turn @ STAND_OFF
    before, half = (reach(grip + share * away, at, turn) for share in (1.0, 0.5))
    up = reach(grip + np.array([0.0, 0.0, 0.07]), at, turn)

    robot = Robot(SCENE, gains=Gains(40_000.0, 30.0))
    robot.reset(before, np.random.default_rng(0))
    robot.data.joint("can").qpos[:2] = standing
    mujoco.mj_forward(robot.model, robot.data)
    tracked = TrackedObject(robot.model, "can")
    monitor = LiftMonitor(tracked.observe(robot.data), robot.time)
    nominal = NominalArm(SCENE)
    path = np.array([before, before, half, at, at, at, up, up])
    for time in np.arange(0.0, 7.5, robot.control_period):
        keys = [0.0, 1.0, 2.0, 3.0, 3.4, 4.2, 5.8, 7.5]
        posture = np.array([np.interp(time, keys, angles) for angles in path.T])
        robot.close_fingers(-1.0 if time < 3.4 else 1.0)
        robot.step(nominal.lengths(posture)[0])
        monitor.update(tracked.observe(robot.data), robot.time)
    assert monitor.lifted
    assert robot.tensions.max() < 300.0

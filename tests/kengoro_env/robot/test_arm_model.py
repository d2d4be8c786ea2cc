"""The compiled arm against the numbers of its sources (assets/mjcf/kengoro_arm/README.md)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest

from kengoro_env.assets import asset_path
from kengoro_env.departures import AttachmentDisplacement, BoneWrapping
from kengoro_env.names import FINGER_JOINTS, GROUP_JOINTS, JOINTS
from kengoro_env.postures import least_tension
from kengoro_env.robot.nominal_model import NominalArm
from kengoro_env.robot.robot import Robot
from kengoro_env.types import Floats

ARM = Path("mjcf/kengoro_arm/arm.xml")

CENTRES = {  # joint centres in the frame of the bone before, Kengoro's size [m]
    "neck_yaw_link": (-0.045, 0.0, 0.055),
    "sc_roll_link": (0.0072, -0.0292, 0.0079),
    "ac_roll_link": (-0.0733, -0.1226, 0.0124),
    "sh_pitch_link": (0.0188, -0.0213, -0.0388),
    "ulna": (0.0057, 0.0114, -0.2698),
    "radius": (0.0005, -0.0226, -0.0130),
    "wrist_link": (0.0204, -0.0283, -0.2737),
}
MASSES = {"clavicle": 0.19, "scapula": 0.50, "humerus": 1.58, "ulna": 0.50, "radius": 0.40}
RANGES = {  # [deg]
    "neck_yaw": (-45, 45),
    "neck_pitch": (-20, 35),
    "neck_roll": (-20, 20),
    "sc_roll": (-30, 5),
    "sc_yaw": (-20, 20),
    "ac_roll": (-20, 10),
    "ac_pitch": (-15, 15),
    "sh_pitch": (-120, 30),
    "sh_roll": (-90, 10),
    "sh_yaw": (-60, 60),
    "elbow": (0, 120),
    "radioulnar": (-60, 60),
    "wrist_flex": (-50, 50),
    "wrist_dev": (-20, 25),
}
IJ_HEIGHT = 1.297


@pytest.fixture(scope="module")
def nominal() -> NominalArm:
    return NominalArm(asset_path(str(ARM)))


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(asset_path(str(ARM))))


@pytest.fixture(scope="module")
def hanging(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data


@pytest.mark.parametrize("body", CENTRES)
def test_joint_centres(model: mujoco.MjModel, body: str) -> None:
    np.testing.assert_allclose(model.body(body).pos, CENTRES[body], atol=1e-12)


def test_all_frames_are_parallel_to_the_thorax_when_the_arm_hangs(
    model: mujoco.MjModel, hanging: mujoco.MjData
) -> None:
    for body in ("head", "clavicle", "scapula", "humerus", "ulna", "radius", "hand"):
        np.testing.assert_allclose(hanging.body(body).xmat.reshape(3, 3), np.eye(3), atol=1e-12)


def test_link_lengths(hanging: mujoco.MjData) -> None:
    """Asano et al. 2017, Table 1: upper arm 270 mm, forearm 292 mm."""
    shoulder, elbow, wrist = (hanging.body(b).xpos for b in ("humerus", "ulna", "hand"))
    assert np.linalg.norm(elbow - shoulder) == pytest.approx(0.270, abs=0.0005)
    assert np.linalg.norm(wrist - elbow) == pytest.approx(0.292, abs=0.0005)


@pytest.mark.parametrize("finger", ["index", "middle", "ring", "little"])
def test_hand_is_at_most_as_long_as_kengoros(model: mujoco.MjModel, finger: str) -> None:
    """161 mm from the wrist to the tip of a straight finger (Table 1)."""
    parts = [model.geom(f"{finger}_{part}") for part in ("proximal", "distal", "tip")]
    straight = sum(2 * part.size[1] for part in parts) + parts[-1].size[0]
    assert 0.150 < straight - model.body("fingers_proximal").pos[2] <= 0.161 + 1e-9


def test_eye_height(hanging: mujoco.MjData) -> None:
    assert hanging.camera("eye").xpos[2] + IJ_HEIGHT == pytest.approx(1.540, abs=0.001)


@pytest.mark.parametrize("body", MASSES)
def test_masses(model: mujoco.MjModel, body: str) -> None:
    assert model.body(body).mass[0] == pytest.approx(MASSES[body])


def test_masses_of_hand_and_head(model: mujoco.MjModel) -> None:
    assert model.body_subtreemass[model.body("hand").id] == pytest.approx(0.34)
    assert model.body("head").mass[0] == pytest.approx(4.0)


def test_joints(model: mujoco.MjModel) -> None:
    names = {model.joint(i).name for i in range(model.njnt)}
    assert names == {*JOINTS, *FINGER_JOINTS}
    for joint, limits in RANGES.items():
        np.testing.assert_allclose(np.degrees(model.joint(joint).range), limits, atol=1e-9)


def test_every_joint_has_a_body_of_its_own(model: mujoco.MjModel) -> None:
    """Pinocchio would merge the joints of one body."""
    assert len(set(model.jnt_bodyid)) == model.njnt


def test_tendons_by_group(nominal: NominalArm) -> None:
    """36 tendons: 8 neck, 10 scapula, 10 shoulder, 8 forearm; the shoulder's map has 8 inputs."""
    groups = list(GROUP_JOINTS)
    group_of_joint = [g for g, joints in enumerate(GROUP_JOINTS.values()) for _ in joints]
    most_distal = [max(np.array(group_of_joint)[row]) for row in nominal.crosses]
    counts = {group: most_distal.count(g) for g, group in enumerate(groups)}
    assert counts == {"neck": 8, "scapula": 10, "shoulder": 10, "forearm": 8}
    shoulder = nominal.crosses[np.array(most_distal) == groups.index("shoulder")].any(axis=0)
    inputs = [joint for joint, crossed in zip(nominal.joints, shoulder, strict=True) if crossed]
    assert inputs == [*GROUP_JOINTS["scapula"], *GROUP_JOINTS["shoulder"]]


def test_tendons_of_the_elbow(nominal: NominalArm) -> None:
    crossing = nominal.crosses[:, nominal.joints.index("elbow")]
    names = {muscle for muscle, c in zip(nominal.muscles, crossing, strict=True) if c}
    assert names == {"brachialis", "biceps", "triceps"}


def test_the_arm_holds_itself_with_tensions_of_5_to_400_newtons(nominal: NominalArm) -> None:
    """At 99 % or more of 1000 random postures within the joint ranges."""
    rng = np.random.default_rng(0)
    postures = rng.uniform(nominal.lower, nominal.upper, (1000, len(nominal.joints)))
    held = [
        least_tension(nominal.moment_arms(q), nominal.gravity(q), least=5.0, most=400.0) <= 400.0
        for q in postures
    ]
    assert np.mean(held) >= 0.99


def wrapped_arms(seed: int) -> Callable[[Floats], Floats]:
    """dl/dq (m, n) [m/rad] of a robot whose displaced tendons wrap over its bones."""
    departures = (AttachmentDisplacement(sigma=0.004, seed=seed), BoneWrapping(scale=1.0))
    robot = Robot(asset_path(str(ARM)), departures)
    model, data = robot.model, robot.data
    position = [model.joint(joint).qposadr[0] for joint in robot.joints]
    velocity = [model.joint(joint).dofadr[0] for joint in robot.joints]
    tendons = [model.tendon(muscle).id for muscle in robot.muscles]

    def arms(posture: Floats) -> Floats:
        data.qpos[position] = posture
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_tendon(model, data)
        dense = np.zeros((model.ntendon, model.nv))
        mujoco.mju_sparse2dense(
            dense, data.ten_J, model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind
        )
        return dense[np.ix_(tendons, velocity)]

    return arms


def steps(arms: Callable[[Floats], Floats], line: Floats) -> Floats:
    """Largest change (m, n) of each moment arm between neighbours on a line (k, n)."""
    return np.abs(np.diff([arms(q) for q in line], axis=0)).max(axis=0)


@pytest.mark.parametrize("joint", range(len(JOINTS)), ids=JOINTS)
@pytest.mark.parametrize("robot", ["nominal", "wrapped"])
def test_moment_arms_are_continuous(
    nominal: NominalArm, robot: str, joint: int, wrapped: Callable[[Floats], Floats]
) -> None:
    """On a grid 16 times as fine dl/dq changes at least 4 times less from point to point.

    A jump, as of a tendon that snaps over a bone, stays as large as it is.
    """
    arms = nominal.moment_arms if robot == "nominal" else wrapped
    rng = np.random.default_rng(joint)
    for base in rng.uniform(nominal.lower, nominal.upper, (3, len(JOINTS))):
        line = np.repeat(base[None], 60 * 16 + 1, axis=0)
        line[:, joint] = np.linspace(nominal.lower[joint], nominal.upper[joint], len(line))
        fine, coarse = steps(arms, line), steps(arms, line[::16])
        assert np.all(fine < np.maximum(coarse / 4, 1e-6)), f"jump of {fine.max() * 1e3:.2f} mm/rad"


@pytest.fixture(scope="module")
def wrapped() -> Callable[[Floats], Floats]:
    return wrapped_arms(seed=0)

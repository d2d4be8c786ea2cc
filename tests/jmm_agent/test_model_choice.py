"""Bones that are not those of the model are found from looks at the hand."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.learning.job import LearningJob, MapLearning
from jmm_agent.types import Floats
from jmm_agent.updaters import AntagonismOptions, AntagonismUpdater
from jmm_agent.updaters.vision_options import VisionOptions
from jmm_agent.vision.camera_unknowns import NOT_UNKNOWN
from jmm_agent.vision.marker_residual import MarkerResidual
from jmm_agent.vision.pose_errors import JointPrior
from tests.jmm_agent.small_robot import SmallRobot

AXES = "0 0 1", "0 1 0", "1 0 0", "0 1 0", "0 0 1"
JOINTS = tuple(f"j{number}" for number in range(len(AXES)))


def chain(path: Path, size: float, distance: float, angle: float, seed: int) -> ArmKinematics:
    """Kinematics of five hinges; each is moved by a distance [m] and turned by an angle [rad]."""
    body = f"<site name='tip' pos='{0.1 * size} 0 0'/>"
    for name, axis in reversed(list(zip(JOINTS, AXES, strict=True))):
        body = (
            f"<body name='{name}_body' pos='{0.12 * size} 0 0'><joint name='{name}' axis='{axis}' "
            f"range='-57 57'/><geom size='{0.01 * size}'/>{body}</body>"
        )
    spec = mujoco.MjSpec.from_string(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    rng = np.random.default_rng([seed, 31])
    for joint in spec.joints:
        step, across = rng.standard_normal(3), np.cross(joint.axis, rng.standard_normal(3))
        joint.parent.pos = joint.parent.pos + distance * step / np.linalg.norm(step)
        joint.axis = np.cos(angle) * joint.axis + np.sin(angle) * across / np.linalg.norm(across)
    spec.compile()
    path.write_text(spec.to_xml())
    return ArmKinematics(path, JOINTS)


class Chain(SmallRobot):
    """Five hinges that are not where they are drawn."""

    def __init__(self, folder: Path, size: float, seed: int, off: float) -> None:
        nominal = chain(folder / "nominal.xml", size, 0.0, 0.0, seed)
        self.misses = 0.0  # by how much the camera is wrong [m]
        self.actual = chain(folder / "actual.xml", size, 0.005 * off * size, 0.05 * off, seed)
        usual = VisionOptions()
        super().__init__(
            size=size,
            seed=seed,
            residual=MarkerResidual(nominal, None, "tip"),
            camera=NOT_UNKNOWN,
            misplaced=JointPrior(size * usual.misplaced.offset, usual.misplaced.turn),
        )

    def pose(self, q: Floats) -> Floats:
        """Pose of the tip, with noise."""
        pose = self.actual.pose("tip", q)
        wrong = self.rng.normal(size=3)
        pose[:3, 3] += self.misses * wrong / np.linalg.norm(wrong)
        pose[:3, 3] += self.rng.normal(0.0, 0.001 * self.size, 3)
        return pose


@pytest.mark.parametrize(
    ("size", "seed"), [(1.0, 0), pytest.param(1.0, 1, marks=pytest.mark.slow), (0.3, 2)]
)
def test_bones_that_do_not_fit_are_found(tmp_path: Path, size: float, seed: int) -> None:
    robot = Chain(tmp_path, size, seed, 2.0)
    robot.observe_several(20)
    joints = robot.vision.memory.rests.joints
    assert joints is not None
    assert joints.turn >= 0.035


@pytest.mark.parametrize(("size", "seed"), [(1.0, 3), (0.3, 4), (1.0, 5)])
def test_bones_that_fit_are_not_named(tmp_path: Path, size: float, seed: int) -> None:
    robot = Chain(tmp_path, size, seed, 0.0)
    robot.observe_several(20)
    assert robot.vision.memory.rests.joints is None


def test_bones_are_still_known_without_a_muscle_that_snapped(tmp_path: Path) -> None:
    robot = Chain(tmp_path, 1.0, 0, 3.0)
    robot.observe_several(18)
    used = np.arange(len(robot.map.muscles)) != 2
    before = np.linalg.norm(robot.error()[used])
    robot.vision.rewire(robot.vision.assignment._replace(left_out=(2,)))
    joints = robot.vision.memory.rests.joints
    assert joints is not None
    assert joints.turn >= 0.035
    assert np.linalg.norm(robot.error()[used]) < 1.5 * before


@pytest.mark.parametrize(
    ("seed", "off"), [(1, 3.0), pytest.param(2, 4.0, marks=pytest.mark.slow), (2, 6.0)]
)
def test_bones_that_make_observations_impossible_are_found_all_the_same(
    tmp_path: Path, seed: int, off: float
) -> None:
    robot = Chain(tmp_path, 1.0, seed, off)
    robot.observe_several(20)
    joints = robot.vision.memory.rests.joints
    assert joints is not None
    assert joints.turn >= 0.035
    assert len(robot.vision.memory.observations) >= 18


@pytest.mark.parametrize("seed", [3, 4])
@pytest.mark.parametrize("distance", [0.06, 0.15])
def test_wrong_observations_are_no_sign_of_other_bones(
    tmp_path: Path, seed: int, distance: float
) -> None:
    robot = Chain(tmp_path, 1.0, seed, 0.0)
    robot.observe_several(6)
    for _ in range(6):
        robot.misses = distance
        robot.observe()
        robot.misses = 0.0
        robot.observe()
    joints = robot.vision.memory.rests.joints
    assert joints is None or not joints.enabled
    assert len(robot.vision.memory.observations) <= 14  # the first may be believed


def test_jobs_of_learning_find_bones_that_make_observations_impossible(tmp_path: Path) -> None:
    """The state of learning is sent to and fro, as between processes."""
    robot = Chain(tmp_path, 1.0, 2, 4.0)
    antagonism = AntagonismUpdater(robot.learner, AntagonismOptions())
    learning, nothing = (
        MapLearning(robot.learner, antagonism, robot.vision, False),
        np.full(14, np.nan),
    )
    state = learning.state
    for number, q in enumerate(robot.postures(12)):
        lengths, guess = robot.read(q), q + robot.rng.normal(0.0, 0.1, len(q))
        job = LearningJob("vision", 3.0 * number, guess, lengths, lengths, nothing, robot.pose(q))
        result = learning.run(job, state)
        assert result.state is not None
        state = result.state
    joints = state.vision.rests.joints
    assert joints is not None
    assert joints.enabled
    assert len(state.vision.observations) >= 8

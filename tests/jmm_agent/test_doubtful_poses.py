"""Poses with large covariances, poses of another time, and poses that no posture reaches."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.updaters.observation_check import UNCERTAIN, UNREACHED
from jmm_agent.vision.marker_observation import MarkerObservation, adds_only_noise
from jmm_agent.vision.pose_clock import PoseClock
from tests.jmm_agent.nominal_arm import posture_set
from tests.jmm_agent.tracked_arm import MOCAP, TrackedArm

POSTURES = posture_set()[1:6]


def test_a_covariance_with_little_information_does_not_make_the_map_worse(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    noise = np.repeat([0.1, 0.3], 3)
    tracked = TrackedArm(nominal_map, arm, sees=False, noise=noise, learn_antagonism=False)
    before = tracked.error
    tracked.visit(*POSTURES[:4])
    assert tracked.agent.vision.fired == 0
    assert tracked.error <= before
    assert tracked.agent.vision.dropped[UNCERTAIN] == 4


@pytest.mark.parametrize("angles", [None, np.array([0.1, np.nan])])
def test_an_uncertain_pose_with_joint_encoders_is_kept(angles: np.ndarray | None) -> None:
    def agrees(q: np.ndarray, *of: object) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(6), np.zeros((6, 2))

    noise = np.diag(np.repeat([0.1, 0.3], 3) ** 2)
    found = MarkerObservation(np.eye(4), np.zeros(3), np.zeros(2), None, noise, angles)
    assert adds_only_noise(found, agrees, 0.003, 0.01) is (angles is None)


def test_an_uncertain_pose_that_contradicts_the_estimate_is_learned_from(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    tracked = TrackedArm(nominal_map, arm, sees=False, noise=10.0 * MOCAP, learn_antagonism=False)
    before = tracked.error
    tracked.visit(*POSTURES[:3])
    assert tracked.agent.vision.fired > 0
    assert tracked.error < before


@pytest.mark.parametrize("away", [(0.5, 0.0, 0.0), (0.0, 0.5, 0.0), (0.0, 0.0, -0.5)])
def test_a_first_pose_that_no_posture_reaches_is_refused_on_a_redundant_arm(
    nominal_map: JointMuscleMap, arm: ArmKinematics, away: tuple[float, float, float]
) -> None:
    def moved(time: float, pose: np.ndarray) -> np.ndarray:
        pose[:3, 3] += away
        return pose

    tracked = TrackedArm(nominal_map, arm, sees=False, disturb=moved, learn_antagonism=False)
    tracked.visit(POSTURES[0])
    assert tracked.agent.vision.fired == 0
    assert tracked.agent.map is nominal_map
    assert tracked.agent.vision.dropped[UNREACHED] == 1
    assert tracked.agent.seen is not None
    assert "the last pose is 0." in tracked.agent.seen.detail


def clock_after(offset: float, movements: int = 6) -> PoseClock:
    """A clock that has seen movements by stamps that are late by an offset [s]."""
    rng = np.random.default_rng(0)
    goals = rng.normal(0.0, 0.2, (movements + 1, 3))

    def position(time: float) -> np.ndarray:
        number = int(np.clip(time // 2.0, 0, movements - 1))
        share = np.clip(time - 2.0 * number, 0.0, 1.0)
        move = goals[number + 1] - goals[number]
        return np.asarray(goals[number] + share**2 * (3.0 - 2.0 * share) * move)

    clock = PoseClock(0.003)
    for step in range(100 * movements):
        time = 0.02 * step
        clock.expect(time, 1.1 * position(time) + [0.0, 0.02, 0.0])
        measured = time if offset < 0.0 else time - offset
        clock.add(measured + offset, position(measured) + rng.normal(0.0, 0.001, 3))
        if step % 100 == 75:
            clock.end_movement()
    return clock


@pytest.mark.parametrize("offset", [-1.8, -0.5, -0.2, 0.2, 0.5, 1.3])
def test_a_trackers_clock_that_is_wrong_is_named_with_the_offset(offset: float) -> None:
    how = "late" if offset > 0.0 else "early"
    assert f"are {abs(offset):.1f}" in clock_after(offset).problem()
    assert f"s too {how}" in clock_after(offset).problem()


@pytest.mark.parametrize("offset", [-0.08, 0.0, 0.06])
def test_small_offsets_are_not_named(offset: float) -> None:
    assert clock_after(offset).problem() == ""


def test_too_few_movements_name_nothing() -> None:
    assert clock_after(0.5, movements=2).problem() == ""


def test_an_agent_names_a_trackers_wrong_clock(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    class Early(TrackedArm):
        def step(self, q: np.ndarray, **more: object) -> None:
            super(TrackedArm, self).step(q, **more)
            stamp = self.time - 0.5
            if stamp > 0.0:
                self.agent.observe(self.pose(self.time), np.diag(MOCAP**2), stamp, "hand")

    tracked = Early(nominal_map, arm, sees=False, learn_antagonism=False)
    tracked.visit(*POSTURES)
    [fault] = [fault for fault in tracked.agent.faults if fault.kind == "tracker_clock"]
    assert fault.where == "tracker"
    assert "too early" in fault.detail

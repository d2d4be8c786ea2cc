"""An agent by clocks that repeat, go back and are set: it goes on, learns, and says what is wrong.

The robot is that of `test_agent`: the nominal model, whose lengths were zeroed at another posture.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from jmm_agent.guard.faults import (
    CLOCK_JUMPED,
    NO_FRAME,
    NOTHING_LEARNED,
    STAMPS_SKIPPED,
    MotorControl,
)
from jmm_agent.guard.guard import Guard
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.learning_monitor import LearningMonitorOptions
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.observation import SensorReadings
from jmm_agent.vision.marker_detector import Detections, Skip
from tests.jmm_agent.nominal_arm import posture_set
from tests.jmm_agent.test_agent import CALM, CAMERA, Trial

FIRST, SECOND, THIRD, FOURTH = posture_set()[1:5]


class Clocked(Trial):
    """A trial whose clock a test sets; frames have the same clock."""

    offset = 0.0
    still = False
    number = 0

    def readings(self, **more: Any) -> SensorReadings:
        readings = super().readings(**more)
        self.number += 1
        return readings._replace(
            time=readings.time + self.offset,
            frame_time=readings.frame_time + self.offset,
            frame=None if self.frame is None else self.frame + np.uint8(self.number % 7),
        )

    def rest(self, q: np.ndarray, steps: int = 60) -> np.ndarray:
        """Move to a posture, and hold it for some steps; the last command."""
        for share in np.linspace(0.0, 1.0, 25)[1:] if np.any(q != self.q) else ():
            self.q = self.q + share * (q - self.q)
            self.step()
        return super().rest(q, steps)

    @property
    def kinds(self) -> list[str]:
        return [fault.kind for fault in self.agent.faults]


def test_repeated_and_backward_stamps_are_skipped_and_the_last_command_holds(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial, clean = Clocked(nominal_map, arm), Clocked(nominal_map, arm)
    for each in (trial, clean):
        each.rest(FIRST, 10)
    last = trial.step()
    np.testing.assert_array_equal(clean.step(), last)
    estimate = trial.agent.joint_angles
    for back in (0.02, 0.03, 0.3, 1e9):
        wrong = trial.readings(lengths=np.full(36, 7.0), tensions=np.zeros(36))
        command = trial.agent.step(wrong._replace(time=wrong.time - back))
        np.testing.assert_array_equal(command, last)
        command[:] = 0.0  # the caller may change it
    assert trial.agent.time_line.skipped == 4
    np.testing.assert_array_equal(trial.agent.joint_angles, estimate)
    for each in (trial, clean):
        each.visit(FIRST, SECOND)
    assert trial.same_map(clean.agent.map)
    assert trial.agent.faults == []


@pytest.mark.parametrize("by", [-3600.0, 3600.0])
@pytest.mark.parametrize("guarded", [False, True])
def test_after_the_clock_was_set_it_is_named_and_learning_goes_on(
    by: float, guarded: bool, nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Clocked(nominal_map, arm)
    trial.offset = 1.7e9
    if guarded:
        trial.agent.guard = Guard(nominal_map.muscles, arm, CAMERA, None, MotorControl())
        trial.agent.begin_episode()
    trial.rest(FIRST, 80)
    assert (trial.agent.vision.fired, trial.kinds) == (1, [])
    trial.agent.go(SECOND, 1.0)
    before = [trial.step() for _ in range(5)][-1]
    trial.offset += by
    after = [trial.step() for _ in range(15)][-1]
    assert trial.kinds == [CLOCK_JUMPED]
    jump = float(trial.agent.faults[0].detail.split()[-2])
    assert jump == pytest.approx(by, abs=0.3)
    assert 0.0 < np.abs(after - before).max() < 0.02  # the move goes on, without a jump
    trial.visit(SECOND, THIRD)
    assert (trial.agent.vision.fired, trial.kinds) == (3, [])


def test_a_pause_in_which_the_muscles_moved_is_no_fault_of_their_encoders(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Clocked(nominal_map, arm)
    trial.agent.guard = Guard(nominal_map.muscles, arm, CAMERA, None, MotorControl())
    trial.agent.begin_episode()
    trial.rest(FIRST, 80)
    trial.offset += 10.0
    trial.q = SECOND
    for _ in range(10):
        trial.step()
        assert trial.kinds == [CLOCK_JUMPED]
    trial.rest(SECOND, 120)
    assert (trial.agent.vision.fired, trial.kinds) == (2, [])


def test_a_clock_that_stands_still_is_named(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Clocked(nominal_map, arm)
    trial.rest(FIRST, 5)
    for _ in range(10):
        trial.agent.step(trial.readings(time=-0.1))
    assert trial.kinds == [STAMPS_SKIPPED]


@pytest.mark.parametrize("frame_time", [-5.0, 1e6])
def test_frames_by_another_clock_are_named(
    frame_time: float, nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Clocked(nominal_map, arm, learn_antagonism=False)
    trial.q = FIRST
    for _ in range(300):
        trial.step(frame_time=frame_time)
    (fault,) = trial.agent.faults
    assert (fault.kind, fault.where) == (NO_FRAME, "camera")
    assert ("before the rest" if frame_time < 0.0 else "not finite, or") in fault.detail
    assert trial.agent.vision.fired == 0
    trial.visit(SECOND)
    assert (trial.agent.vision.fired, trial.kinds) == (2, [])  # FIRST is at rest, too


class Blind:
    """A detector that finds nothing."""

    def detect(self, frame_rgb: np.ndarray, expected: object = None) -> Detections:
        return Detections({}, {0: Skip.NOT_SEEN}, ())


def test_a_hand_that_is_never_seen_is_named_without_a_guard_too(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Clocked(nominal_map, arm, detector=Blind(), learn_antagonism=False)
    for posture in posture_set()[1:10]:
        trial.rest(posture, 30)
    assert trial.kinds == []
    trial.rest(posture_set()[10], 60)
    trial.rest(posture_set()[11], 60)
    (fault,) = trial.agent.faults
    assert fault.kind == NOTHING_LEARNED
    assert "the hand's marker was not seen (10)" in fault.detail


def test_muscles_that_are_always_saturated_are_named(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    few = LearningMonitorOptions(observations=4)
    trial = Clocked(nominal_map, arm, learn_antagonism=False, learning_monitor=few)
    for posture in posture_set()[1:6]:
        trial.q = posture
        for _ in range(31):
            trial.step(tensions=CALM + 1000.0)
    (fault,) = trial.agent.faults
    assert fault.kind == NOTHING_LEARNED
    assert "saturated" in fault.detail

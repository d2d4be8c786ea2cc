"""Lengths of the wrong unit or sign are named, those of an actual robot are not."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.guard.faults import Fault, MotorControl
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.length_check import LengthCheck
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.observation import SensorReadings
from tests.jmm_agent.moving_arm import MovingArm
from tests.jmm_agent.small_map import LIMITS, make_map

MOTORS = MotorControl()


class Rests:
    """A robot at rest at several postures, whose lengths are measured in some way."""

    def __init__(self) -> None:
        self.map = make_map(0)
        self.check = LengthCheck(self.map, LIMITS)
        self.offsets = np.array([0.03, -0.02, 0.004, 0.0, -0.004])

    def faults(self, scale: float = 1.0, **changes: np.ndarray) -> list[Fault]:
        """Faults after two rests, with lengths times a scale."""
        rng = np.random.default_rng(0)
        for number in range(2):
            lengths = self.map.lengths(rng.uniform(*LIMITS.T)) + self.offsets
            command = lengths - rng.uniform(0.0, 0.01, 5)
            tensions = np.minimum(MOTORS.demanded(lengths, command), MOTORS.limit)
            readings = SensorReadings(float(number), scale * lengths, tensions)
            readings = readings._replace(**changes)
            self.check.update(readings, scale * command, MOTORS, float(number))
        return self.check.faults


def test_displaced_and_elongated_muscles_are_not_named() -> None:
    assert Rests().faults() == []


@pytest.mark.parametrize("scale", [1000.0, 100.0])
def test_lengths_in_other_units_are_named(scale: float) -> None:
    [fault] = Rests().faults(scale)
    assert (fault.kind, fault.where) == ("lengths_wrong", "muscles")
    assert "not in metres" in fault.detail
    assert fault.since == 0.0  # with the first readings


def test_the_wrong_sign_is_named() -> None:
    [fault] = Rests().faults(-1.0)
    assert fault.kind == "lengths_wrong"
    assert "sign" in fault.detail


def test_a_muscle_that_does_not_pull_is_another_fault() -> None:
    rests = Rests()
    lengths = rests.map.lengths(LIMITS.mean(axis=1))
    command = lengths - 0.005
    tensions = MOTORS.demanded(lengths, command) * [0.0, 1.0, 1.0, 1.0, 1.0]
    for number in range(3):
        readings = SensorReadings(float(number), lengths, tensions)
        rests.check.update(readings, command, MOTORS, float(number))
    assert rests.check.faults == []


def test_one_encoder_that_reads_anything_is_another_fault() -> None:
    rests = Rests()
    lengths = rests.map.lengths(LIMITS.mean(axis=1)) + np.array([40.0, 0.0, 0.0, 0.0, 0.0])
    rests.check.update(SensorReadings(0.0, lengths, np.full(5, 30.0)), lengths, None, np.inf)
    assert rests.check.faults == []


def test_an_agent_names_lengths_in_millimetres_until_the_next_episode(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = MovingArm(nominal_map, arm, sees=False)
    trial.step(trial.q, lengths=1000.0 * trial.lengths(trial.q))
    assert "lengths_wrong" in [fault.kind for fault in trial.agent.faults]
    trial.agent.begin_episode()
    assert list(trial.agent.faults) == []


def test_one_rest_counts_once() -> None:
    rests = Rests()
    lengths = rests.map.lengths(LIMITS.mean(axis=1))
    for number in range(5):
        readings = SensorReadings(float(number), lengths, np.full(5, 400.0))
        rests.check.update(readings, lengths, MOTORS, since=0.0)
    assert rests.check.faults == []
    rests.check.update(readings, lengths, MOTORS, since=5.0)
    assert [fault.kind for fault in rests.check.faults] == ["lengths_wrong"]

"""Muscles in use: the record, and an agent that does not use some muscles."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import MUSCLE_LEFT_OUT, MUSCLE_SNAPPED, PUSHED, Fault
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.prior import MapPrior, PriorOptions
from jmm_agent.muscles_in_use import SURE, MusclesInUse
from jmm_agent.updaters import VisionOptions
from tests.jmm_agent.nominal_arm import posture_set
from tests.jmm_agent.small_map import make_map, postures
from tests.jmm_agent.test_agent import MISTAKE, Trial

NAMES = ("one", "two", "three")
VISITED = 5


def test_a_muscle_is_left_out_once_it_has_been_snapped_for_long() -> None:
    record, snapped = MusclesInUse(NAMES), Fault(MUSCLE_SNAPPED, "two", 3.0)
    assert not record.snapped([snapped, Fault(PUSHED, "hand", 0.0)], 3.0 + 0.9 * SURE)
    assert record.all
    assert record.snapped([snapped], 3.0 + SURE)
    assert not record.snapped([snapped], 4.0 + SURE)
    assert (record.left_out, record.mask.tolist()) == (("two",), [True, False, True])
    [fault] = record.faults
    assert (fault.kind, fault.where, fault.since) == (MUSCLE_SNAPPED, "two", 3.0)
    assert "Agent.repaired('two')" in fault.detail


def test_the_last_muscle_stays_in_use() -> None:
    record = MusclesInUse(NAMES[:2])
    assert record.leave_out("one", 0.0, "worn")
    with pytest.raises(AgentError, match="'two' is the last one in use"):
        record.leave_out("two", 0.0, "worn")
    assert not record.snapped([Fault(MUSCLE_SNAPPED, "two", 0.0)], 9.0)
    with pytest.raises(AgentError, match=r"no muscle 'four'; muscles are one, two\."):
        record.repaired("four", True)


def test_a_repaired_muscle_returns_when_its_length_was_observed() -> None:
    record = MusclesInUse(NAMES)
    record.leave_out("three", 0.0, "worn")
    assert not record.repaired("one", True)
    assert record.repaired("three", offset_is_open=True)
    assert (record.all, record.returning) == (False, ("three",))
    assert [(fault.kind, fault.where) for fault in record.faults] == [(MUSCLE_LEFT_OUT, "three")]
    assert (record.mask.tolist(), record.learned.all()) == ([True, True, False], True)
    assert not record.observed(np.array([True, True, False]))
    assert record.leave_out("three", 1.0, "worn again")
    assert (record.left_out, record.returning) == (("three",), ())
    assert record.repaired("three", offset_is_open=True)
    assert record.observed(np.array([False, False, True]))
    assert record.all
    record.leave_out("three", 0.0, "worn")
    assert record.repaired("three", offset_is_open=False)
    assert record.all


def test_lengths_and_tensions_by_the_record() -> None:
    record = MusclesInUse(NAMES)
    record.leave_out("one", 0.0, "worn")
    record.leave_out("two", 0.0, "worn")
    record.repaired("two", True)
    lengths, expected = np.array([9.0, 0.2, 0.3]), np.array([0.11, 0.21, 0.31])
    usable = record.usable(lengths, expected)
    np.testing.assert_array_equal(usable, [0.11, 0.21, 0.3])
    np.testing.assert_array_equal(record.known(usable, lengths), [np.nan, 0.2, 0.3])
    np.testing.assert_array_equal(record.pulling(np.array([7.0, 8.0, 9.0])), [0.0, 8.0, 9.0])
    np.testing.assert_array_equal(record.demanded(np.array([7.0, 8.0, 9.0])), [*2 * [np.nan], 9.0])
    commanded = record.commanded(np.array([0.1, 0.1, 0.1]), lengths)
    np.testing.assert_array_equal(commanded, [9.0, 0.2, 0.1])
    other = MusclesInUse(NAMES)
    other.recall(record.state())
    assert (other.left_out, other.returning) == (("one",), ("two",))
    assert {(fault.kind, fault.since) for fault in other.faults} == {(MUSCLE_LEFT_OUT, 0.0)}


@pytest.mark.parametrize("muscle", [0, 3])
def test_the_map_is_learned_from_known_lengths_as_if_there_were_no_others(muscle: int) -> None:
    nominal, q, asked = make_map(0), postures(6, 1), postures(20, 2)
    prior = MapPrior(nominal, postures(200, 9), PriorOptions())
    lengths = nominal.lengths(q) + 0.02 * np.random.default_rng(3).normal(size=(6, 5))
    noise, known = np.full(6, 1e-3), np.array([True, True, False, True, False, False])
    partly = lengths.copy()
    partly[~known, muscle] = np.nan
    others = np.arange(5) != muscle
    found = prior.corrected(q, partly, noise).lengths(asked)
    whole = prior.corrected(q, lengths, noise).lengths(asked)
    few = prior.corrected(q[known], lengths[known], noise[known]).lengths(asked)
    np.testing.assert_allclose(found[:, others], whole[:, others], atol=1e-9)
    np.testing.assert_allclose(found[:, muscle], few[:, muscle], atol=1e-9)
    assert np.abs(found[:, muscle] - whole[:, muscle]).max() > 1e-3
    partly[:, muscle] = np.nan
    never = prior.corrected(q, partly, noise).lengths(asked)
    np.testing.assert_allclose(never[:, muscle], nominal.lengths(asked)[:, muscle], atol=1e-9)


class Snapped(Trial):
    """A trial in which the length of one muscle is that of a spool that winds up."""

    def __init__(self, *args: Any, muscle: str, wound: float, **more: Any) -> None:
        super().__init__(*args, vision=VisionOptions(lengths="l"), **more)
        self.muscle, self.wound = self.agent.map.muscles.index(muscle), wound
        self.offset = 0.0

    def readings(self, **more: Any) -> Any:
        readings = super().readings(**more)
        lengths, tensions = readings.lengths.copy(), readings.tensions.copy()
        lengths[self.muscle] += self.offset
        if self.wound:
            lengths[self.muscle] = -self.wound * readings.time
            tensions[self.muscle] = 0.0
        return readings._replace(lengths=lengths, tensions=tensions)


@pytest.mark.parametrize("muscle", ["biceps", pytest.param("trap_mid", marks=pytest.mark.slow)])
def test_nothing_depends_on_a_muscle_that_is_left_out(
    muscle: str, nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trials = [Snapped(nominal_map, arm, muscle=muscle, wound=wound) for wound in (0.1, 0.7)]

    for trial in trials:
        trial.agent.leave_out(muscle)
        trial.visit(*posture_set()[:VISITED])
    one, two = trials
    number = one.muscle
    assert one.agent.vision.fired >= VISITED - 1
    assert one.same_map(two.agent.map)
    np.testing.assert_array_equal(one.agent.joint_angles, two.agent.joint_angles)
    commands = [trial.step() for trial in trials]
    others = np.arange(36) != number
    np.testing.assert_array_equal(commands[0][others], commands[1][others])
    for trial, command in zip(trials, commands, strict=True):
        time = 0.02 * (trial.steps - 1)
        assert command[number] == pytest.approx(-trial.wound * time)  # T_bias, no more
    assert np.abs(one.agent.joint_angles - one.q).max() < np.radians(3.0)
    kinds = {(fault.kind, fault.where) for fault in one.agent.faults}
    assert (MUSCLE_LEFT_OUT, muscle) in kinds


def test_the_others_are_learned_as_well_as_with_it(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:

    tested, errors = posture_set()[20], []
    true = nominal_map.lengths(tested) - nominal_map.lengths(MISTAKE)
    for wound in (0.0, 0.2):
        trial = Snapped(nominal_map, arm, muscle="lat_dorsi", wound=wound)
        if wound:
            trial.agent.leave_out("lat_dorsi")
        trial.visit(*posture_set()[:VISITED])
        missed = (trial.agent.map.lengths(tested) - true)[np.arange(36) != trial.muscle]
        errors.append(1e3 * float(np.sqrt(np.mean(missed**2))))
    assert errors[0] < 3.0
    assert errors[1] < 1.3 * errors[0] + 0.2


def test_a_repaired_muscle_is_used_once_its_length_is_known(
    nominal_map: JointMuscleMap, arm: ArmKinematics, tmp_path: Path
) -> None:

    trial = Snapped(nominal_map, arm, muscle="biceps", wound=0.0)
    trial.visit(*posture_set()[:3])
    trial.agent.leave_out("biceps")
    trial.wound = 0.3
    trial.visit(*posture_set()[3:5])
    path = tmp_path / "learned.npz"
    trial.agent.save(path)
    other = Snapped(nominal_map, arm, muscle="biceps", wound=0.3)
    other.agent.load(path)
    assert other.agent.in_use.left_out == ("biceps",)
    assert other.same_map(trial.agent.map)
    trial.wound, trial.offset = 0.0, 0.012  # mounted anew, 12 mm longer
    trial.agent.repaired("biceps")
    assert trial.agent.in_use.returning == ("biceps",)
    trial.rest(posture_set()[4], 5)
    assert not trial.agent.in_use.all  # nothing was observed yet
    trial.visit(*posture_set()[5:8])
    assert trial.agent.in_use.all
    tested = posture_set()[5:8]
    true = nominal_map.lengths(tested) - nominal_map.lengths(MISTAKE)
    missed = (trial.agent.map.lengths(tested) - true)[:, trial.muscle] - 0.012
    assert np.abs(missed).max() < 0.005
    assert trial.agent.memory.in_use is None


def test_an_unknown_muscle_or_frame_is_named(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    agent = Trial(nominal_map, arm).agent
    for call in (agent.leave_out, agent.repaired):
        with pytest.raises(AgentError, match="no muscle 'wing'; muscles are "):
            call("wing")
    with pytest.raises(AgentError, match="no frame 'claw'; frames are "):
        agent.go(posture := agent.joint_angles, 1.0, goal="claw")
    assert posture.shape == (14,)

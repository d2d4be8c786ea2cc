"""Learning jobs that fail: each is named, and the control loop goes on."""

from __future__ import annotations

import os
import signal
from time import monotonic, sleep
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.learning.frames import FrameQueue
from jmm_agent.learning.options import LearningOptions
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.vision.hand_finder import Findings, FrameJob
from tests.jmm_agent.learning.resting import (
    CALM,
    START,
    STEPS,
    Make,
    readings,
    run,
)


class BrokenRule:
    """Rule that fails."""

    def move(self, current: object, remembered: object, batch: object) -> JointMuscleMap:
        raise ZeroDivisionError("no rule")


@pytest.mark.parametrize("where", ["step", "process"])
def test_a_job_that_fails_is_named_and_the_loop_goes_on(
    where: str, make: Make, nominal_map: JointMuscleMap
) -> None:
    agent = make(where, 2, rule=BrokenRule())
    run(agent, nominal_map, 1)
    assert agent.vision.dropped == {"learning failed: ZeroDivisionError: no rule": 2}
    assert agent.map is nominal_map
    assert [end.failure for end in agent.entered if end.kind != "frame"] == (
        ["ZeroDivisionError: no rule"] * 2
    )


def test_a_killed_process_is_named_and_replaced(make: Make, nominal_map: JointMuscleMap) -> None:
    agent = make("process", 3)
    run(agent, nominal_map, 1)
    begin = monotonic()
    assert agent._schedule.process_id is not None
    os.kill(agent._schedule.process_id, signal.SIGKILL)
    run(agent, nominal_map, 2, STEPS)
    assert monotonic() - begin < 240.0
    killed = "learning failed: the process was killed by signal 9"
    assert agent.vision.dropped == {killed: 1}
    assert agent.vision.fired == 3


def test_a_frame_of_the_wrong_shape_is_named(make: Make, nominal_map: JointMuscleMap) -> None:
    agent = make("process", 2)
    frames = (
        readings(nominal_map, k, 1)._replace(frame=np.full((4, 4, 3), 77, np.uint8))
        for k in range(STEPS)
    )
    with pytest.raises(AgentError, match="IndexError"):
        [agent.step(frame) for frame in frames]


def test_a_rule_that_no_process_can_load_is_refused(make: Make) -> None:
    class Local(BrokenRule):
        """Not importable."""

    with pytest.raises(AgentError, match="can be imported"):
        make("process", 0, rule=Local())


class SlowRule:
    """Rule that takes longer than a job may."""

    def move(self, current: object, remembered: object, batch: object) -> JointMuscleMap:
        sleep(60.0)
        raise AssertionError


def test_a_job_that_takes_too_long_is_given_up(make: Make, nominal_map: JointMuscleMap) -> None:
    agent = make("process", 2, 0.5, rule=SlowRule())
    begin = monotonic()
    run(agent, nominal_map, 1)
    assert monotonic() - begin < 50.0
    assert agent.vision.dropped == {"learning failed: it took more than 0.5 s": 2}
    assert agent.map is nominal_map


class PrintingRule:
    """Rule of a library that prints to the standard output."""

    def move(self, current: JointMuscleMap, remembered: object, batch: object) -> JointMuscleMap:
        os.write(1, b"hello")
        return current


def test_what_a_library_prints_is_no_result(make: Make, nominal_map: JointMuscleMap) -> None:
    agent = make("process", 2, rule=PrintingRule())
    run(agent, nominal_map, 1)
    assert agent.vision.dropped == {}
    assert agent.vision.fired == 1


def test_a_frame_may_be_overwritten_after_the_step(arm: ArmKinematics) -> None:
    finder: Any = SimpleNamespace(
        pose=lambda q: np.eye(4),
        find_at=lambda frame, pose: Findings(None, {}),
        chosen=lambda found, q: found,
    )
    frames = FrameQueue(finder, LearningOptions("step", 1))
    frame = np.zeros((2, 2, 3), np.uint8)
    frames.submit(FrameJob(0.0, frame, START, CALM))
    frame[:] = 9
    frames.advance(5)
    assert frames.newest is not None
    assert frames.newest[0].frame.max() == 0

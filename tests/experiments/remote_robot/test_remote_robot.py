"""A robot in another process behaves like the same robot in this process."""

from __future__ import annotations

import time

import numpy as np
import pytest

from experiments.harness.errors import ExperimentError
from experiments.remote_robot.run import Args, main
from jmm_agent.observation import SensorReadings
from kengoro.errors import UsageError
from kengoro.remote_robot.process import robot_process
from kengoro.robots import NO_END, make_env
from kengoro_env.env import KengoroEnv

STEPS = 4


def wish(readings: SensorReadings) -> np.ndarray:
    """A command that depends on the readings."""
    return np.asarray(
        readings.lengths - 0.001 * np.sin(readings.time + np.arange(len(readings.lengths)))
    )


def test_it_feels_and_sees_the_same_bits_as_one_in_this_process() -> None:
    env = make_env("Posture", 1, max_episode_steps=NO_END)
    world = env.unwrapped
    assert isinstance(world, KengoroEnv)
    observation, _ = env.reset(seed=1)

    with robot_process("Posture", 1) as robot:
        for step in range(STEPS):
            readings = robot.read()
            assert readings.time == step * world.robot.control_period
            np.testing.assert_array_equal(readings.lengths, observation["lengths"])
            np.testing.assert_array_equal(readings.tensions, observation["tensions"])
            np.testing.assert_array_equal(readings.frame, observation["frame"])
            assert readings.frame_time == observation["frame_time"][0]
            robot.write(wish(readings))
            observation, *_ = env.step(world.lengths_to_action(wish(readings)))
        robot.read()


def test_no_postures_are_none_to_go_to() -> None:
    with pytest.raises(ExperimentError, match="at least 1"):
        main(Args(postures=0))


def test_a_robot_that_was_stopped_may_be_stopped_again() -> None:
    with robot_process("Posture", None) as robot:
        robot.read()
        robot.stop()
        with pytest.raises(UsageError, match="it was stopped"):
            robot.read()


def command_nonsense() -> None:
    """Three targets for a robot with 36 muscles."""
    with robot_process("Posture", None) as robot:
        robot.read()
        robot.write(np.zeros(3))
        robot.read()


def test_a_command_for_another_robot_is_refused_in_a_sentence() -> None:
    with pytest.raises(UsageError, match="'target_lengths' must be a list of 36 numbers"):
        command_nonsense()


def test_a_robot_with_its_own_clock_does_not_wait() -> None:
    with robot_process("Elbow", None, period=0.05) as robot:
        first = robot.read()
        robot.pause()
        time.sleep(0.5)
        later = robot.read()
        assert robot.period == 0.05
        assert first is not None
        assert later is not None
        assert later.time - first.time > 0.1
        assert robot.overtaken >= 4

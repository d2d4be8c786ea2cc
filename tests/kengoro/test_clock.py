"""Clocks of a session: they change what the agent is given, and not the simulation."""

from __future__ import annotations

from copy import deepcopy
from itertools import islice, pairwise
from typing import Any

import numpy as np
import pytest

from jmm_agent.types import Floats
from kengoro.clock import Clock, Cycle
from kengoro.errors import UsageError
from kengoro.robots import make_env
from kengoro.session import Session
from kengoro_env.errors import ArgumentError

PERIODS = [0.005, 0.02, 0.05]


def cycles(clock: Clock, count: int, period: float = 0.02, seed: int = 0) -> list[Cycle]:
    return list(islice(clock.cycles(period, seed), count))


@pytest.mark.parametrize("period", PERIODS)
def test_an_exact_clock_has_exact_stamps(period: float) -> None:
    found = cycles(Clock(), 1000, period)
    assert found == [Cycle(k * period) for k in range(1000)]


def test_deviations_occur_as_often_as_they_are_to() -> None:
    clock = Clock(lost=0.05, late=0.1, repeated=0.02, backward=0.03)
    found, again = cycles(clock, 20_000), cycles(clock, 20_000)
    assert found == again
    assert np.mean([cycle.lost for cycle in found]) == pytest.approx(0.05, abs=0.01)
    assert np.mean([cycle.late for cycle in found]) == pytest.approx(0.1, abs=0.01)
    steps = np.diff([cycle.stamp for cycle in found])
    assert np.mean(steps == 0.0) == pytest.approx(0.02, abs=0.005)
    assert np.mean(steps < 0.0) > 0.02
    assert found[0] == Cycle(0.0)
    assert cycles(clock, 100, seed=1) != found[:100]


def test_cycles_can_be_copied_as_a_session_is() -> None:
    running = Clock(jitter=0.001, lost=0.1).cycles(0.02, 3)
    for _ in range(10):
        next(running)
    copied = deepcopy(running)
    assert list(islice(copied, 50)) == list(islice(running, 50))


def test_jitter_stays_within_its_limit_and_an_offset_adds() -> None:
    stamps = np.array([cycle.stamp for cycle in cycles(Clock(jitter=0.006, offset=5.0), 1000)])
    deviation = stamps - 5.0 - 0.02 * np.arange(1000)
    assert 0.0055 < np.abs(deviation).max() <= 0.006


def test_a_clock_is_set_at_a_moment() -> None:
    clock = Clock(set_at=1.0, set_by=-3600.0)
    stamps = [cycle.stamp for cycle in cycles(clock, 100)]
    assert stamps[49] == pytest.approx(0.98)
    assert stamps[50] == clock.at(1.0) == pytest.approx(-3599.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"jitter": np.nan}, "jitter is nan, but must be finite"),
        ({"lost": 1.5}, "lost is 1.5, but is a share of 1"),
        ({"late": -0.1}, "late is -0.1, but is a share of 1"),
    ],
)
def test_a_clock_that_cannot_be_is_refused(options: dict[str, float], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        Clock(**options)


class Recorder:
    """In place of an agent: commands a sway, and records the time stamps that it is given."""

    def __init__(self, lengths: Floats) -> None:
        self.lengths, self.times = lengths, list[float]()
        self.hand_is_free, self.seen, self.faults, self.stiffness = True, None, [], None
        self.target = self.joint_angles = np.zeros(1)

    def begin_episode(self) -> None:
        self.times.clear()

    def step(self, readings: Any) -> Floats:
        self.times.append(readings.time)
        return self.lengths - 0.001 * len(self.times)


def session(clock: Clock | None, period: float = 0.02) -> tuple[Session, Recorder, list[Floats]]:
    """Session of 50 steps, its agent, and what was commanded."""
    env = make_env("Elbow", 1, control_period=period)
    observation, _ = env.reset(seed=0)
    agent: Any = Recorder(observation["lengths"])
    running = Session(env, agent, 0, clock=clock)
    commands = []
    for _ in range(50):
        running.step()
        commands.append(running.world.robot.target.copy())
    env.close()
    return running, agent, commands


def test_without_a_clock_stamps_are_exact() -> None:
    running, agent, commands = session(None)
    _, other, same = session(Clock())
    assert agent.times == other.times == [0.02 * k for k in range(50)]
    np.testing.assert_array_equal(commands, same)
    assert running.truth["time"] == pytest.approx(1.0)


def test_the_robot_holds_the_last_command_in_a_lost_cycle() -> None:
    running, agent, commands = session(Clock(lost=0.3))
    assert running.truth["time"] == pytest.approx(1.0)
    lost = 50 - len(agent.times)
    assert 5 < lost < 25
    assert sum(np.array_equal(a, b) for a, b in pairwise(commands)) == lost


def test_a_command_of_a_late_cycle_arrives_a_period_later() -> None:
    _, agent, commands = session(Clock(late=0.3))
    assert len(agent.times) == 50
    held = [k for k in range(1, 50) if np.array_equal(commands[k], commands[k - 1])]
    assert 5 < len(held) < 25
    late = [cycle.late for cycle in cycles(Clock(late=0.3), 50)]
    assert all(late[k] for k in held)


@pytest.mark.parametrize("period", PERIODS)
def test_a_session_runs_at_the_control_period_of_its_environment(period: float) -> None:
    running, agent, _ = session(None, period)
    assert running.time == pytest.approx(50 * period)
    assert running.truth["time"] == pytest.approx(50 * period)
    np.testing.assert_allclose(np.diff(agent.times), period)


@pytest.mark.parametrize("period", [0.0, 0.2, np.nan, -0.02])
def test_a_control_period_out_of_range_is_refused(period: float) -> None:
    with pytest.raises(
        ArgumentError, match=r"control_period is .*, but must be from 0.001 to 0.1 s"
    ):
        make_env("Elbow", 1, control_period=period)

"""What keeps an agent from learning is named, and nothing is named while it learns."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.guard.faults import HAND_NOT_FREE, NEVER_SETTLED, NO_FRAME, NOTHING_LEARNED
from jmm_agent.learning_monitor import LearningMonitor, LearningMonitorOptions
from jmm_agent.settling import SettlingDetector, SettlingOptions
from jmm_agent.updaters.observation_check import UNCERTAIN

MUSCLES = ("one", "two", "three")


class Robot:
    """Rests of which a monitor is told, at any control period."""

    def __init__(self, period: float) -> None:
        self.period, self.time = period, 0.0
        self.monitor = LearningMonitor(LearningMonitorOptions())
        self.settling = SettlingDetector(SettlingOptions())
        self.fired, self.dropped = 0, dict[str, int]()

    def run(self, seconds: float, state: str, reason: str = "") -> list[str]:
        """Kinds that are named after some time [s] in a state."""
        rng = np.random.default_rng(0)
        for _ in range(round(seconds / self.period)):
            self.time += self.period
            shaken = 0.003 * rng.standard_normal(3) * [0.0, 1.0, 0.0]
            self.settling.update(
                self.time, shaken if state in ("moving", "shaking") else 0.0 * shaken
            )
            self.monitor.held(self.period, state != "holding")
            if state == "resting":
                self.monitor.rested(self.period, reason)
            elif state != "holding":
                self.monitor.moved(self.period, state == "shaking")
            self.monitor.observed(self.fired, self.dropped)
            self.monitor.update(self.time, self.settling, MUSCLES)
        return [fault.kind for fault in self.monitor.faults]


@pytest.fixture(params=[0.005, 0.02, 0.05])
def robot(request: pytest.FixtureRequest) -> Robot:
    return Robot(request.param)


def test_lengths_that_never_settle_are_named_with_the_muscle(robot: Robot) -> None:
    for _ in range(3):
        assert robot.run(1.5, "moving") == []
        assert robot.run(2.0, "shaking") == []
    robot.run(1.5, "moving")
    assert robot.run(2.5, "shaking") == [NEVER_SETTLED]
    (fault,) = robot.monitor.faults
    assert fault.where == "two"
    assert "mm within 0.4 s, but only 2 mm count as settled" in fault.detail
    assert robot.run(0.1, "resting") == []


def test_an_arm_that_is_always_moved_is_named_later(robot: Robot) -> None:
    assert robot.run(50.0, "moving") == []
    assert robot.run(11.0, "moving") == [NEVER_SETTLED]


def test_rests_without_a_frame_are_named_until_one_is_seen(robot: Robot) -> None:
    for _ in range(4):
        assert robot.run(1.2, "resting", "there is no frame") == []
        robot.run(1.0, "moving")
    robot.run(1.2, "resting", "there is no frame")
    (fault,) = robot.monitor.faults
    assert (fault.kind, fault.where, fault.detail) == (NO_FRAME, "camera", "there is no frame")
    assert robot.run(0.1, "resting") == []


def test_observations_that_are_all_dropped_are_named_with_their_reasons(robot: Robot) -> None:
    for k in range(10):
        assert robot.run(0.5, "resting") == []
        reason = "a muscle was saturated: no pair" if k % 2 else "the hand's marker was not seen"
        robot.dropped[reason] = robot.dropped.get(reason, 0) + 1
        robot.fired += k % 2  # what was learned before is learned again, without a new pair
    assert robot.run(0.5, "resting") == [NOTHING_LEARNED]
    (fault,) = robot.monitor.faults
    assert "marker was not seen (5)" in fault.detail
    assert "saturated: no pair (5)" in fault.detail
    robot.fired += 1
    assert robot.run(0.1, "resting") == []


@pytest.mark.parametrize("reason", ["too close to the last update", UNCERTAIN])
def test_a_posture_that_is_known_already_is_no_fault(robot: Robot, reason: str) -> None:
    for k in range(30):
        robot.dropped[reason] = k
        assert robot.run(0.1, "resting") == []


def test_a_hand_that_is_not_free_for_long_is_named(robot: Robot) -> None:
    assert robot.run(55.0, "holding") == []
    assert robot.run(6.0, "holding") == [HAND_NOT_FREE]
    assert robot.run(0.1, "moving") == []

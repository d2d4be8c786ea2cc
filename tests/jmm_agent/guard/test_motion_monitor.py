"""Late commands and pushes on simulated readings: each is found, and its end, too."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.guard.faults import MotorControl
from jmm_agent.guard.motion_monitor import (
    DelayMonitor,
    DelayMonitorOptions,
    DisturbanceMonitor,
    DisturbanceMonitorOptions,
    force_of,
)

DT = 0.02
MOTORS = MotorControl()


def delayed(delay: int, steps: int, monitor: DelayMonitor, period: float = DT) -> bool:
    """Whether commands are late, by muscles that follow them some steps late."""
    time = period * np.arange(steps + 20)
    commands = 0.03 * np.sin(2.0 * time[:, None] + np.arange(3))
    for k in range(20, steps + 20):
        lengths = commands[k - delay] + 0.002
        tensions = MOTORS.demanded(lengths, commands[k - delay])
        late = monitor.update(period, lengths, tensions, commands[k], np.ones(3, dtype=bool))
    return late


def test_late_commands_are_noticed_until_they_come_in_time_again() -> None:
    monitor = DelayMonitor(MOTORS, DelayMonitorOptions())
    assert not delayed(0, 200, monitor)
    assert delayed(5, 80, monitor)
    assert not delayed(0, 80, monitor)
    assert not delayed(1, 80, monitor)


def test_a_push_is_noticed_until_it_ends_and_a_steady_force_is_not() -> None:
    monitor = DisturbanceMonitor(DisturbanceMonitorOptions())
    rng = np.random.default_rng(0)

    def pushed_by(force: np.ndarray, times: int) -> bool:
        for _ in range(times):
            torques = -(force + rng.standard_normal(3))
            pushed = monitor.update(0.1, torques, np.eye(3), np.eye(3))
        return pushed

    usual, more = np.array([8.0, 0.0, -5.0]), np.array([0.0, 40.0, 0.0])
    assert not pushed_by(usual, 400)
    assert pushed_by(usual + more, 5)
    assert pushed_by(usual + more, 200)
    assert not pushed_by(usual, 5)
    assert pushed_by(usual + more, 5)
    assert not pushed_by(usual + more, 400)  # by now a load


def test_while_the_map_is_not_trusted_a_change_is_its_error_and_usual() -> None:
    monitor = DisturbanceMonitor(DisturbanceMonitorOptions(usual_change=1.0))
    here = (np.eye(3), np.eye(3))

    def pushed_by(force: float, trusted: bool) -> bool:
        pushes = [monitor.update(0.1, np.array([-force, 0, 0]), *here, trusted) for _ in range(5)]
        return any(pushes)

    assert not any(pushed_by(force, trusted=False) for force in 20 * [0.0, 60.0])
    assert not pushed_by(0.0, trusted=True)
    assert not pushed_by(60.0, trusted=True)  # a usual change by now
    assert pushed_by(400.0, trusted=True)


def test_a_force_that_changes_slowly_is_no_push() -> None:
    monitor = DisturbanceMonitor(DisturbanceMonitorOptions())
    for force in [0.0] * 400 + np.linspace(0.0, 120.0, 100).tolist():
        assert not monitor.update(0.1, -np.array([force, 0.0, 0.0]), np.eye(3), np.eye(3))


def test_a_push_differs_from_a_wrong_map_s_force_that_varies_with_the_posture() -> None:
    monitor = DisturbanceMonitor(DisturbanceMonitorOptions())

    def pushed_by(times: np.ndarray, push: float) -> list[bool]:
        forces = 30.0 * np.sin(2.0 * np.pi * times / 4.0)[:, None] * [1.0, 0.0, 0.0]
        forces[:, 1] += push
        return [monitor.update(0.04, -force, np.eye(3), np.eye(3)) for force in forces]

    assert not any(pushed_by(np.arange(0.0, 60.0, 0.04), 0.0))
    assert np.argmax(pushed_by(np.arange(60.0, 64.0, 0.04), 40.0)) < 10
    assert pushed_by(np.arange(60.0, 64.0, 0.04), 40.0)[-1]
    assert not pushed_by(np.arange(64.0, 65.0, 0.04), 0.0)[-1]


@pytest.mark.parametrize("period", [0.005, 0.01, 0.02, 0.05])
def test_commands_that_are_100_ms_late_are_noticed_at_any_period(period: float) -> None:
    monitor, second = DelayMonitor(MOTORS, DelayMonitorOptions()), round(1.0 / period)
    assert not delayed(0, 4 * second, monitor, period)
    assert delayed(round(0.1 / period), 2 * second, monitor, period)
    assert not delayed(0, 2 * second, monitor, period)
    assert not delayed(1, 2 * second, monitor, period)  # of a loop that writes after it reads


@pytest.mark.parametrize("period", [0.03, 0.04, 0.05])
def test_commands_that_are_one_period_late_are_in_time_however_long_that_is(period: float) -> None:
    """So does a loop work that writes its command after it has read."""
    monitor, second = DelayMonitor(MOTORS, DelayMonitorOptions()), round(1.0 / period)
    assert not delayed(1, 4 * second, monitor, period)
    assert delayed(2, 4 * second, monitor, period)
    assert not delayed(1, 4 * second, monitor, period)


@pytest.mark.parametrize("period", [0.005, 0.02, 0.03, 0.05])
def test_a_push_is_noticed_within_the_same_time_at_any_period(period: float) -> None:
    monitor, rng = DisturbanceMonitor(DisturbanceMonitorOptions()), np.random.default_rng(0)
    spacing = period * np.ceil(0.04 / period - 1e-9)
    jacobian, rotation = np.eye(3), np.eye(3)

    def pushed_for(seconds: float, push: float) -> list[bool]:
        forces = rng.standard_normal((round(seconds / spacing), 3))
        forces[:, 1] += push
        return [monitor.update(spacing, -force, jacobian, rotation) for force in forces]

    assert not any(pushed_for(20.0, 0.0))
    assert 0.0 < spacing * pushed_for(2.0, 40.0).index(True) < 0.3
    assert spacing * pushed_for(2.0, 0.0).index(False) < 0.3


@pytest.mark.parametrize("joints", [1, 2])
def test_fewer_than_three_joints_at_the_hand_show_a_push_along_their_motion(joints: int) -> None:
    """A planar finger of links of 60 and 40 mm."""
    monitor = DisturbanceMonitor(DisturbanceMonitorOptions(least=2.0, usual_change=0.5))
    jacobian = np.array([[-0.05, -0.03], [0.08, 0.02], [0.0, 0.0]])[:, :joints]
    along, rng = jacobian[:, 0] / np.linalg.norm(jacobian[:, 0]), np.random.default_rng(0)

    def pushed_by(force: np.ndarray) -> bool:
        for _ in range(20):
            torques = -jacobian.T @ (force + 0.1 * rng.standard_normal(3))
            pushed = monitor.update(0.04, torques, jacobian, np.eye(3))
        return pushed

    across = np.array([0.0, 0.0, 5.0])  # no joint moves the hand that way
    assert not pushed_by(np.zeros(3))
    assert not pushed_by(across)
    assert pushed_by(5.0 * along)
    assert not pushed_by(np.zeros(3))


@pytest.mark.parametrize("stretched", [0.0, 1e-9, 1e-3])
def test_a_singular_posture_shows_no_force_along_the_stretched_arm(stretched: float) -> None:
    jacobian = np.array([[0.0, 0.0, stretched], [0.5, 0.3, 0.1], [0.2, -0.3, 0.1]])
    torques = -jacobian.T @ np.array([0.0, 3.0, -2.0]) + [1e-3, -1e-3, 1e-3]
    force = force_of(torques, jacobian, DisturbanceMonitorOptions().observable)
    np.testing.assert_allclose(force, [0.0, 3.0, -2.0], atol=0.02)

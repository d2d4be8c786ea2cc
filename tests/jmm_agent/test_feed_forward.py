"""Feed-forward: tensions follow the movement, the map and the stiffness."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.commander import Commander
from jmm_agent.feed_forward import BETWEEN, FeedForward, stretch
from jmm_agent.guard.faults import MotorControl
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.tendon_stretch import TendonStretch
from jmm_agent.tension_distribution import TensionDistribution, TensionOptions
from jmm_agent.trajectory import Trajectory
from jmm_agent.types import Floats
from tests.jmm_agent.small_map import LIMITS, make_map, postures
from tests.jmm_agent.test_tension_distribution import Weight

MOTORS = MotorControl(20_000.0, 30.0, 500.0)
POINTS = postures(3, 5)
TRAJECTORY = Trajectory(POINTS, 5.0, 2.0)


def forward() -> FeedForward:
    return FeedForward(TensionDistribution(Weight(), TensionOptions()))


def exact(jmm: JointMuscleMap, q: Floats, motors: MotorControl = MOTORS) -> Floats:
    return TensionDistribution(Weight(), TensionOptions()).at(jmm, motors, q).tensions


def test_tensions_at_the_points_of_a_movement_balance_the_load_there() -> None:
    jmm, pull = make_map(), forward()
    for time in (4.0, 5.0, 6.0, 7.0, 9.0):
        q = TRAJECTORY.at(time)
        found = pull.tensions(jmm, MOTORS, TRAJECTORY, time)
        np.testing.assert_allclose(found, exact(jmm, q), rtol=1e-9)


def test_between_points_they_are_interpolated_without_a_jump() -> None:
    jmm, pull, times = make_map(), forward(), np.linspace(5.0, 7.0, 400)
    found = np.array([pull.tensions(jmm, MOTORS, TRAJECTORY, time) for time in times])
    points = np.array([TRAJECTORY.at(time) for time in times])
    spread = np.ptp([exact(jmm, q) for q in points], axis=0).max()
    assert np.abs(np.diff(found, axis=0)).max() < 0.05 * spread
    away = np.abs(found - [exact(jmm, q) for q in points])
    assert away.max() < 0.2 * spread
    assert len(np.unique(found.round(6), axis=0)) > BETWEEN * 2


def test_another_movement_begins_with_the_tensions_of_now() -> None:
    jmm, pull = make_map(), forward()
    now = pull.tensions(jmm, MOTORS, TRAJECTORY, 5.6)
    other = Trajectory(np.array([TRAJECTORY.at(5.6), POINTS[0]]), 5.6, 1.0)
    np.testing.assert_array_equal(pull.tensions(jmm, MOTORS, other, 5.6), now)
    end = pull.tensions(jmm, MOTORS, other, 6.6)
    np.testing.assert_allclose(end, exact(jmm, POINTS[0]), rtol=1e-9)


def test_another_map_and_another_stiffness_give_other_tensions() -> None:
    first, second, pull = make_map(0), make_map(1), forward()
    pull.tensions(first, MOTORS, TRAJECTORY, 8.0)
    found = pull.tensions(second, MOTORS, TRAJECTORY, 8.0)
    np.testing.assert_allclose(found, exact(second, POINTS[-1]), rtol=1e-9)
    soft = MotorControl(2_000.0, 30.0, 500.0)
    found = pull.tensions(second, soft, TRAJECTORY, 8.0)
    np.testing.assert_allclose(found, exact(second, POINTS[-1], soft), rtol=1e-9)
    assert np.abs(found - exact(second, POINTS[-1])).max() > 1.0


def test_a_command_makes_a_motor_pull_with_the_tension() -> None:
    jmm, tensions = make_map(), np.array([30.0, 40.0, 60.0, 100.0, 400.0])
    q, each = postures(1)[0], np.array([1e3, 2e3, 5e3, 1e4, 3e4])
    tendons = TendonStretch(np.full(5, 1e-5), np.full(5, 4e6), np.full(5, 30.0))
    elastic = JointMuscleMap(jmm.joints, jmm.muscles, jmm.groups, tendons)
    for motors in (MOTORS, MotorControl(each=each)):
        for one in (jmm, elastic):
            measured = one.lengths(q, tensions)
            command = one.lengths(q) - stretch(one, motors, tensions)
            np.testing.assert_allclose(motors.demanded(measured, command), tensions, rtol=1e-9)


def commander(jmm: JointMuscleMap, rate: float = 0.03) -> Commander:
    made = Commander(jmm, POINTS[0], LIMITS, rate, forward())
    made.start(POINTS[0], 0.0, jmm.lengths(POINTS[0]))
    return made


def test_commands_are_shorter_by_the_tensions_and_the_same_without_motors() -> None:
    jmm = make_map()
    made = commander(jmm)
    lengths = jmm.lengths(POINTS[0])
    passed = made.advance(0.02)
    command = made.command(jmm, None, lengths, passed, MOTORS)
    expected = lengths - (exact(jmm, POINTS[0]) - 30.0) / 20_000.0
    np.testing.assert_allclose(command, expected, rtol=1e-9)
    np.testing.assert_allclose(command + made.stretch, lengths, rtol=1e-12)
    plain = Commander(jmm, POINTS[0], LIMITS, 0.03)
    np.testing.assert_array_equal(plain.command(jmm, None, lengths, 0.02, MOTORS), lengths)
    np.testing.assert_array_equal(plain.stretch, 0.0)


@pytest.mark.parametrize("period", [0.005, 0.02, 0.037])
def test_commands_move_to_another_map_and_its_tensions_at_a_limited_speed(period: float) -> None:
    first, second = make_map(0), make_map(1)
    made, time, rate = commander(first), 0.0, 0.05
    made = Commander(first, POINTS[0], LIMITS, rate, forward())
    made.start(POINTS[0], 0.0, first.lengths(POINTS[0]))
    lengths, commands = first.lengths(POINTS[0]), []
    for step in range(round(6.0 / period)):
        time += period
        passed = made.advance(time)
        jmm = first if step < 5 else second
        commands.append(made.command(jmm, None, lengths, passed, MOTORS))
    speed = np.abs(np.diff(commands, axis=0)).max() / period
    assert speed <= rate * (1.0 + 1e-6)
    expected = second.lengths(POINTS[0]) - (exact(second, POINTS[0]) - 30.0) / 20_000.0
    np.testing.assert_allclose(commands[-1], expected, atol=1e-12)


def test_other_loads_give_other_tensions_at_rest() -> None:
    jmm, pull = make_map(), forward()
    before = pull.tensions(jmm, MOTORS, TRAJECTORY, 8.0)
    pull.distribution.loads = Weight(0.3)
    after = pull.tensions(jmm, MOTORS, TRAJECTORY, 8.0)
    heavy = TensionDistribution(Weight(0.3), TensionOptions()).at(jmm, MOTORS, POINTS[-1])
    np.testing.assert_allclose(after, heavy.tensions, rtol=1e-9)
    assert np.abs(after - before).max() > 1.0


def test_commands_move_to_other_loads_at_a_limited_rate() -> None:
    jmm, pull, rate, period = make_map(), forward(), 0.01, 0.02
    commander = Commander(jmm, POINTS[0], LIMITS, rate, pull)
    commander.start(POINTS[0], 0.0, jmm.lengths(POINTS[0]))
    commands = []
    for step in range(200):
        if step == 100:
            pull.distribution.loads = Weight(3.0)
        passed = commander.advance(step * period)
        commander.target_lengths = commander.command(
            jmm, None, jmm.lengths(POINTS[0]), passed, MOTORS
        )
        commands.append(commander.target_lengths)
    changes = np.abs(np.diff(commands, axis=0)).max(axis=1)
    assert changes.max() <= 1.01 * rate * period
    heavy = TensionDistribution(Weight(3.0), TensionOptions()).at(jmm, MOTORS, POINTS[0])
    end = jmm.lengths(POINTS[0]) - stretch(jmm, MOTORS, heavy.tensions)
    np.testing.assert_allclose(commands[-1], end, atol=1e-9)
    assert np.abs(commands[-1] - commands[50]).max() > 5.0 * rate * period

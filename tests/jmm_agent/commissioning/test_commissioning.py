"""Commissioning runs of a robot of another size, with a jittering clock and other moment arms."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from jmm_agent.commissioning.commissioning import Commissioner, Commissioning, CommissioningError
from jmm_agent.commissioning.options import CommissionOptions
from jmm_agent.errors import AgentError
from jmm_agent.observation import SensorReadings
from tests.jmm_agent.commissioning.spring_robot import (
    COUNT,
    LIMITS,
    MOTORS,
    MUSCLES,
    START,
    SpringRobot,
    nominal_map,
    run,
)


def names(*channels: int) -> set[str]:
    return {MUSCLES[channel] for channel in channels}


@cache
def sound(seed: int) -> tuple[SpringRobot, Commissioning]:
    """A robot without faults, and the result of its run."""
    robot = SpringRobot(seed)
    return robot, run(robot)


@pytest.mark.parametrize("seed", range(4))
def test_a_robot_without_faults_gets_no_name(seed: int) -> None:
    _, result = sound(seed)
    assert result.findings == ()
    assert not result.order.changes
    assert result.absent == ()
    assert "no fault found" in str(result)


def test_pulls_are_small_slow_and_one_at_a_time() -> None:
    robot, result = sound(0)
    assert result.record is not None
    commands = np.array(robot.written)
    steps = np.abs(np.diff(commands, axis=0))
    travel, options = result.record.travel, CommissionOptions()
    stroke = np.abs(result.record.strokes).max()
    assert 0.0 < stroke <= options.stroke * travel * 1.001
    assert steps.max() <= max(stroke / options.ramp, 0.5 * travel / options.tighten) * 0.051
    assert np.abs(commands - commands[0]).max() < 1.6 * travel  # of a loose muscle
    ends = np.abs(commands[-1] - commands[0])
    assert ends.max() < 1.6 * travel
    pulls = commands[len(commands) // 2 :]
    assert (np.count_nonzero(np.diff(pulls, axis=0), axis=1) <= 1).all()
    assert robot.largest < 0.8 * MOTORS.limit
    assert result.largest_tension == pytest.approx(robot.largest, abs=0.5)
    assert result.seconds < 60.0


@pytest.mark.parametrize(("seed", "ring"), [(0, (7, 6)), (2, (2, 1)), (0, (7, 6, 8))])
def test_exchanged_muscles_are_named_and_put_back(seed: int, ring: tuple[int, ...]) -> None:
    robot = SpringRobot(seed)
    for order in (robot.commands, robot.lengths, robot.tensions):
        order[list(ring)] = [*ring[1:], ring[0]]
    result = run(robot)
    assert [(each.kind, set(each.muscles)) for each in result.findings] == [
        ("swapped", names(*ring))
    ]
    finding = result.findings[0]
    assert finding.part == "motors and sensors"
    assert all(name in finding.sentence for name in finding.muscles)
    order = result.order
    assert order.changes
    for mine, true in (
        (order.commands, robot.commands),
        (order.lengths, robot.lengths),
        (order.tensions, robot.tensions),
    ):
        assert np.array_equal(true[mine], np.arange(COUNT))


def test_exchanged_encoders_alone_are_named_if_it_is_known_what_the_motors_hold() -> None:
    robot = SpringRobot(0)
    robot.lengths[[7, 6]] = 6, 7
    found = run(robot).findings
    assert [(each.kind, set(each.muscles), each.part) for each in found] == [
        ("swapped", names(6, 7), "encoders")
    ]


def test_a_reversed_motor_with_its_encoder_is_named_and_turned() -> None:
    robot = SpringRobot(0)
    robot.command_factors[7] = robot.length_factors[7] = -1.0
    result = run(robot)
    assert [(each.kind, each.muscles, each.part) for each in result.findings] == [
        ("reversed", (MUSCLES[7],), "motor and encoder")
    ]
    order = result.order
    assert order.command_signs[7] == order.length_signs[7] == -1.0
    assert order.command_signs.sum() == COUNT - 2
    assert (order.tension_signs == 1.0).all()


def test_a_dead_tension_sensor_and_a_stuck_encoder_stop_with_a_sentence() -> None:
    for kind, factors in (
        ("tension_sensor_dead", "tension_factors"),
        ("encoder_stuck", "length_factors"),
    ):
        robot = SpringRobot(2)
        getattr(robot, factors)[2] = 0.0
        result = run(robot)
        assert [(each.kind, each.muscles) for each in result.findings] == [(kind, (MUSCLES[2],))]
        with pytest.raises(CommissioningError, match=f"no order.*{MUSCLES[2]} does not respond"):
            _ = result.order


@pytest.mark.parametrize(("kind", "field"), [("absent", "absent"), ("motor_dead", "dead")])
def test_an_absent_muscle_and_a_dead_motor_are_left_out(kind: str, field: str) -> None:
    robot = SpringRobot(0)
    getattr(robot, field)[7] = True
    result = run(robot)
    assert [(each.kind, each.muscles) for each in result.findings] == [(kind, (MUSCLES[7],))]
    assert result.absent == (MUSCLES[7],)
    order = result.order
    assert MUSCLES[7] not in order.muscles
    assert order.idle.tolist() == [channel == 7 for channel in range(COUNT)]


@pytest.mark.parametrize(
    ("value", "kind", "reason"),
    [(np.nan, "encoder_dead", "reads no number"), (4.2, "encoder_scale", "another unit")],
)
def test_nothing_is_pulled_if_a_length_is_impossible(value: float, kind: str, reason: str) -> None:
    robot = SpringRobot(0)
    readings = robot.read()
    readings.lengths[4] = value
    commissioner = Commissioner(nominal_map(), LIMITS, START, MOTORS)
    assert commissioner.refuse(readings)
    assert commissioner.done
    result = commissioner.result()
    assert [(each.kind, each.muscles) for each in result.findings] == [(kind, (MUSCLES[4],))]
    assert reason in result.findings[0].sentence
    assert result.record is None
    with pytest.raises(CommissioningError, match=reason):
        commissioner.step(readings)


def test_a_muscle_whose_pull_ends_at_once_is_undecided() -> None:
    robot = SpringRobot(0)
    commissioner = Commissioner(nominal_map(), LIMITS, START, MOTORS, held=robot.held)
    while not commissioner.done:
        readings = robot.read()
        if commissioner.stage == f"pull {MUSCLES[3]}":
            readings.tensions[0] = 39.0  # a cable that leans on something
        robot.write(commissioner.step(readings))
    result = commissioner.result()
    assert any(MUSCLES[3] in each.muscles for each in result.undecided)
    assert not any(MUSCLES[3] in each.muscles for each in result.findings)
    assert np.isnan(result.measured[:, 3]).all()


def test_readings_that_come_twice_or_late_in_time_are_skipped() -> None:
    robot = SpringRobot(0)
    commissioner = Commissioner(nominal_map(), LIMITS, START, MOTORS)
    first = robot.read()
    command = commissioner.step(first)
    assert np.array_equal(commissioner.step(first), command)
    earlier = first._replace(time=first.time - 0.01, lengths=first.lengths + 1.0)
    assert np.array_equal(commissioner.step(earlier), command)


def test_a_result_needs_a_whole_run() -> None:
    commissioner = Commissioner(nominal_map(), LIMITS, START, MOTORS)
    with pytest.raises(AgentError, match="until done"):
        commissioner.result()


def test_arguments_are_checked() -> None:
    with pytest.raises(AgentError, match="posture must be 3 finite numbers"):
        Commissioner(nominal_map(), LIMITS, START[:2], MOTORS)
    with pytest.raises(AgentError, match="held must be 12 finite numbers"):
        Commissioner(nominal_map(), LIMITS, START, MOTORS, held=np.full(COUNT, np.nan))
    with pytest.raises(AgentError, match=r"factor is 0\.5"):
        CommissionOptions(factor=0.5)
    with pytest.raises(AgentError, match="release"):
        CommissionOptions(tension=0.8, release=0.7)
    with pytest.raises(AgentError, match="stroke is 0"):
        CommissionOptions(stroke=0.0)
    commissioner = Commissioner(nominal_map(), LIMITS, START, MOTORS)
    with pytest.raises(AgentError, match="shape"):
        commissioner.step(SensorReadings(0.0, np.zeros(3), np.zeros(3)))


def test_the_same_readings_give_the_same_bits() -> None:
    (_, one), other = sound(1), run(SpringRobot(1))
    assert one.measured.tobytes() == other.measured.tobytes()
    assert str(one) == str(other)

"""Muscles on simulated readings: each fault is found, its end, too, and nothing else is named."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.guard import faults
from jmm_agent.guard.faults import MotorControl
from jmm_agent.guard.muscle_monitor import FilteredReadings, MuscleMonitor, MuscleMonitorOptions

DT = 0.02
MOTORS = MotorControl()
MUSCLES = ("one", "two", "three")


class Muscles:
    """Three muscles that pull as their motors are commanded, with noisy encoders."""

    def __init__(self) -> None:
        self.monitor = MuscleMonitor(MUSCLES, MOTORS, MuscleMonitorOptions())
        self.rng, self.steps = np.random.default_rng(0), 0
        self.command = np.zeros(3)
        self.dt = DT

    def run(
        self,
        steps: int,
        spoil: Callable[[np.ndarray, np.ndarray], None] = lambda lengths, tensions: None,
        expected: np.ndarray | None = None,
    ) -> FilteredReadings:
        """Some steps; ``spoil`` changes lengths [m] and tensions [N] of each in place."""
        for _ in range(steps):
            self.steps += 1
            true = self.command + 0.001
            lengths = true + 1e-4 * self.rng.standard_normal(3)
            tensions = MOTORS.demanded(lengths, self.command)
            spoil(lengths, tensions)
            estimated = true if expected is None else expected
            filtered = self.monitor.update(self.dt, lengths, tensions, self.command, estimated)
        return filtered

    @property
    def found(self) -> list[tuple[str, str]]:
        return list(self.monitor.found())


def jump(lengths: np.ndarray, tensions: np.ndarray) -> None:
    lengths[1] += 0.02


def stick(lengths: np.ndarray, tensions: np.ndarray) -> None:
    lengths[1] = 0.0012345


def die(lengths: np.ndarray, tensions: np.ndarray) -> None:
    lengths[1] = np.nan


def go_numb(lengths: np.ndarray, tensions: np.ndarray) -> None:
    tensions[1] = 0.0


def read_nothing(lengths: np.ndarray, tensions: np.ndarray) -> None:
    tensions[1] = np.nan


@pytest.mark.parametrize(
    ("spoil", "kind", "steps"),
    [
        (jump, faults.ENCODER_JUMP, 1),
        (stick, faults.ENCODER_STUCK, 25),
        (die, faults.ENCODER_DEAD, 1),
        (go_numb, faults.TENSION_SENSOR_DEAD, 30),
        (read_nothing, faults.TENSION_SENSOR_DEAD, 1),
    ],
)
def test_a_fault_of_a_muscle_is_named_until_it_ends(
    spoil: Callable[[np.ndarray, np.ndarray], None], kind: str, steps: int
) -> None:
    muscles = Muscles()
    muscles.run(100)
    assert muscles.found == []
    muscles.run(steps, spoil)
    assert muscles.found == [(kind, "two")]
    muscles.run(200, spoil)
    assert muscles.found == [(kind, "two")]
    muscles.run(1)
    assert muscles.found == []


def test_a_muscle_without_tension_that_is_wound_up_has_snapped() -> None:
    muscles = Muscles()
    muscles.run(100)
    wound = 0.0

    def snap(lengths: np.ndarray, tensions: np.ndarray) -> None:
        nonlocal wound
        wound += 0.2 * DT
        lengths[1] -= wound
        tensions[1] = 0.5

    filtered = muscles.run(15, snap)
    assert muscles.found == [(faults.MUSCLE_SNAPPED, "two")]
    assert filtered.unsafe.tolist() == filtered.doubted.tolist() == [False, True, False]
    muscles.run(100, snap)
    assert muscles.found == [(faults.MUSCLE_SNAPPED, "two")]


def test_what_is_not_believed_is_marked_and_replaced() -> None:
    muscles = Muscles()
    muscles.run(100)
    filtered = muscles.run(1, die)
    assert filtered.doubted.tolist() == filtered.unsafe.tolist() == [False, True, False]
    assert np.isfinite(filtered.lengths).all()
    filtered = muscles.run(2, read_nothing)
    assert filtered.numb.tolist() == [False, True, False]
    assert not filtered.doubted.any()
    assert filtered.tensions == pytest.approx(MOTORS.demanded(filtered.lengths, muscles.command))


def test_an_encoder_without_noise_does_not_stick_at_rest() -> None:
    muscles = Muscles()

    def quiet(lengths: np.ndarray, tensions: np.ndarray) -> None:
        lengths[:] = 0.001

    muscles.run(500, quiet)
    assert muscles.found == []


def test_a_fast_muscle_has_not_jumped() -> None:
    muscles = Muscles()
    muscles.run(10)
    for _ in range(20):
        muscles.command = muscles.command + 0.5 * DT
        muscles.run(1)
        assert muscles.found == []


@pytest.mark.parametrize("period", [0.02, 0.03, 0.05])
def test_a_fast_muscle_has_not_jumped_when_stamps_are_closer_than_readings(period: float) -> None:
    """Readings are one period apart; each of their stamps is off by up to 30 % of it."""
    muscles, rng = Muscles(), np.random.default_rng(3)
    muscles.dt = period
    muscles.run(10)
    for step in period + np.diff(0.3 * period * rng.uniform(-1.0, 1.0, 200)):
        muscles.command = muscles.command + 0.4 * period * (-1.0) ** (muscles.steps // 10)
        muscles.dt = float(step)
        muscles.run(1)
        assert muscles.found == []


@pytest.mark.parametrize("lengths", [(0.03,), (0.03, 0.002, 0.025)])
def test_a_muscle_that_was_yanked_is_believed_again_when_the_others_agree(
    lengths: tuple[float, ...],
) -> None:
    muscles = Muscles()
    muscles.run(100)
    for length in lengths:
        lagging = muscles.command + 0.001
        muscles.command = np.array([0.0, length, 0.0])
        muscles.run(1, expected=lagging)  # the estimate of the other muscles lags by a step
    assert muscles.found == [(faults.ENCODER_JUMP, "two")]
    muscles.run(60)
    assert muscles.found == []


def test_an_encoder_that_jumped_is_not_believed_while_its_muscle_moves() -> None:
    muscles = Muscles()
    muscles.run(100)
    for _ in range(300):
        muscles.command = muscles.command + 0.2 * DT
        muscles.run(1, jump)
        assert muscles.found == [(faults.ENCODER_JUMP, "two")]


@pytest.mark.parametrize(
    ("name", "value"), [("stiffness", 0.0), ("bias", np.nan), ("limit", np.inf), ("limit", 20.0)]
)
def test_motors_that_cannot_be_are_refused(name: str, value: float) -> None:
    with pytest.raises(AgentError, match=name):
        MotorControl(**{name: value})

"""Wires on made-up senses: each fault is found, nothing else is named, and it is let go of."""

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
    """Three wires that move slowly and pull as their motors say, with noisy encoders."""

    def __init__(self) -> None:
        self.watch = MuscleMonitor(MUSCLES, MOTORS, MuscleMonitorOptions())
        self.rng, self.steps = np.random.default_rng(0), 0
        self.command = np.zeros(3)

    def live(
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
            told = true if expected is None else expected
            felt = self.watch.update(DT, lengths, tensions, self.command, told)
        return felt

    @property
    def found(self) -> list[tuple[str, str]]:
        return list(self.watch.found())


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
def test_a_fault_of_a_wire_is_named_and_forgotten_when_it_has_gone(
    spoil: Callable[[np.ndarray, np.ndarray], None], kind: str, steps: int
) -> None:
    muscles = Muscles()
    muscles.live(100)
    assert muscles.found == []
    muscles.live(steps, spoil)
    assert muscles.found == [(kind, "two")]
    muscles.live(200, spoil)
    assert muscles.found == [(kind, "two")]
    muscles.live(1)
    assert muscles.found == []


def test_a_wire_without_tension_that_is_wound_up_has_snapped() -> None:
    muscles = Muscles()
    muscles.live(100)
    wound = 0.0

    def snap(lengths: np.ndarray, tensions: np.ndarray) -> None:
        nonlocal wound
        wound += 0.2 * DT
        lengths[1] -= wound
        tensions[1] = 0.5

    felt = muscles.live(15, snap)
    assert muscles.found == [(faults.MUSCLE_SNAPPED, "two")]
    assert felt.unsafe.tolist() == felt.doubted.tolist() == [False, True, False]
    muscles.live(100, snap)
    assert muscles.found == [(faults.MUSCLE_SNAPPED, "two")]


def test_what_is_not_believed_is_marked_and_replaced() -> None:
    muscles = Muscles()
    muscles.live(100)
    felt = muscles.live(1, die)
    assert felt.doubted.tolist() == felt.unsafe.tolist() == [False, True, False]
    assert np.isfinite(felt.lengths).all()
    felt = muscles.live(2, read_nothing)
    assert felt.numb.tolist() == [False, True, False]
    assert not felt.doubted.any()
    assert felt.tensions == pytest.approx(MOTORS.demanded(felt.lengths, muscles.command))


def test_an_encoder_without_noise_does_not_stick_at_rest() -> None:
    muscles = Muscles()

    def quiet(lengths: np.ndarray, tensions: np.ndarray) -> None:
        lengths[:] = 0.001

    muscles.live(500, quiet)
    assert muscles.found == []


def test_a_fast_wire_has_not_jumped() -> None:
    muscles = Muscles()
    muscles.live(10)
    for _ in range(20):
        muscles.command = muscles.command + 0.5 * DT
        muscles.live(1)
        assert muscles.found == []


@pytest.mark.parametrize("lengths", [(0.03,), (0.03, 0.002, 0.025)])
def test_a_wire_that_was_yanked_is_believed_again_as_the_others_tell_the_same(
    lengths: tuple[float, ...],
) -> None:
    muscles = Muscles()
    muscles.live(100)
    for length in lengths:
        lagging = muscles.command + 0.001
        muscles.command = np.array([0.0, length, 0.0])
        muscles.live(1, expected=lagging)  # what the other wires tell comes a step later
    assert muscles.found == [(faults.ENCODER_JUMP, "two")]
    muscles.live(60)
    assert muscles.found == []


def test_an_encoder_that_jumped_is_not_believed_while_its_wire_moves() -> None:
    muscles = Muscles()
    muscles.live(100)
    for _ in range(300):
        muscles.command = muscles.command + 0.2 * DT
        muscles.live(1, jump)
        assert muscles.found == [(faults.ENCODER_JUMP, "two")]


@pytest.mark.parametrize(
    ("name", "value"), [("stiffness", 0.0), ("bias", np.nan), ("limit", np.inf), ("limit", 20.0)]
)
def test_motors_that_cannot_be_are_refused(name: str, value: float) -> None:
    with pytest.raises(AgentError, match=name):
        MotorControl(**{name: value})

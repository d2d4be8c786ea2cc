"""The nearest posture that remaining muscles can hold, on arms of which it is known."""

from __future__ import annotations

from copy import deepcopy
from typing import Any, cast

import numpy as np
import pytest

from jmm_agent.guard.faults import MotorControl
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.nearest_posture import MARGIN, NearestPosture, joint_offset
from jmm_agent.tension_distribution import (
    Distribution,
    TensionDistribution,
    TensionOptions,
    distribute,
)
from jmm_agent.types import Floats


class Pulleys:
    """A map whose muscles run over pulleys: constant moment arms (m, n) [m/rad]."""

    def __init__(self, arms: Floats) -> None:
        self._arms = arms
        self.muscles = tuple(f"m{k}" for k in range(len(arms)))
        self.joints = tuple("abc"[: arms.shape[1]])

    def jacobian(self, q: Floats) -> Floats:
        return np.broadcast_to(self._arms, (*np.shape(q)[:-1], *self._arms.shape)).copy()

    def tension_jacobian(self, tensions: Floats) -> Floats:
        return np.zeros(len(tensions))

    def torque_slope(self, angles: Floats, tensions: Floats) -> Floats:
        return np.zeros((len(angles), angles.shape[1], angles.shape[1]))


class Pendulum:
    """Gravity bends each joint by a torque that is largest where it is level."""

    acceleration = np.array([0.0, 0.0, -9.81])

    def __init__(self, torque: float) -> None:
        self._torque = torque

    def gravity(self, posture: Floats) -> Floats:
        return self._torque * np.cos(posture)


def search(arms: Floats, torque: float, motors: MotorControl, out: int, wanted: Any) -> Any:
    """Search without a muscle; joints turn by 1.2 rad in both directions."""
    jmm = cast(JointMuscleMap, Pulleys(arms))
    distribution = TensionDistribution(Pendulum(torque), TensionOptions())
    distribution.in_use = np.arange(len(arms)) != out
    distribution.limits = np.tile([-1.2, 1.2], (arms.shape[1], 1))
    q = np.array(wanted, dtype=float)
    return NearestPosture(q, jmm, motors, distribution, joint_offset(q))


@pytest.mark.parametrize(("metres", "newtons"), [(1.0, 1.0), (0.03, 0.01), (5.0, 40.0)])
def test_a_pendulum_goes_where_its_weaker_muscle_holds_it(metres: float, newtons: float) -> None:
    """The strong muscle has snapped; the weak one holds 0.6 of the largest torque."""
    motors = MotorControl(3e4 * newtons / metres, 30.0 * newtons, 500.0 * newtons)
    arms = metres * np.array([[0.05], [0.02], [-0.04]])
    torque = metres * newtons * (0.02 * 500.0 - 0.04 * 30.0) / 0.6
    found = search(arms, torque, motors, 0, [0.1])
    assert not found.done
    best = found.run()
    edge = np.arccos(0.6)
    low, high = MARGIN
    inside = np.arccos((0.02 * 500.0 * (1 - high) - 0.04 * 30.0 * (1 + low)) * 0.6 / 8.8)
    assert best.holds
    assert edge - 1e-6 <= best.posture[0] <= inside + 0.01
    assert best.pull.tensions[0] == 0.0
    assert best.pull.tensions.max() <= motors.limit
    np.testing.assert_allclose(best.pull.missing, 0.0, atol=1e-3 * torque)


def test_a_posture_that_can_be_held_stays() -> None:
    arms = 0.1 * np.array([[0.5], [0.4], [-0.4]])
    found = search(arms, 3.0, MotorControl(), 0, [0.3])
    assert found.done
    assert found.run().posture[0] == 0.3


@pytest.mark.parametrize(("torque", "stop"), [(2.0, 1.2), (-2.0, -1.2)])
def test_a_joint_without_a_muscle_against_its_load_rests_at_its_stop(
    torque: float, stop: float
) -> None:
    """Joint b is held by its muscles; joint a has lost the one that held it up."""
    sign = np.sign(torque)
    arms = 0.04 * np.array([[sign, 0.0], [-sign, 0.0], [0.0, 1.0], [0.0, -1.0]])
    found = search(arms, torque, MotorControl(), 0, [0.2, 0.5])
    missing = found.best.pull.missing
    assert found.best.pull.lacking(MotorControl()) == 0
    assert missing[0] == pytest.approx(torque * np.cos(0.2) + sign * 0.04 * 30.0, rel=1e-3)
    best = found.run()
    assert best.holds
    np.testing.assert_allclose(best.posture, [stop, 0.5], atol=1e-3)
    assert best.pull.tensions.max() < 150.0  # nothing pulls against the stop


def test_tensions_leave_the_reserve_before_torque_is_missing() -> None:
    arms = np.array([[0.0], [-0.04]])
    low, torque = np.array([0.0, 40.0]), np.array([-0.04 * 32.0])
    kept = distribute(arms, torque, low, 500.0)
    assert abs(kept.missing[0]) > 0.1
    less = distribute(arms, torque, low, 500.0, least=np.array([0.0, 30.0]))
    assert abs(less.missing[0]) < 1e-3
    assert less.tensions[1] == pytest.approx(32.0, abs=0.1)


def test_a_search_that_was_copied_goes_on_in_both() -> None:
    arms = 0.04 * np.array([[1.0], [-1.0]])
    found = search(arms, 2.0, MotorControl(), 0, [0.2])
    found.advance()
    other = deepcopy(found)
    assert found.run().posture == other.run().posture


def test_the_largest_missing_torque_names_the_joint() -> None:
    motors = MotorControl()
    found = Distribution(np.zeros(3), np.array([0.2, -0.9, 0.1]), np.full((3, 3), 0.04))
    assert found.lacking(motors) == 1
    assert found._replace(missing=np.zeros(3)).lacking(motors) is None

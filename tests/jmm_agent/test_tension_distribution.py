"""Tensions with the least internal force, on small and large robots, and loads beyond them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import MotorControl
from jmm_agent.tension_distribution import (
    TensionDistribution,
    TensionOptions,
    distribute,
    not_balanced,
)
from jmm_agent.types import Floats
from tests.jmm_agent.small_map import JOINTS, make_map, postures

MOTORS = MotorControl(30_000.0, 30.0, 500.0)
THREE = np.array([[0.03, 0.0], [-0.02, 0.025], [-0.01, -0.03]])
"""Moment arms of two joints and three muscles [m/rad]."""


class Weight:
    """Loads that pull each joint down, more at larger angles."""

    def __init__(self, torque: float = 0.05) -> None:
        self.torque = torque

    def gravity(self, posture: Floats) -> Floats:
        return self.torque * np.cos(posture)


def test_a_single_muscle_against_gravity_pulls_by_its_arm() -> None:
    found = distribute(np.array([[0.05], [-0.05]]), np.array([2.0]), np.full(2, 10.0), 500.0)
    np.testing.assert_allclose(found.tensions, [50.0, 10.0], rtol=1e-6)
    assert abs(found.missing[0]) < 1e-4


def test_without_a_load_that_all_muscles_feel_they_stay_at_the_least_tension() -> None:
    low = np.array([40.0, 35.0, 30.0])
    found = distribute(THREE, low @ THREE, low, 500.0)
    np.testing.assert_allclose(found.tensions, low, rtol=1e-7)


@pytest.mark.parametrize(
    ("joints", "muscles", "newtons", "metres"),
    [(2, 3, 100.0, 0.03), (1, 2, 1e-3, 1e-3), (14, 36, 200.0, 0.04), (6, 9, 5e4, 0.5)],
)
def test_the_programme_is_the_bounded_least_squares_of_another_solver(
    joints: int, muscles: int, newtons: float, metres: float
) -> None:
    rng = np.random.default_rng([joints, muscles])
    for _ in range(20):
        arms = metres * rng.normal(size=(muscles, joints))
        low = newtons * rng.uniform(0.05, 0.1, muscles)
        torque = newtons * metres * rng.normal(size=joints)
        found = distribute(arms, torque, low, newtons)
        scale = np.abs(arms).max()
        rows = np.vstack([np.eye(muscles), 1e3 * arms.T / scale])
        right = np.concatenate([low / newtons, 1e3 * torque / (scale * newtons)])
        other = newtons * lsq_linear(rows, right, (low / newtons, 1.0), "bvls", 1e-14).x
        np.testing.assert_allclose(found.tensions, other, atol=1e-5 * newtons)
        assert np.all((found.tensions >= low) & (found.tensions <= newtons))
        np.testing.assert_allclose(found.missing, torque - arms.T @ found.tensions, atol=1e-12)


def test_a_load_beyond_the_muscles_leaves_the_least_torque_missing_and_names_the_joint() -> None:
    torque = np.array([1.0, -20.0])
    found = distribute(THREE, torque, np.full(3, 30.0), 500.0)
    least = lsq_linear(THREE.T, torque, (30.0, 500.0), "bvls").x
    np.testing.assert_allclose(found.missing, torque - THREE.T @ least, atol=0.05)
    assert found.tensions.max() <= 500.0
    sentence = found.failure(MOTORS, ("shoulder", "elbow"))
    assert "T_bias = 30 N to 500 N balances joint 'elbow', where" in sentence
    assert sentence.endswith("N m are missing")


def test_a_joint_without_a_muscle_on_one_side_is_named_only_if_the_load_needs_it() -> None:
    arms = np.array([[0.03, 0.0], [-0.03, 0.0], [0.0, 0.02]])
    low = np.full(3, 30.0)
    held = distribute(arms, np.array([0.5, 2.0]), low, 500.0)
    assert held.failure(MOTORS, "ab") == ""
    fallen = distribute(arms, np.array([0.5, -2.0]), low, 500.0)
    assert "joint 'b', where 2.6 N m are missing" in fallen.failure(MOTORS, "ab")
    np.testing.assert_allclose(fallen.tensions[:2], held.tensions[:2], atol=0.01)


def test_degenerate_robots_have_a_solution() -> None:
    rng = np.random.default_rng(3)
    for _ in range(300):
        joints, muscles = rng.integers(1, 8), rng.integers(1, 12)
        arms = 0.03 * rng.normal(size=(muscles, joints))
        arms[rng.random(arms.shape) < 0.5] = 0.0
        arms[:, 0] *= rng.choice([0.0, 1.0, 1e-6])
        if muscles > 1:
            arms[-1] = arms[0]
        low = np.full(muscles, 30.0)
        found = distribute(arms, rng.normal(size=joints) * rng.choice([0.1, 1e3]), low, 500.0)
        assert np.isfinite(found.tensions).all()
        assert np.all((found.tensions >= low) & (found.tensions <= 500.0))


@pytest.mark.parametrize(
    ("arms", "torque", "low"),
    [
        (np.full((3, 2), np.nan), np.zeros(2), np.full(3, 30.0)),
        (THREE, np.array([np.inf, 0.0]), np.full(3, 30.0)),
        (THREE, np.zeros(2), np.full(3, 600.0)),
    ],
)
def test_what_cannot_be_used_is_refused(arms: Floats, torque: Floats, low: Floats) -> None:
    with pytest.raises(AgentError, match="must be finite, and the lowest tension"):
        distribute(arms, torque, low, 500.0)


def test_the_reserve_is_kept_where_the_stiffness_is_low() -> None:
    options = TensionOptions(reserve=0.5, length_error=0.003)
    soft = options.low(MotorControl(3_000.0, 30.0, 500.0), 4)
    np.testing.assert_allclose(soft, 45.0)  # 15 N are 5 mm at 3 N/mm, more than 3 mm
    stiff = options.low(MotorControl(30_000.0, 30.0, 500.0), 2)
    np.testing.assert_allclose(stiff, 30.0 + 15.0 * (0.5 / 3.0))
    each = options.low(MotorControl(each=np.array([3e3, 3e4])), 2)
    np.testing.assert_allclose(each, [soft[0], stiff[0]])
    firm = options.low(MotorControl(each=np.array([3e3, 3e4, 6e4])), 3, np.array([1, 1, 0]) > 0)
    np.testing.assert_allclose(firm, [45.0, 120.0, 30.0 + 15.0 * (0.25 / 3.0)])
    near = options.low(MotorControl(3_000.0, 30.0, 35.0), 1)  # no more than the limit
    assert near[0] <= 35.0
    with pytest.raises(AgentError, match=r"reserve is -0\.1"):
        TensionOptions(reserve=-0.1)
    with pytest.raises(AgentError, match="length_error is 0"):
        TensionOptions(length_error=0.0)


def test_moment_arms_are_those_of_the_map_as_learned() -> None:
    distribution = TensionDistribution(Weight(), TensionOptions())
    for seed in (0, 1):
        jmm, q = make_map(seed), postures(1, seed)[0]
        found = distribution.at(jmm, MOTORS, q)
        expected = Weight().gravity(q) - found.tensions @ jmm.jacobian(q)
        np.testing.assert_allclose(found.missing, expected, atol=1e-12)
    heavy = TensionDistribution(Weight(1e4), TensionOptions())
    pulls = [heavy.at(jmm, MOTORS, q)] * 2
    sentence = not_balanced(pulls, JOINTS, MOTORS)
    assert sentence.startswith("Posture 0 of 2 cannot be held by the map as learned: no pull of")
    assert any(repr(joint) in sentence for joint in JOINTS)
    assert not_balanced(pulls[:1], JOINTS, MOTORS).startswith("The posture cannot be held")


def test_the_slope_is_how_torques_of_constant_tensions_change() -> None:
    distribution, jmm = TensionDistribution(Weight(3.0), TensionOptions()), make_map()
    q, tensions = postures(1)[0], np.array([10.0, 50.0, 30.0, 80.0, 20.0])
    slope = distribution.slope(jmm, q, tensions)

    def torque(at: Floats) -> Floats:
        return tensions @ jmm.jacobian(at) - Weight(3.0).gravity(at)

    moved = 1e-3 * np.array([1.0, -2.0, 0.5, 1.5])
    change = torque(q + moved) - torque(q - moved)
    np.testing.assert_allclose(2.0 * slope @ moved, change, atol=2e-4 * np.abs(change).max())

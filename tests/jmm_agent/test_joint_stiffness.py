"""Stiffness of joints: what a push shows, and muscles for wanted joints."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.joint_stiffness import PostureStiffness, Stiffness
from jmm_agent.types import Floats

TWO = np.array([[0.03, 0.0], [-0.02, 0.025], [-0.01, -0.03]])
"""Moment arms of two joints and three muscles [m/rad]."""
LIMITS = np.array([1_000.0, 60_000.0])


def made(arms: Floats = TWO, rest: float = -0.5, compliance: float = 1e-5) -> PostureStiffness:
    return PostureStiffness(arms, rest * np.eye(arms.shape[1]), np.full(arms.shape[0], compliance))


def test_a_joint_with_a_muscle_has_its_stiffness_times_the_squared_arm() -> None:
    one = made(np.array([[0.05]]), rest=0.0, compliance=1.0 / 20_000.0)
    [stiffness] = one.joints(np.array([20_000.0]))
    assert stiffness == pytest.approx(10_000.0 * 0.05**2)  # motor and tendon in series


def test_the_stiffness_of_a_joint_is_what_a_push_at_it_alone_shows() -> None:
    muscles = np.array([10_000.0, 20_000.0, 5_000.0])
    joints = made().joints(muscles)
    for number, push in enumerate(np.eye(2)):
        moved = np.linalg.solve(made().matrix(muscles), push)
        assert joints[number] == pytest.approx(1.0 / moved[number])
        assert joints[number] < made().matrix(muscles)[number, number]


@pytest.mark.parametrize(("joints", "muscles"), [(2, 3), (1, 2), (5, 9), (14, 36)])
def test_wanted_joints_within_reach_are_reached(joints: int, muscles: int) -> None:
    rng = np.random.default_rng([joints, muscles])
    for _ in range(5):
        posture = made(0.03 * rng.normal(size=(muscles, joints)))
        true = rng.uniform(3_000.0, 30_000.0, muscles)
        wanted = dict(enumerate(posture.joints(true).tolist()))
        start = np.full(muscles, 30_000.0)
        found = posture.muscles_for(wanted, start, LIMITS)
        assert np.all((found >= LIMITS[0]) & (found <= LIMITS[1]))
        np.testing.assert_allclose(posture.joints(found), list(wanted.values()), rtol=0.04)


def test_other_joints_and_muscles_change_as_little_as_possible() -> None:
    arms = np.array([[0.03, 0.0], [-0.03, 0.0], [0.0, 0.03], [0.0, -0.03]])
    start = np.full(4, 20_000.0)
    before = made(arms).joints(start)
    found = made(arms).muscles_for({0: 0.5 * before[0]}, start, LIMITS)
    np.testing.assert_allclose(found[2:], start[2:], rtol=1e-3)
    np.testing.assert_allclose(made(arms).joints(found), [0.5 * before[0], before[1]], rtol=0.02)
    assert found[0] == pytest.approx(found[1], rel=1e-3)


def test_what_is_out_of_reach_ends_at_the_limits_and_is_named() -> None:
    start = np.full(3, 20_000.0)
    found = made().muscles_for({1: 1e4}, start, LIMITS)
    assert found[1:] == pytest.approx(LIMITS[1], rel=1e-3)
    joints = dict(zip("ab", made().joints(found).tolist(), strict=True))
    result = Stiffness(found, joints, {"b": 1e4}, True)
    assert result.missed == (
        f"Within the limits of the muscles joint 'b' has {joints['b']:.3g} N m/rad, not 1e+04."
    )
    assert Stiffness(found, joints, {"a": joints["a"]}, True).missed == ""


def test_an_unstable_posture_has_no_stiffness_and_is_left_if_it_can_be() -> None:
    heavy = made(rest=-5.0)
    soft = np.full(3, 1_000.0)
    np.testing.assert_array_equal(heavy.joints(soft), [0.0, 0.0])
    assert "not stable" in Stiffness(soft, {}, {}, False).missed
    found = heavy.muscles_for({0: 2.0}, soft, LIMITS)
    assert heavy.joints(found)[0] == pytest.approx(2.0, rel=0.05)
    hopeless = made(rest=-1e4).muscles_for({0: 2.0}, soft, LIMITS)
    assert np.all((hopeless >= LIMITS[0]) & (hopeless <= LIMITS[1]))

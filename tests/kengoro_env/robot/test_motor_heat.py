"""Motors that heat: the exact steps, the sensors, and what changes without them (nothing)."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from kengoro_env.departures import HeatingMotors
from kengoro_env.errors import ArgumentError, UnknownNameError
from kengoro_env.robot.motor_heat import HeatSpec, MotorHeat, exponential
from tests.kengoro_env.environments import make

MOTORS = {
    "medium": (4e-4, 21.5, 174.0, 1.93, 4.65),
    "small": (2e-3, 2.6, 12.9, 1.93, 4.65),
}


def motors(noise: float = 0.0, quantum: float = 0.0, swing: float = 0.0) -> MotorHeat:
    return MotorHeat(HeatSpec(MOTORS, 0.0039, 22.0, swing, noise, quantum, 1.0))


@pytest.mark.parametrize("step", [pytest.param(0.002, marks=pytest.mark.slow), 0.02, 5.0, 300.0])
def test_the_length_of_a_step_does_not_matter(step: float) -> None:
    heat, tensions = motors(), np.array([150.0, 70.0])
    for _ in range(round(300.0 / step)):
        heat.advance(tensions, step)

    def slopes(_: float, x: np.ndarray) -> np.ndarray:
        h, c1, c2, r1, r2 = np.array(list(MOTORS.values())).T
        core, housing = x.reshape(2, 2)
        flow = (core - housing) / r1
        warming = h * tensions**2 * (1.0 + 0.0039 * (core - 25.0))
        return np.concatenate([(warming - flow) / c1, (flow - (housing - 22.0) / r2) / c2])

    true = solve_ivp(slopes, (0.0, 300.0), np.full(4, 22.0), "Radau", rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(np.r_[heat.core, heat.housing], true.y[:, -1], rtol=1e-6)


def test_exponentials_of_small_and_large_matrices() -> None:
    rng = np.random.default_rng(0)
    for scale in (0.0, 1e-6, 0.3, 20.0):
        matrices = scale * rng.standard_normal((4, 3, 3))
        for ours, matrix in zip(exponential(matrices), matrices, strict=True):
            np.testing.assert_allclose(ours, expm(matrix), rtol=1e-7, atol=1e-9)


def test_readings_are_coarse_noisy_and_slow() -> None:
    heat, seen = motors(0.3, 0.5), []
    for _ in range(400):
        heat.advance(np.array([100.0, 30.0]), 0.25)
        seen.append(heat.readings)
    readings = np.array(seen)
    np.testing.assert_allclose(readings, np.round(readings * 2.0) / 2.0)
    assert (np.diff(readings[3::4].repeat(4, axis=0), axis=0)[1::4] == 0.0).all()
    changed = (np.diff(readings, axis=0) != 0.0).any(axis=1)
    assert 10 < changed.sum() <= 100  # once a second at most


def test_a_changed_parameter_lasts_until_the_reset() -> None:
    heat = motors()
    heat.change("small", "housing_to_ambient", 1.25)
    assert heat.parameters[1, 4] == pytest.approx(1.25 * 4.65)
    heat.reset(np.random.default_rng(0))
    assert heat.parameters[1, 4] == 4.65
    for wrong in (("huge", "core_capacity", 2.0), ("small", "mass", 2.0)):
        with pytest.raises(UnknownNameError):
            heat.change(*wrong)
    with pytest.raises(ArgumentError, match="factor"):
        heat.change("small", "core_capacity", 0.0)


def rollout(departures: tuple[Any, ...]) -> list[dict[str, Any]]:
    env = make("Kengoro/Elbow-v0", departures=departures)
    observed = [env.reset(seed=3)[0]]
    for number in range(20):
        action = np.full(env.action_space.shape, 0.1 * np.sin(number), dtype=np.float32)
        observed.append(env.step(action)[0])
    env.close()
    return observed


def test_without_heat_all_bits_and_keys_are_as_before_and_with_it_the_motion_is() -> None:
    plain, null = rollout(()), rollout((HeatingMotors(),))
    warm = rollout((HeatingMotors(heat=4e-4, seed=1),))
    for a, b, c in zip(plain, null, warm, strict=True):
        assert set(a) == set(b) == set(c) - {"temperatures"}
        for key in a:
            np.testing.assert_array_equal(a[key], b[key])
            np.testing.assert_array_equal(a[key], c[key])


def test_the_truth_is_in_info_and_readings_are_in_the_space() -> None:
    env = make("Kengoro/Elbow-v0", departures=(HeatingMotors(heat=0.05, seed=1),))
    observation, info = env.reset(seed=1)
    start = info["core_temperatures"].copy()
    for _ in range(50):
        observation, _, _, _, info = env.step(np.zeros(env.action_space.shape, dtype=np.float32))
    assert env.observation_space.contains(observation)
    assert observation["temperatures"].shape == (len(env.muscles),)
    assert (info["core_temperatures"] > start).all()
    assert (info["core_temperatures"] > info["housing_temperatures"]).all()
    env.close()


def test_motors_of_another_seed_differ_by_the_spread() -> None:
    env = make("Kengoro/Posture-v0", departures=(HeatingMotors(heat=4e-4, seed=1),), camera=False)
    heat = env.robot.heat
    assert heat is not None
    nominal = np.array([4e-4, 21.5, 174.0, 1.93, 4.65])
    departure = np.log(heat.parameters / nominal)
    assert 0.15 < departure.std() < 0.22
    assert np.abs(departure).max() <= 0.4 + 1e-9
    env.close()


def test_vector_environments_refuse_it_in_a_sentence() -> None:
    with pytest.raises(ArgumentError, match="HeatingMotors"):
        gym.make_vec(
            "Kengoro/Elbow-v0", 2, vectorization_mode="vector_entry_point",
            departures=(HeatingMotors(heat=4e-4),),
        )  # fmt: skip

"""The thermal model: exact steps, and what temperatures cannot show."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jmm_agent.errors import AgentError
from jmm_agent.heat.model import FIRST, SIZE, advanced, advanced_with_slopes
from jmm_agent.heat.parameters import HeatOptions, ThermalParameters

MOTORS = (
    ThermalParameters(),
    ThermalParameters(2e-3, 2.6, 12.9, 1.93, 4.65),  # 5 s and 60 s
    ThermalParameters(1e-6, 900.0, 9000.0, 0.25, 0.8),  # 225 s and 2 h
)


def state_of(motor: ThermalParameters) -> np.ndarray:
    return np.concatenate([[61.0, 38.0, 19.0], np.log(motor.array)])


@pytest.mark.parametrize("motor", MOTORS)
@pytest.mark.parametrize("growth", [0.0, 0.0039])
def test_a_step_of_any_length_is_the_solution_of_the_equations(
    motor: ThermalParameters, growth: float
) -> None:
    h, c1, c2, r1, r2 = motor.array
    heat = 20.0 / h  # 20 W

    def slope(_: float, x: np.ndarray) -> list[float]:
        flow = (x[0] - x[1]) / r1
        warming = h * heat * (1.0 + growth * (x[0] - 25.0))
        return [(warming - flow) / c1, (flow - (x[1] - 19.0) / r2) / c2]

    for time in (0.1 * motor.core_time, motor.housing_time):
        found = solve_ivp(slope, (0.0, time), [61.0, 38.0], "Radau", rtol=1e-10, atol=1e-10)
        ours = advanced(state_of(motor), np.array(heat), time, growth)
        np.testing.assert_allclose(ours, found.y[:, -1], rtol=1e-6)


def test_two_steps_are_one_step_of_twice_the_time() -> None:
    state, heat = state_of(MOTORS[0]), np.array(9e3)
    once = advanced(state, heat, 60.0, 0.0039)
    half = np.concatenate([advanced(state, heat, 30.0, 0.0039), state[2:]])
    np.testing.assert_allclose(advanced(half, heat, 30.0, 0.0039), once, rtol=1e-12)


@pytest.mark.parametrize("motor", MOTORS)
def test_slopes_are_the_difference_quotients(motor: ThermalParameters) -> None:
    state, heat, time = state_of(motor), np.array(15.0 / motor.heat_per_tension), motor.core_time
    _, slopes = advanced_with_slopes(state, heat, time, 0.0039)
    for entry in range(SIZE):
        step = 1e-4 * np.eye(SIZE)[entry]
        high, low = (advanced(state + sign * step, heat, time, 0.0039) for sign in (1, -1))
        np.testing.assert_allclose(slopes[:, entry], (high - low) / 2e-4, rtol=1e-3, atol=1e-3)


def test_temperatures_do_not_show_a_common_factor_of_heat_capacities_and_conductances() -> None:
    state = state_of(MOTORS[0])
    other = state.copy()
    other[FIRST:] += np.log(2.0) * np.array([1.0, 1.0, 1.0, -1.0, -1.0])
    heat = np.array(1e4)
    np.testing.assert_allclose(
        advanced(other, heat, 100.0, 0.0039), advanced(state, heat, 100.0, 0.0039), rtol=1e-12
    )


def test_a_winding_that_runs_away_stays_finite_for_a_while() -> None:
    """Where the growth of the resistance outweighs the cooling, one eigenvalue is positive."""
    state = state_of(MOTORS[0])
    hot = advanced(state, np.array(500.0**2), 20.0, 0.0039)
    assert 120.0 < hot[0] < 1000.0


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_parameters_must_be_positive(value: float) -> None:
    with pytest.raises(AgentError, match="core_capacity"):
        ThermalParameters(core_capacity=value)


@pytest.mark.parametrize(
    "wrong",
    [
        {"limit": 20.0},
        {"spread": 0.0},
        {"horizon": -1.0},
        {"growth": -0.1},
        {"sigmas": np.nan},
        {"ambient": np.nan},
    ],
)
def test_options_out_of_their_range_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(AgentError, match=next(iter(wrong))):
        HeatOptions(**wrong)

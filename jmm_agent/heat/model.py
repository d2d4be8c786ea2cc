"""Thermal model of a motor with two capacities and two resistances.

After the equations of Kawaharazuka et al. 2020 (Estimation and control of motor core temperature
with online learning of thermal model parameters). The core (winding) has the temperature T1, the
housing T2, the surroundings Ta; the tension f heats the core:

    C1 T1' = h f^2 (1 + g (T1 - 25)) - (T1 - T2) / R1
    C2 T2' = (T1 - T2) / R1 - (T2 - Ta) / R2

The five parameters are h, C1, C2, R1 and R2 (`ThermalParameters`); g is the growth of the winding's
resistance. While f is constant the equations are linear, and each step is exact: with
x = (T1, T2), x' = A x + v,

    x(t) = exp(A t) x(0) + (integral of exp(A s) from 0 to t) v

The eigenvalues of A are real and different, because its entries off the diagonal are positive, so
that a function of A is the line through its values at both eigenvalues.

Temperatures depend on h, C1, C2, R1 and R2 through four ratios only: twice the heat, twice the
capacities and half the resistances are the same motor. Of these four the housing's temperature
shows three well; how far the core is above the housing, relative to the housing above its
surroundings (R1 / R2), shows little and is mostly what the data sheet says.
"""

from __future__ import annotations

import numpy as np

from jmm_agent.types import Floats

REFERENCE = 25.0
"""Temperature at which the winding has its nominal resistance [degC]."""
CORE, HOUSING, AMBIENT, FIRST = range(4)
"""Entries of a state: T1, T2, Ta [degC], and the logarithms of the parameters from FIRST on."""
SIZE = 8
"""Number of entries of a state."""
RATES = np.array(
    [
        [1.0, -1.0, 0.0, 0.0, 0.0],
        [0.0, -1.0, 0.0, -1.0, 0.0],
        [0.0, 0.0, -1.0, -1.0, 0.0],
        [0.0, 0.0, -1.0, 0.0, -1.0],
    ]
)
"""Logarithms of h/C1, 1/(R1 C1), 1/(R1 C2), 1/(R2 C2) by those of the parameters (4, 5)."""
NUDGE = 1e-5
"""Change of the logarithm of a rate in difference quotients [1]."""


def advanced(state: Floats, heat: Floats, time: Floats | float, growth: float) -> Floats:
    """Temperatures of core and housing after a time (..., 2) [degC].

    Args:
        state: states (..., 8), see `CORE`, `HOUSING`, `AMBIENT`, `FIRST`.
        heat: mean square of the tension meanwhile (...) [N^2].
        time: [s].
        growth: of the winding's resistance [1/K].
    """
    rates = state[..., FIRST:] @ RATES.T
    return _advanced(state[..., :FIRST], np.exp(rates), heat, time, growth)[0]


def advanced_with_slopes(
    state: Floats, heat: Floats, time: Floats | float, growth: float
) -> tuple[Floats, Floats]:
    """Temperatures after a time (..., 2) [degC], and their derivatives (..., 2, 8) by the state.

    Args:
        state: states (..., 8).
        heat: mean square of the tension meanwhile (...) [N^2].
        time: [s].
        growth: of the winding's resistance [1/K].
    """
    logs = state[..., FIRST:] @ RATES.T
    nudged = logs[..., None, :] + NUDGE * np.vstack([np.zeros(4), np.eye(4)])
    values, flow, forced = _advanced(
        state[..., None, :FIRST],
        np.exp(nudged),
        np.asarray(heat)[..., None],
        np.asarray(time)[..., None] if np.ndim(time) else time,
        growth,
    )
    by_rate = (values[..., 1:, :] - values[..., :1, :]) / NUDGE
    slopes = np.empty((*values.shape[:-2], 2, SIZE))
    slopes[..., :AMBIENT] = flow[..., 0, :, :]
    slopes[..., AMBIENT] = forced[..., 0, :]
    slopes[..., FIRST:] = np.swapaxes(by_rate, -1, -2) @ RATES
    return values[..., 0, :], slopes


def _advanced(
    temperatures: Floats, rates: Floats, heat: Floats, time: Floats | float, growth: float
) -> tuple[Floats, Floats, Floats]:
    """Temperatures (..., 2), exp(A t) (..., 2, 2), and the derivative by Ta (..., 2)."""
    warming, a, b, c = np.moveaxis(rates, -1, 0)
    warming = warming * heat
    core, housing, ambient = np.moveaxis(temperatures, -1, 0)
    first, last = warming * growth - a, -(b + c)
    middle, half = 0.5 * (first + last), 0.5 * (first - last)
    root = np.sqrt(half * half + a * b)
    high, low = middle + root, middle - root
    entries = first, a, b, last
    flow = _function(entries, high, low, root, np.exp(high * time), np.exp(low * time))
    filled = _function(entries, high, low, root, _integral(high, time), _integral(low, time))
    source = warming * (1.0 - growth * REFERENCE)
    forced = np.stack([filled[1] * c, filled[3] * c], axis=-1)
    result = np.stack(
        [
            flow[0] * core + flow[1] * housing + filled[0] * source,
            flow[2] * core + flow[3] * housing + filled[2] * source,
        ],
        axis=-1,
    )
    result = result + forced * np.asarray(ambient)[..., None]
    matrix = np.stack([np.stack(flow[:2], axis=-1), np.stack(flow[2:], axis=-1)], axis=-2)
    return result, matrix, forced


def _integral(rate: Floats, time: Floats | float) -> Floats:
    """Integral of exp(rate s) over s from 0 to a time [s]."""
    safe = np.where(np.abs(rate) * time < 1e-9, 1.0, rate)
    return np.where(np.abs(rate) * time < 1e-9, time, np.expm1(safe * time) / safe)


def _function(
    entries: tuple[Floats, ...],
    high: Floats,
    low: Floats,
    root: Floats,
    at_high: Floats,
    at_low: Floats,
) -> tuple[Floats, Floats, Floats, Floats]:
    """A function of the matrix with these entries, by its values at both eigenvalues."""
    slope = (at_high - at_low) / (2.0 * root)
    constant = (high * at_low - low * at_high) / (2.0 * root)
    first, upper, lower, last = entries
    return slope * first + constant, slope * upper, slope * lower, slope * last + constant

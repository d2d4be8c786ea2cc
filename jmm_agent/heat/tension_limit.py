"""Tensions that motors may hold for a time without a core that becomes too hot.

A constant tension f from now on leads to the core temperature T1(t; f^2), which increases with f.
The largest f is taken for which the upper end of its interval,

    T1(t; f^2) + sigmas sqrt(J P J' + q),   J = dT1/dx,

is at most the limit, both soon (t = an eighth of the core time constant) and at the horizon. A cold
motor may thus pull more than it could forever, by what its capacities take up; with each new
estimate the allowed tension falls, and ends at the one that it may hold forever.
"""

from __future__ import annotations

import numpy as np

from jmm_agent.heat.model import AMBIENT, CORE, FIRST, advanced_with_slopes
from jmm_agent.heat.parameters import HeatOptions
from jmm_agent.heat.thermal_filter import HOUR, ThermalFilter
from jmm_agent.types import Floats

GRID = 24
"""Number of tensions that are tried."""
SOON = 0.125
"""Shorter horizon, in core time constants [1]."""


def core_after(
    filters: ThermalFilter, heat: Floats, time: float, options: HeatOptions
) -> tuple[Floats, Floats]:
    """Core temperatures (...) [degC] after a time, and half the width of their interval (...) [K].

    Args:
        filters: of the motors.
        heat: square of a constant tension (...) [N^2]; axes before those of the motors are allowed.
        time: [s].
        options: width of the interval, and growth of the resistance.
    """
    x = np.broadcast_to(filters.x, (*heat.shape, filters.x.shape[-1]))
    values, slopes = advanced_with_slopes(x, heat, time, options.growth)
    slope = slopes[..., CORE, :]
    variance = np.einsum("...i,...ij,...j->...", slope, filters.p, slope)
    warming = np.exp(x[..., FIRST] - x[..., FIRST + 1]) * heat
    lasting = min(time, options.nominal.core_time)
    variance += (options.heat_noise * warming) ** 2 * lasting * options.nominal.core_time
    variance += options.ambient_drift**2 * time / HOUR * slope[..., AMBIENT] ** 2
    return values[..., CORE], options.sigmas * np.sqrt(variance)


def allowed_tensions(
    filters: ThermalFilter, bias: float, most: float, options: HeatOptions, horizon: float
) -> Floats:
    """Largest tension that each motor may hold for a time (m,) [N], between bias and limit.

    Args:
        filters: of m motors.
        bias: tension that no motor goes below [N].
        most: largest tension of a motor [N].
        options: limit of the core temperature, and width of its interval.
        horizon: [s].
    """
    heat = np.linspace(bias**0.5, most**0.5, GRID) ** 4
    count, soon = len(filters.x), SOON * options.nominal.core_time
    tried = np.broadcast_to(heat[:, None], (GRID, count))
    upper = np.maximum(
        sum(core_after(filters, tried, horizon, options)),
        sum(core_after(filters, tried, min(horizon, soon), options)),
    )
    allowed = np.empty(count)
    for motor in range(count):
        rising = np.maximum.accumulate(upper[:, motor])
        allowed[motor] = np.interp(options.limit, rising, heat, left=heat[0], right=heat[-1])
    return np.sqrt(allowed)

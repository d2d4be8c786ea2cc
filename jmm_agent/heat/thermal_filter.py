"""Extended Kalman filter of the temperatures and parameters of many motors at once.

The state of a motor (8,) holds the temperatures of core, housing and surroundings and the
logarithms of its five parameters, which stay positive (`model`). Each motor has a filter of its
own; arrays have leading axes of filters, such as (m,) motors or (k, m) copies of them.

    x- = f(x, heat),  P- = F P F' + Q,  y = T2 + v,  v ~ N(0, r)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jmm_agent.heat.model import AMBIENT, CORE, FIRST, HOUSING, SIZE, advanced_with_slopes
from jmm_agent.heat.parameters import HeatOptions
from jmm_agent.types import Floats

HOUR = 3600.0
"""[s]"""
HOUSING_WALK = 0.1
"""By how much a housing departs from the model in the square root of a housing time constant, as a
share of the ambient's drift in that time [1]."""


class Correction(NamedTuple):
    """Result of a correction by readings.

    Attributes:
        innovation: reading minus expectation (...) [K]; NaN without a reading.
        variance: of the innovation (...) [K^2].
        gain: K (..., 8); zero without a reading.
    """

    innovation: Floats
    variance: Floats
    gain: Floats


class ThermalFilter:
    """Filters of motors.

    Args:
        shape: leading axes.
        options: prior, drifts and growth.

    Attributes:
        x: states (..., 8).
        p: covariances (..., 8, 8).
    """

    def __init__(self, shape: tuple[int, ...], options: HeatOptions) -> None:
        self._options = options
        self.x = np.zeros((*shape, SIZE))
        self.p = np.zeros((*shape, SIZE, SIZE))
        self.x[..., :FIRST] = options.ambient
        self.x[..., FIRST:] = np.log(options.nominal.array)
        diagonal = np.full(SIZE, options.spread**2)
        diagonal[:FIRST] = options.ambient_std**2
        self.p[...] = np.diag(diagonal)

    def begin(self, core: Floats, core_std: Floats, housing: Floats, housing_std: Floats) -> None:
        """Begin with other temperatures, and keep the parameters.

        Args:
            core: expected excess of the core over the housing (...) [K].
            core_std: its standard deviation (...) [K].
            housing: temperature of the housing (...) [degC].
            housing_std: its standard deviation (...) [K].
        """
        p, options = self.p, self._options
        p[..., :FIRST, :] = 0.0
        p[..., :, :FIRST] = 0.0
        self.x[..., HOUSING], self.x[..., CORE] = housing, housing + core
        p[..., HOUSING, HOUSING] = p[..., CORE, HOUSING] = housing_std**2
        p[..., HOUSING, CORE] = housing_std**2
        p[..., CORE, CORE] = housing_std**2 + core_std**2
        p[..., AMBIENT, AMBIENT] = options.ambient_std**2

    def predict(self, heat: Floats, time: float, walk: float = 1.0) -> Floats:
        """Predict over a time; F (..., 8, 8).

        Args:
            heat: mean square of the tensions meanwhile (...) [N^2].
            time: [s].
            walk: 1 if parameters may drift, 0 if they stay the same.
        """
        values, slopes = advanced_with_slopes(self.x, heat, time, self._options.growth)
        full = np.zeros_like(self.p)
        full[...] = np.eye(SIZE)
        full[..., :AMBIENT, :] = slopes
        self.x[..., :AMBIENT] = values
        self.p = full @ self.p @ np.swapaxes(full, -1, -2)
        self._add_noise(heat, time, walk)
        return full

    def correct(self, reading: Floats, noise: Floats) -> Correction:
        """Correct by readings of the housings.

        Args:
            reading: (...) [degC]; NaN for none.
            noise: variance of the readings (...) [K^2].
        """
        column = self.p[..., HOUSING]
        variance = column[..., HOUSING] + noise
        innovation = reading - self.x[..., HOUSING]
        known = np.isfinite(innovation)
        gain = np.where(known[..., None], column / variance[..., None], 0.0)
        self.x = self.x + gain * np.where(known, innovation, 0.0)[..., None]
        p = self.p - gain[..., :, None] * column[..., None, :]
        self.p = 0.5 * (p + np.swapaxes(p, -1, -2))
        return Correction(innovation, variance, gain)

    def _add_noise(self, heat: Floats, time: float, walk: float) -> None:
        """Add what the model does not explain during a time [s]."""
        options, nominal = self._options, self._options.nominal
        warming = np.exp(self.x[..., FIRST] - self.x[..., FIRST + 1]) * heat
        p = self.p
        p[..., CORE, CORE] += (options.heat_noise * warming) ** 2 * time * nominal.core_time
        share = options.ambient_drift**2 * time / HOUR
        p[..., AMBIENT, AMBIENT] += share
        p[..., HOUSING, HOUSING] += HOUSING_WALK**2 * share
        diagonal = np.arange(FIRST, SIZE)
        p[..., diagonal, diagonal] += walk * options.drift**2 * time / HOUR

"""Readings of the housings: their unit at the start, their resolution and noise, and broken ones.

A sensor with a coarse resolution repeats its reading while the housing warms slowly. A repeated
reading is no news: the variance of a reading grows with the number of times that it was repeated,
so that a plateau does not count as many independent readings.
"""

from __future__ import annotations

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.types import Bools, Floats

COLDEST, HOTTEST = -40.0, 150.0
"""Temperatures that the housing of a motor may have [degC]."""
KELVIN = 200.0
"""Readings above are in kelvin, if they are below 200 degC then."""
FAHRENHEIT = 59.0
"""Where even the coldest of several housings reads as much at the start, it reads Fahrenheit."""
SEVERAL = 4
"""Number of readings from which on the coldest of them is near the surroundings."""
WEIGHT = 0.02
"""Weight of a new innovation in the estimated noise [1]."""
FARTHEST = 6.0
"""Innovation from which on a reading is not used, in standard deviations [1]."""
RUN = 5
"""Number of such readings in a row from which on the sensor counts as broken."""


def check_unit(readings: Floats) -> None:
    """Refuse the first readings of the housings if they are not in degrees Celsius.

    Args:
        readings: temperatures (m,) [degC]; NaN for a motor without sensor.

    Raises:
        AgentError: they are in kelvin or Fahrenheit, or no temperatures.
    """
    known = readings[np.isfinite(readings)]
    if not known.size:
        return
    middle, coldest = float(np.median(known)), float(known.min())
    if KELVIN < middle < KELVIN + 300.0:
        unit = "kelvin"
    elif known.size >= SEVERAL and coldest >= FAHRENHEIT and middle < HOTTEST:
        unit = "degrees Fahrenheit"
    elif not COLDEST < middle < HOTTEST:
        unit = "no temperatures of motors"
    else:
        return
    raise AgentError(
        f"Agent: the housings read {coldest:.4g} to {known.max():.4g} at the start: these are "
        f"{unit}. SensorReadings.temperatures must be in degrees Celsius, between {COLDEST:g} and "
        f"{HOTTEST:g}."
    )


class HousingReadings:
    """Means of the readings of m motors between two steps of the filter, and their noise.

    Args:
        count: number of motors, m.
        noise: standard deviation of a reading at the start [K].

    Attributes:
        broken: sensors whose readings are far from what the model expects (m,).
    """

    def __init__(self, count: int, noise: float) -> None:
        self._noise = np.full(count, noise**2)
        self._resolution = np.full(count, np.inf)
        self.broken: Bools = np.zeros(count, dtype=bool)
        self.reset()

    def reset(self) -> None:
        """Forget the last readings, and keep noise and resolution."""
        count = len(self._noise)
        self._sum, self._number = np.zeros(count), np.zeros(count)
        self._last = np.full(count, np.nan)
        self._mean = np.full(count, np.nan)
        self._repeated, self._far = np.zeros(count), np.zeros(count, dtype=int)
        self.broken = np.zeros(count, dtype=bool)

    def add(self, readings: Floats) -> None:
        """Add the readings of a control step (m,) [degC]."""
        known = np.isfinite(readings) & (readings > COLDEST) & (readings < HOTTEST)
        self._sum += np.where(known, readings, 0.0)
        self._number += known
        change = np.abs(readings - self._last)
        news = known & (change > 1e-9)
        self._resolution[news] = np.minimum(self._resolution, change)[news]
        self._last = np.where(known, readings, self._last)

    def take(self) -> tuple[Floats, Floats]:
        """Means of the readings since the last call (m,) [degC], and their variances (m,) [K^2].

        A mean is NaN where no reading came.
        """
        known = self._number > 0
        mean = np.where(known, self._sum / np.maximum(self._number, 1.0), np.nan)
        self._repeated = np.where(mean == self._mean, self._repeated + 1.0, 0.0)
        self._mean = np.where(known, mean, self._mean)
        self._sum, self._number = np.zeros_like(self._sum), np.zeros_like(self._number)
        step = np.where(np.isfinite(self._resolution), self._resolution, 0.0)
        return mean, self._noise + step**2 / 12.0 + self._noise * self._repeated

    def usable(self, mean: Floats, innovation: Floats, variance: Floats) -> Floats:
        """Means (m,) [degC] without those that are far from what the filter expects.

        Args:
            mean: as returned by `take`.
            innovation: mean minus expectation (m,) [K].
            variance: of the expectation (m,) [K^2].
        """
        step = np.where(np.isfinite(self._resolution), self._resolution, 0.0)
        known = np.isfinite(innovation)
        size = np.nan_to_num(np.abs(innovation))
        far = known & (size > FARTHEST * np.sqrt(variance + self._noise + step**2))
        self._far = np.where(known, np.where(far, self._far + 1, 0), self._far)
        self.broken = self._far >= RUN
        return np.where(far, np.nan, mean)

    def learn(self, innovation: Floats, expected: Floats) -> None:
        """Learn the noise from innovations that were used.

        Args:
            innovation: (m,) [K]; NaN where no reading was used.
            expected: variance of the expectation (m,) [K^2].
        """
        known = np.isfinite(innovation)
        size = np.where(known, innovation, 0.0) ** 2
        found = np.maximum(size - expected, 0.1 * size)
        most = 9.0 * self._noise  # one far reading does not make a noisy sensor
        step = WEIGHT * (np.minimum(found, most) - self._noise)
        self._noise = np.where(known, np.maximum(self._noise + step, 1e-6), self._noise)

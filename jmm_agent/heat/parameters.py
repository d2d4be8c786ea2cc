"""Parameters of the thermal model of a motor, and the options of its estimation."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats

NAMES = (
    "heat_per_tension",
    "core_capacity",
    "housing_capacity",
    "core_to_housing",
    "housing_to_ambient",
)
"""Names of the parameters, in the order of arrays (..., 5)."""
UNITS = ("W/N^2", "J/K", "J/K", "K/W", "K/W")
"""Unit of each parameter."""


@dataclass(frozen=True)
class ThermalParameters:
    """Two thermal capacities, two thermal resistances, and the heat of a motor.

    The resistances and time constants are those of a data sheet of a motor of 150 W: 1.93
    and 4.65 K/W; winding 41.5 s, motor 809 s. The heat is chosen so that a motor can hold about
    130 N forever, with 75 degC in its core.

    Attributes:
        heat_per_tension: Joule loss per square of the tension, at 25 degC [W/N^2].
        core_capacity: heat capacity of the core, that is of the winding [J/K].
        housing_capacity: heat capacity of the housing [J/K].
        core_to_housing: thermal resistance between core and housing [K/W].
        housing_to_ambient: thermal resistance between housing and surroundings [K/W].

    Raises:
        AgentError: a number is not positive and finite.
    """

    heat_per_tension: float = 4e-4
    core_capacity: float = 21.5
    housing_capacity: float = 174.0
    core_to_housing: float = 1.93
    housing_to_ambient: float = 4.65

    def __post_init__(self) -> None:
        for entry in fields(self):
            if not 0.0 < getattr(self, entry.name) < np.inf:
                raise AgentError(
                    f"ThermalParameters: {entry.name} is {getattr(self, entry.name)}, but must be "
                    "positive and finite."
                )

    @property
    def array(self) -> Floats:
        """The numbers in the order of `NAMES` (5,)."""
        return np.array([getattr(self, name) for name in NAMES])

    @property
    def core_time(self) -> float:
        """Time constant of the core against the housing [s]."""
        return self.core_to_housing * self.core_capacity

    @property
    def housing_time(self) -> float:
        """Time constant of the housing against its surroundings [s]."""
        return self.housing_to_ambient * self.housing_capacity


@dataclass(frozen=True)
class HeatOptions:
    """Options of a `HeatMonitor`. Times that are not given derive from the nominal parameters.

    Attributes:
        nominal: parameters of the motors by their data sheet.
        limit: temperature that no core may exceed [degC].
        ambient: temperature of the surroundings at the start [degC] ...
        ambient_std: ... and its standard deviation [K].
        growth: growth of the winding's resistance per kelvin, relative to 25 degC: 0.0039 for
            copper, 0 for a resistance that stays the same [1/K].
        spread: standard deviation of the logarithm of each parameter about the nominal one [1].
        drift: by how much a parameter may drift, relative, in the square root of an hour [1].
        ambient_drift: by how much the surroundings may drift in the square root of an hour [K].
        heat_noise: relative error of the heat, which lasts for a core time constant [1].
        noise: standard deviation of a reading of the housing at the start [K]; it is estimated.
        sigmas: standard deviations between the estimate and the ends of its interval [1]. The
            upper end is what is kept below the limit.
        horizon: time for which a tension must be possible [s]; None: half a core time constant.
        changed: relative change of a parameter that is a fault [1]. The default is below 0.2, so
            that a change of 20 % is found in spite of errors of the estimate.
        evidence: log-likelihood ratio, times two, from which on a change counts as found [1].

    Raises:
        AgentError: a number is out of its range.
    """

    nominal: ThermalParameters = field(default_factory=ThermalParameters)
    limit: float = 80.0
    ambient: float = 25.0
    ambient_std: float = 3.0
    growth: float = 0.0039
    spread: float = 0.25
    drift: float = 0.02
    ambient_drift: float = 1.0
    heat_noise: float = 0.05
    noise: float = 0.3
    sigmas: float = 3.0
    horizon: float | None = None
    changed: float = 0.15
    evidence: float = 30.0

    def __post_init__(self) -> None:
        for name in ("ambient_std", "spread", "noise", "sigmas", "changed", "evidence"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise AgentError(
                    f"HeatOptions: {name} is {getattr(self, name)}, but must be positive and "
                    "finite."
                )
        for name in ("growth", "drift", "ambient_drift", "heat_noise"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise AgentError(
                    f"HeatOptions: {name} is {getattr(self, name)}, but must be finite and not "
                    "negative."
                )
        if not -60.0 < self.ambient < self.limit < 400.0:
            raise AgentError(
                f"HeatOptions: limit {self.limit} degC and ambient {self.ambient} degC; the limit "
                "must be above the ambient temperature and below 400 degC."
            )
        if self.horizon is not None and not 0.0 < self.horizon < np.inf:
            raise AgentError(
                f"HeatOptions: horizon is {self.horizon} s, but must be positive and finite."
            )

    @property
    def planned(self) -> float:
        """Time for which a tension must be possible [s]."""
        return 0.5 * self.nominal.core_time if self.horizon is None else self.horizon

"""Departure of the motors from ideal ones: they heat by their tension."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kengoro_env.robot.draft import Draft
from kengoro_env.robot.motor_heat import HeatSpec

CLIPPED = 2.0
"""Largest departure of a parameter from its mean, in standard deviations [1]."""


@dataclass(frozen=True)
class HeatingMotors:
    """Motors that heat by their tension, with a temperature sensor on each housing.

    The observation then has ``temperatures`` (m,) [degC], and ``info`` has ``core_temperatures``
    and ``housing_temperatures`` (m,) [degC]. `MotorHeat` has the equations. Resistances and time
    constants are those of a data sheet of a motor of 150 W: 1.93 and 4.65 K/W; winding
    41.5 s, motor 809 s. With a heat of 4e-4 W/N^2 a motor holds about 130 N forever, with 75 degC
    in its core.

    Attributes:
        heat: Joule loss per square of the tension, at 25 degC [W/N^2]; 0: motors stay cold, and
            there are no sensors.
        spread: standard deviation of the logarithm of each parameter of each motor [1], clipped at
            two of them.
        core_capacity: heat capacity of a core [J/K].
        housing_capacity: heat capacity of a housing [J/K].
        core_to_housing: thermal resistance [K/W].
        housing_to_ambient: thermal resistance [K/W].
        growth: growth of a winding's resistance, that of copper [1/K].
        ambient: ambient temperature [degC].
        ambient_spread: its standard deviation over robots [K].
        ambient_swing: amplitude of its drift in two hours [K].
        noise: standard deviation of a reading [K].
        quantum: smallest step of a reading [K].
        period: time between two readings [s].
        seed: seed of the motors and of the ambient temperature.
    """

    heat: float = 0.0
    spread: float = 0.2
    core_capacity: float = 21.5
    housing_capacity: float = 174.0
    core_to_housing: float = 1.93
    housing_to_ambient: float = 4.65
    growth: float = 0.0039
    ambient: float = 25.0
    ambient_spread: float = 1.5
    ambient_swing: float = 1.0
    noise: float = 0.2
    quantum: float = 0.5
    period: float = 1.0
    seed: int = 0

    def edit(self, draft: Draft) -> None:
        """Sample the motors and write them into the draft."""
        if self.heat == 0.0:
            return
        rng = np.random.default_rng([self.seed, 106])
        mean = np.array(
            [
                self.heat,
                self.core_capacity,
                self.housing_capacity,
                self.core_to_housing,
                self.housing_to_ambient,
            ]
        )
        ambient = self.ambient + self.ambient_spread * float(rng.standard_normal())
        parameters = {}
        for muscle in draft.tendons:
            departure = np.clip(rng.standard_normal(len(mean)), -CLIPPED, CLIPPED)
            parameters[muscle] = tuple((mean * np.exp(self.spread * departure)).tolist())
        draft.heat = HeatSpec(
            parameters,
            self.growth,
            ambient,
            self.ambient_swing,
            self.noise,
            self.quantum,
            self.period,
        )

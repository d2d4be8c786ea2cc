"""Heat of the motors: temperatures of cores and housings, and the sensors of the housings.

A motor is a core (its winding) and a housing. The tension f heats the core, whose resistance grows
with its temperature; the core heats the housing, and the housing its surroundings, which drift:

    C1 T1' = h f^2 (1 + g (T1 - 25)) - (T1 - T2) / R1
    C2 T2' = (T1 - T2) / R1 - (T2 - Ta) / R2,   Ta = mean + swing sin(2 pi t / period)

Each step holds f and Ta constant, and is the exponential of the matrix of these linear equations
with a constant, by its Taylor series and repeated squaring, for any duration.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sin

import numpy as np

from kengoro_env.errors import ArgumentError, UnknownNameError
from kengoro_env.types import Floats

PARAMETERS = (
    "heat_per_tension",
    "core_capacity",
    "housing_capacity",
    "core_to_housing",
    "housing_to_ambient",
)
"""Names of the parameters of a motor: h [W/N^2], C1 and C2 [J/K], R1 and R2 [K/W]."""
REFERENCE = 25.0
"""Temperature at which the winding has its nominal resistance [degC]."""
TERMS = 8
"""Terms of the Taylor series."""
SMALL = 0.1
"""Norm of a matrix below which these terms suffice to rounding."""
PERIOD = 7200.0
"""Period of the drift of the ambient temperature [s]."""


@dataclass(frozen=True)
class HeatSpec:
    """Motors that heat, before a robot is compiled.

    Attributes:
        parameters: of each muscle's motor, in the order of `PARAMETERS`.
        growth: growth of the winding's resistance [1/K].
        ambient: mean ambient temperature [degC].
        ambient_swing: amplitude of its drift [K].
        noise: standard deviation of a reading of the housing [K].
        quantum: smallest step of a reading [K]; 0: not quantised.
        period: time between two readings [s]; the last one is repeated meanwhile.
    """

    parameters: dict[str, tuple[float, ...]]
    growth: float
    ambient: float
    ambient_swing: float
    noise: float
    quantum: float
    period: float


class MotorHeat:
    """Motors of m muscles that heat.

    Args:
        spec: of the motors.

    Attributes:
        muscles: names of the muscles, in the order of (m,) arrays.
        parameters: of the motors (m, 5), in the order of `PARAMETERS`.
        core: temperatures of the cores (m,) [degC].
        housing: temperatures of the housings (m,) [degC].
        time: since the reset [s].
    """

    def __init__(self, spec: HeatSpec) -> None:
        self._spec, self.muscles = spec, tuple(spec.parameters)
        self._nominal = np.array(list(spec.parameters.values()))
        self.reset(np.random.default_rng(0))

    def reset(self, rng: np.random.Generator) -> None:
        """Let all motors be as warm as their surroundings.

        Args:
            rng: generator of the sensors' noise.
        """
        self._random, self.time = rng, 0.0
        self.parameters = self._nominal.copy()
        self.core = np.full(len(self.muscles), self.ambient)
        self.housing = self.core.copy()
        self._read()

    @property
    def ambient(self) -> float:
        """Ambient temperature now [degC]."""
        spec = self._spec
        return spec.ambient + spec.ambient_swing * sin(2.0 * pi * self.time / PERIOD)

    @property
    def readings(self) -> Floats:
        """Newest readings of the sensors of the housings (m,) [degC]."""
        return self._readings.copy()

    def change(self, muscle: str, parameter: str, factor: float) -> None:
        """Change a parameter of a motor until the next reset, as when its fan fails.

        Args:
            muscle: name of the muscle.
            parameter: one of `PARAMETERS`.
            factor: new value over the present one [1].

        Raises:
            UnknownNameError: there is no such muscle or parameter.
            ArgumentError: the factor is not positive and finite.
        """
        if muscle not in self.muscles:
            raise UnknownNameError("muscle", muscle, self.muscles)
        if parameter not in PARAMETERS:
            raise UnknownNameError("parameter", parameter, PARAMETERS)
        if not 0.0 < factor < np.inf:
            raise ArgumentError(f"a factor must be positive and finite, got {factor}")
        self.parameters[self.muscles.index(muscle), PARAMETERS.index(parameter)] *= factor

    def advance(self, tensions: Floats, duration: float) -> None:
        """Let time pass.

        Args:
            tensions: meanwhile (m,) [N].
            duration: [s].
        """
        heat, c1, c2, r1, r2 = self.parameters.T
        warming = heat * np.square(tensions) / c1
        matrix = np.zeros((len(self.muscles), 3, 3))
        growth = self._spec.growth
        matrix[:, 0, 0] = growth * warming - 1.0 / (r1 * c1)
        matrix[:, 0, 1] = 1.0 / (r1 * c1)
        matrix[:, 0, 2] = warming * (1.0 + growth * (self.ambient - REFERENCE))
        matrix[:, 1, 0] = 1.0 / (r1 * c2)
        matrix[:, 1, 1] = -1.0 / (r1 * c2) - 1.0 / (r2 * c2)
        flow = exponential(matrix * duration)
        ambient = self.ambient
        state = np.stack([self.core - ambient, self.housing - ambient, np.ones_like(self.core)])
        self.core, self.housing = np.einsum("mij,jm->im", flow, state)[:2] + ambient
        before, self.time = self.time, self.time + duration
        period = self._spec.period
        if period == 0.0 or int(before / period + 1e-9) != int(self.time / period + 1e-9):
            self._read()

    def _read(self) -> None:
        spec, reading = self._spec, self.housing.copy()
        if spec.noise > 0.0:
            reading += spec.noise * self._random.standard_normal(len(reading))
        if spec.quantum > 0.0:
            reading = np.rint(reading / spec.quantum) * spec.quantum
        self._readings = reading


def exponential(matrices: Floats) -> Floats:
    """Exponentials of matrices (..., n, n)."""
    norm = float(np.abs(matrices).sum(axis=-1).max(initial=0.0))
    squarings = max(0, int(np.ceil(np.log2(max(norm, SMALL) / SMALL))))
    small = matrices / 2.0**squarings
    result = term = np.broadcast_to(np.eye(matrices.shape[-1]), matrices.shape)
    for number in range(1, TERMS + 1):
        term = term @ small / number
        result = result + term
    for _ in range(squarings):
        result = result @ result
    return result

"""Check of the muscle lengths that needs no guard: their unit and their sign.

Lengths in other units are far outside what the map gives between the joint limits. Lengths of the
wrong sign may not be, but then tensions at rest contradict the muscle stiffness control
(`MotorControl`): muscles seem too long for their command and do not pull, and others pull that seem
too short. A wrong gain shows in the same way.
"""

from __future__ import annotations

import numpy as np

from jmm_agent.guard.faults import LENGTHS_WRONG, Fault, MotorControl
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats

SAMPLES = 200
"""Number of postures, uniform between the joint limits, over which lengths are taken."""
FAR = 3.0
"""Largest distance of a length from those, as a share of the largest range of a muscle [1]."""
MOST = 0.5
"""Least share of muscles with such lengths [1]; a single one has a fault of its own."""
MISMATCH = 0.15
"""Difference between measured and demanded tension, as a share of the motors' limit [1]."""
FEWEST = 2
"""Number of muscles with such tensions; a single one has a fault of its own."""
RESTS = 2
"""Number of rests in a row with such tensions, from which on they are named."""


def beyond_map(lengths: Floats, low: Floats, high: Floats) -> Floats:
    """How far lengths are from those of a map, as a share of `FAR` ranges (m,) [1]; above 1: wrong.

    Args:
        lengths: measured (m,) [m].
        low: shortest length of each muscle between the joint limits, by the map (m,) [m].
        high: longest length of each muscle (m,) [m].

    Returns:
        Minus infinity for a length that is no number.
    """
    beyond = np.maximum(low - lengths, lengths - high)
    share = beyond / (FAR * float((high - low).max()))
    return np.asarray(np.nan_to_num(share, nan=-np.inf, posinf=np.inf, neginf=-np.inf))


class LengthCheck:
    """Names lengths of the wrong unit or sign.

    Args:
        jmm: the joint-muscle mapping before learning.
        limits: lowest and highest angle of each joint (n, 2) [rad].
    """

    def __init__(self, jmm: JointMuscleMap, limits: Floats) -> None:
        low, high = limits.T
        postures = np.random.default_rng(0).uniform(low, high, (SAMPLES, len(limits)))
        lengths = jmm.lengths(postures)
        self._muscles = jmm.muscles
        self._low, self._high = lengths.min(axis=0), lengths.max(axis=0)
        self.reset()

    def reset(self) -> None:
        """Forget all, as before a new episode."""
        self._far: Fault | None = None
        self._contradicted: Fault | None = None
        self._since, self._rests = np.inf, 0

    @property
    def faults(self) -> list[Fault]:
        """Faults of the lengths that are found now."""
        return [found for found in (self._far, self._contradicted) if found is not None][:1]

    def update(
        self, readings: SensorReadings, command: Floats, motors: MotorControl | None, since: float
    ) -> None:
        """Add the readings of a control step.

        Args:
            readings: of the step; the tension is NaN of muscles that are not in use.
            command: target lengths (m,) [m] while they were measured.
            motors: gains and limit; None if unknown.
            since: time from which the lengths have been at rest [s]; infinite if they are not.
        """
        self._check_range(readings)
        if motors is None or not np.isfinite(since) or since == self._since:
            return
        self._since = since
        self._check_tensions(readings, command, motors)

    def _check_range(self, readings: SensorReadings) -> None:
        """Compare the lengths with those that the map gives between the joint limits."""
        beyond = beyond_map(readings.lengths, self._low, self._high)
        far = beyond > 1.0
        if not far.any() or far.mean() < MOST:
            self._far = None
        elif self._far is None:
            worst = int(beyond.argmax())
            detail = (
                f"{self._muscles[worst]} has a length of {readings.lengths[worst]:.3g} m, but "
                f"{self._low[worst]:.3g} to {self._high[worst]:.3g} m by the map: lengths are not "
                "in metres, or not zeroed"
            )
            self._far = Fault(LENGTHS_WRONG, "muscles", readings.time, detail)

    def _check_tensions(
        self, readings: SensorReadings, command: Floats, motors: MotorControl
    ) -> None:
        """Compare the tensions with those that the motors' control demands, once in a rest."""
        demanded = np.clip(motors.demanded(readings.lengths, command), 0.0, motors.limit)
        away = np.nan_to_num(np.abs(readings.tensions - demanded) / motors.limit, nan=0.0)
        wrong = int(np.count_nonzero(away > MISMATCH))
        self._rests = self._rests + 1 if wrong >= FEWEST else 0
        if self._rests < RESTS:
            self._contradicted = None
        elif self._contradicted is None:
            worst = int(away.argmax())
            tension = readings.tensions[worst]
            detail = (
                f"at rest {self._muscles[worst]} has a tension of {tension:.3g} N, but "
                f"{demanded[worst]:.3g} N by its length and command, and {wrong - 1} more "
                "differ: lengths have the wrong sign or unit, or the motors' gains are others"
            )
            self._contradicted = Fault(LENGTHS_WRONG, "muscles", readings.time, detail)

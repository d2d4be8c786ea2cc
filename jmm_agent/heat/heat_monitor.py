"""Heat of the motors of a robot: core temperatures, faults by name, and limits of tensions.

The monitor collects tensions and readings between the steps of its filter, an eighth of the core
time constant each. It limits the tension of each motor, named when it does, so that no core
becomes hotter than the limit by the upper end of its interval. Motors that change are left to
`ChangedMotors`.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import (
    HEAT_LIMITED,
    TEMPERATURE_MISSING,
    TEMPERATURE_WRONG,
    Fault,
    MotorControl,
)
from jmm_agent.heat.change_detector import ChangeDetector
from jmm_agent.heat.changed_motors import ChangedMotors
from jmm_agent.heat.housing_readings import HousingReadings, check_unit
from jmm_agent.heat.model import FIRST, HOUSING
from jmm_agent.heat.parameters import NAMES, HeatOptions
from jmm_agent.heat.tension_limit import allowed_tensions, core_after
from jmm_agent.heat.thermal_filter import ThermalFilter
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Bools, Floats

_log = logging.getLogger(__name__)

STEPS = 8
"""Steps of the filter in a nominal core time constant."""
MISSING = 4
"""Number of steps without a reading from which on that is named."""
CUT = 0.01
"""Least share of the motors' largest tension by which a command is cut that counts [1]."""
RELEASED = 5.0
"""Time without a cut after which a muscle no longer counts as limited by heat [s]."""


class CoreTemperatures(NamedTuple):
    """Estimated core temperatures of m motors.

    Attributes:
        mean: (m,) [degC].
        low: lower end of the interval (m,) [degC].
        high: upper end of the interval (m,) [degC].
    """

    mean: Floats
    low: Floats
    high: Floats


class HeatMonitor:
    """Thermal models of the motors of m muscles, learned from the temperatures of their housings.

    Args:
        muscles: names of the m muscles.
        motors: bias and largest tension; the limits lie between.
        options: nominal parameters, limit and thresholds.

    Attributes:
        options: as given, or the defaults.
    """

    def __init__(
        self, muscles: Sequence[str], motors: MotorControl, options: HeatOptions | None = None
    ) -> None:
        self.options = options = options or HeatOptions()
        self._muscles, self._motors = tuple(muscles), motors
        count = len(self._muscles)
        self._step = options.nominal.core_time / STEPS
        self._filter = ThermalFilter((count,), options)
        self._detector = ChangeDetector(count, options)
        self._readings = HousingReadings(count, options.noise)
        self._changed = ChangedMotors(muscles, self._filter, options)
        self._named: dict[tuple[str, int], Fault] = {}
        self._start = True
        self.reset()

    def reset(self) -> None:
        """Begin again after a pause of unknown length, and keep what was learned of the motors."""
        count = len(self._muscles)
        self._time = -np.inf
        self._passed, self._heat, self._last_heat = 0.0, np.zeros(count), np.zeros(count)
        self._without = np.zeros(count, dtype=int)
        self._cut_at = np.full(count, -np.inf)
        self._start = True
        self._readings.reset()
        self._detector.reset()
        self._changed.reset()
        self._named.clear()
        self._limits: tuple[float, Floats] | None = None

    @property
    def core(self) -> CoreTemperatures:
        """Core temperatures now, with intervals of `HeatOptions.sigmas` standard deviations."""
        heat = self._heat / max(self._passed, 1e-9)
        mean, wide = core_after(self._filter, heat, self._passed, self.options)
        return CoreTemperatures(mean, mean - wide, mean + wide)

    @property
    def housing(self) -> Floats:
        """Estimated temperatures of the housings (m,) [degC]."""
        return self._filter.x[:, HOUSING].copy()

    @property
    def parameters(self) -> Floats:
        """Estimated parameters (m, 5), in the order and units of `ThermalParameters`."""
        return np.asarray(np.exp(self._filter.x[:, FIRST:]))

    @property
    def parameters_std(self) -> Floats:
        """Standard deviations of the logarithms of the parameters (m, 5) [1]."""
        return np.sqrt(np.diagonal(self._filter.p, axis1=1, axis2=2)[:, FIRST:])

    @property
    def faults(self) -> list[Fault]:
        """Faults that are found now, in the order in which they were noticed."""
        found = [*self._changed.faults, *self._named.values()]
        return sorted(found, key=lambda fault: fault.since)

    @property
    def limited(self) -> Bools:
        """Muscles whose commands heat has cut just now (m,)."""
        return self._time - self._cut_at <= RELEASED

    def update(self, readings: SensorReadings, pause: float = 0.0) -> None:
        """Add the readings of a control step.

        Args:
            readings: of the step; the tensions finite, temperatures NaN where there is no sensor.
            pause: by how much the stamps jumped [s]; what the motors did meanwhile is not known.

        Raises:
            AgentError: temperatures of the wrong shape, or, at the start, in another unit; or
                readings that are earlier than those before. Nothing is changed then.
        """
        temperatures = self._checked(readings.temperatures)
        passed = readings.time - self._time if np.isfinite(self._time) else 0.0
        if passed < 0.0:
            raise AgentError(
                f"HeatMonitor: readings of {readings.time} s come after those of {self._time} s."
            )
        if pause > self._step or pause < 0.0:
            self._pause(abs(pause))
            passed = 0.0
        if self._start:
            self._begin(temperatures, readings)
        self._time = readings.time
        self._passed += passed
        self._heat += passed * np.square(readings.tensions)
        self._readings.add(temperatures)
        if self._passed >= self._step:
            self._run()

    def tension_limits(self, now: float | None = None, horizon: float | None = None) -> Floats:
        """Largest tension that each muscle may hold (m,) [N], between bias and the motors' limit.

        Args:
            now: time by the clock of the readings [s]; the newest readings if left out. Limits of
                a time without readings are those of the last readings.
            horizon: time for which the tension is held [s]; that of the options if left out.

        Raises:
            AgentError: the horizon is not positive and finite, or ``now`` before the readings.
        """
        planned = self.options.planned if horizon is None else float(horizon)
        if not 0.0 < planned < np.inf:
            raise AgentError(f"HeatMonitor: the horizon is {planned} s, but must be positive.")
        if now is not None and now < self._time:
            raise AgentError(f"HeatMonitor: {now} s is before the newest readings, {self._time} s.")
        if self._limits is None or self._limits[0] != planned:
            motors = self._motors
            allowed = allowed_tensions(
                self._filter, motors.bias, motors.limit, self.options, planned
            )
            self._limits = planned, self._changed.capped(allowed, self._time)
        return self._limits[1].copy()

    def limit(self, target_lengths: Floats, lengths: Floats) -> Floats:
        """Target lengths (m,) [m] that demand no tension above the limits; names what is cut.

        Args:
            target_lengths: wanted (m,) [m].
            lengths: measured (m,) [m].
        """
        limits = self.tension_limits()
        shortest = self._motors.shortest_target(lengths, limits)
        cut = (shortest - target_lengths) * self._motors.gains
        limiting = limits < self._motors.limit
        self._name_cut((cut > CUT * self._motors.limit) & limiting, limits)
        return np.maximum(target_lengths, shortest)

    def set_motors(self, motors: MotorControl) -> None:
        """Take note of motors with another stiffness.

        Args:
            motors: gains and limit.
        """
        self._motors = motors

    def not_held(self, needed: Floats) -> str:
        """Which muscles are too hot for postures, in one sentence; empty if none is.

        Args:
            needed: tensions that hold them (K, m) [N].
        """
        return self.too_hot(np.max(needed, axis=0))

    def too_hot(self, wanted: Floats | None = None) -> str:
        """Which muscles heat limits, in one sentence; empty if it limits none.

        Args:
            wanted: tensions that a posture needs (m,) [N]; those that were cut just now if left
                out.
        """
        limits = self.tension_limits()
        cut = self.limited if wanted is None else wanted > limits
        if not cut.any():
            return ""
        core = self.core
        parts = [self._reason(int(index), limits, core) for index in np.flatnonzero(cut)]
        return f"Too hot: {'; '.join(parts)}."

    def _reason(self, index: int, limits: Floats, core: CoreTemperatures) -> str:
        return (
            f"muscle {self._muscles[index]!r} may pull {limits[index]:.0f} N (core "
            f"{core.mean[index]:.0f} degC, at most {core.high[index]:.0f} of "
            f"{self.options.limit:g} degC)"
        )

    def _checked(self, temperatures: Floats | None) -> Floats:
        count = len(self._muscles)
        if temperatures is None:
            return np.full(count, np.nan)
        array = np.asarray(temperatures, dtype=float)
        if array.shape != (count,):
            raise AgentError(
                f"Agent: temperatures must be of shape {(count,)}, NaN for a motor without sensor, "
                f"got shape {array.shape}."
            )
        return array

    def _begin(self, temperatures: Floats, readings: SensorReadings) -> None:
        """Begin at the first readings; what the motors did before is not known."""
        check_unit(temperatures)
        options, known = self.options, np.isfinite(temperatures)
        room = options.limit - options.ambient
        p = np.exp(self._filter.x[:, FIRST:])
        share = p[:, NAMES.index("core_to_housing")]
        share = share / (share + p[:, NAMES.index("housing_to_ambient")])
        excess = room * share
        housing = np.where(known, temperatures, options.ambient + 0.25 * room)
        std = np.where(known, 3.0 * options.noise, 0.25 * room)
        self._filter.begin(0.25 * excess, 0.5 * excess, housing, std)
        self._start, self._limits = False, None
        self._heat[:] = 0.0
        self._passed = 0.0
        self._name(TEMPERATURE_MISSING, ~known, readings.time)

    def _pause(self, pause: float) -> None:
        """Take note of a pause [s] in which the motors may have done anything."""
        self._start = True
        self._detector.reset()
        self._readings.reset()
        _log.warning(
            "No readings for %.3g s: core temperatures begin again from the housings.", pause
        )

    def _run(self) -> None:
        """A step of the filter."""
        heat, time = self._heat / self._passed, self._passed
        self._heat, self._passed = np.zeros_like(heat), 0.0
        mean, noise = self._readings.take()
        self._filter.predict(heat, time)
        expected = self._filter.p[:, HOUSING, HOUSING].copy()
        innovation = mean - self._filter.x[:, HOUSING]
        used = self._readings.usable(mean, innovation, expected)
        self._filter.correct(used, noise)
        self._readings.learn(used - mean + innovation, expected)
        self._without = np.where(np.isfinite(mean), 0, self._without + 1)
        for change in self._detector.update(self._filter, heat, time, used, noise):
            self._changed.take(change, self._motors, self._time)
        self._limits = None
        self._name_sensors()
        self._changed.forget_undone(self._time)

    def _name_sensors(self) -> None:
        """Name sensors that are missing or broken."""
        for kind, found in (
            (TEMPERATURE_MISSING, self._without >= MISSING),
            (TEMPERATURE_WRONG, self._readings.broken),
        ):
            self._name(kind, found, self._time)
            for index in np.flatnonzero(~found & (self._without == 0)):
                self._named.pop((kind, int(index)), None)

    def _name(self, kind: str, found: Bools, time: float) -> None:
        """Name muscles whose housings have no temperature, or a wrong one."""
        new = [int(i) for i in np.flatnonzero(found) if (kind, int(i)) not in self._named]
        if not new:
            return
        core = self.core
        wide = core.high - core.mean
        for index in new:
            detail = (
                f"the housing of {self._muscles[index]!r} has no usable temperature: its core is "
                f"known by the model alone, within {wide[index]:.0f} K"
            )
            self._named[kind, index] = Fault(kind, self._muscles[index], time, detail)
        _log.warning(
            "The housing has no usable temperature (%s), so that the core is known by the model "
            "alone, within %.0f K: %s.",
            kind,
            wide[new].max(),
            ", ".join(self._muscles[index] for index in new),
        )

    def _name_cut(self, cut: Bools, limits: Floats) -> None:
        """Name muscles whose commands are cut, and forget those that are not any more."""
        new = [int(i) for i in np.flatnonzero(cut) if (HEAT_LIMITED, int(i)) not in self._named]
        if new:
            core = self.core
            for index in new:
                detail = self._reason(index, limits, core)
                fault = Fault(HEAT_LIMITED, self._muscles[index], self._time, detail)
                self._named[HEAT_LIMITED, index] = fault
                _log.warning("Limited by heat: %s.", detail)
        self._cut_at[cut] = self._time
        for kind, known in list(self._named):
            if kind == HEAT_LIMITED and not self.limited[known]:
                del self._named[kind, known]

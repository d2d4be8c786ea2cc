"""Motors whose thermal parameters have changed: what is doubted then, and how much they may pull.

The parameters that may have changed are in doubt, and learned again. Until then the motor pulls no
more than it could forever before. A change that is decided is named, until it is undone.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np

from jmm_agent.guard.faults import HEAT_CHANGED, Fault, MotorControl
from jmm_agent.heat.change_detector import Change
from jmm_agent.heat.model import AMBIENT, CORE, FIRST, HOUSING
from jmm_agent.heat.parameters import NAMES, UNITS, HeatOptions
from jmm_agent.heat.tension_limit import allowed_tensions
from jmm_agent.heat.thermal_filter import ThermalFilter
from jmm_agent.types import Floats

_log = logging.getLogger(__name__)

AGAIN = 0.5
"""A changed parameter is as before again within this share of the change that is a fault [1]."""
CAPPED = 2.0
"""Time for which a motor that changed may pull no more than it could forever before, while it is
learned again, in housing time constants [1]."""
DOUBT = 0.3
"""Standard deviation of the excess of a core over its housing after a change, as a share [1]."""
LONG = 5.0
"""Horizon that counts as forever, in housing time constants [1]."""


class ChangedMotors:
    """What is known of changes of m motors.

    Args:
        muscles: names of the m muscles.
        filters: of the motors; parameters that changed are doubted in them.
        options: nominal parameters, limit and thresholds.
    """

    def __init__(
        self, muscles: Sequence[str], filters: ThermalFilter, options: HeatOptions
    ) -> None:
        self._muscles, self._filter, self._options = tuple(muscles), filters, options
        self._changed: dict[int, tuple[Change, Fault]] = {}
        self.reset()

    def reset(self) -> None:
        """Let all motors pull again, and keep what was named."""
        count = len(self._muscles)
        self._cap, self._cap_until = np.full(count, np.inf), np.full(count, -np.inf)

    @property
    def faults(self) -> list[Fault]:
        """A fault for each motor that has changed."""
        return [fault for _, fault in self._changed.values()]

    def capped(self, allowed: Floats, time: float) -> Floats:
        """Tensions (m,) [N] of which those of motors that are learned again are limited.

        Args:
            allowed: by the core temperatures (m,) [N].
            time: now [s].
        """
        return np.minimum(allowed, np.where(time < self._cap_until, self._cap, np.inf))

    def take(self, change: Change, motors: MotorControl, time: float) -> None:
        """Doubt the parameters that may have changed, and name a change that is decided.

        Args:
            change: of a motor.
            motors: bias and largest tension.
            time: now [s].
        """
        motor = change.motor
        self._keep_cap(motor, motors, time)
        if change.new:
            self._doubt(change)
        if not change.decided:
            return
        since, known = time, self._changed.get(motor)
        if known is not None:
            change, since = change._replace(before=known[0].before), known[1].since
        first = change.parameter
        before = float(change.before[first])
        others = "".join(f", or {NAMES[other]}" for other in change.others)
        others += ", or the surroundings" if change.surroundings else ""
        detail = (
            f"{NAMES[first]}{others} of {self._muscles[motor]!r} changed by "
            f"{100 * (change.factor - 1):+.0f} %: {before:.3g} -> {before * change.factor:.3g} "
            f"{UNITS[first]}"
        )
        self._changed[motor] = change, Fault(HEAT_CHANGED, self._muscles[motor], since, detail)
        _log.warning("%s", detail)

    def forget_undone(self, time: float) -> None:
        """Forget changes whose parameters were learned again, and are as before.

        Args:
            time: now [s].
        """
        for motor, (change, fault) in list(self._changed.items()):
            if time - fault.since < self._options.nominal.housing_time:
                continue
            which = [change.parameter, *change.others]
            moved = np.abs(self._filter.x[motor, FIRST:] - np.log(change.before))[which]
            if moved.max() < AGAIN * self._options.changed:
                del self._changed[motor]

    def _doubt(self, change: Change) -> None:
        """Forget what a motor's filter learned since a change, and doubt what may have changed."""
        x, p = self._filter.x[change.motor], self._filter.p[change.motor]
        excess = x[CORE] - x[HOUSING]
        p[:FIRST, FIRST:] = p[FIRST:, :FIRST] = 0.0
        p[CORE, CORE] += (DOUBT * excess) ** 2
        p[AMBIENT, AMBIENT] = self._options.ambient_std**2
        x[FIRST:], p[FIRST:, FIRST:] = np.log(change.before), change.covariance
        for parameter in (change.parameter, *change.others):
            p[FIRST + parameter, FIRST + parameter] += np.log(change.factor) ** 2

    def _keep_cap(self, motor: int, motors: MotorControl, time: float) -> None:
        """Let a motor pull no more than it could forever, until it is learned again."""
        lasting, options = self._options.nominal.housing_time, self._options
        if time >= self._cap_until[motor]:
            forever = LONG * lasting
            limits = allowed_tensions(self._filter, motors.bias, motors.limit, options, forever)
            self._cap[motor] = limits[motor]
        self._cap_until[motor] = time + CAPPED * lasting

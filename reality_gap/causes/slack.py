"""Slack: a tendon sags at low tension, so that the paid-out length exceeds that of its path.

At the tension ``T``, the paid-out length is that of the path plus the sag ``slack exp(-T /
tension)``. With a servo of stiffness ``K``, the tension itself depends on the sag ``d``: ``T = T0 +
K d`` where ``T0`` is the tension that a straight tendon would have. The solution ``d(T0)`` is
unique and is interpolated in a table.
"""

from __future__ import annotations

from bisect import bisect_right

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, SearchHints, Values
from reality_gap.causes.support import actuators, elements, encoders, typical_scales
from reality_gap.study.system import ActuatedTendon, System
from reality_gap.types import Floats

REACH, POINTS = 12.0, 600
"""Range of the table in multiples of ``tension``, and its number of points. Beyond the range, the
sag is below 0.001 % of the slack."""


def _locations(system: System) -> tuple[Location, ...]:
    tendons = {w.name for w in system.tendons if w.servo or w.length_sensors}
    found = elements.each_tendon(system) + elements.all_tendons(system)
    return tuple(location for location in found if tendons.issuperset(location.elements))


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    travel = typical_scales.tendon_travel(system)
    force = typical_scales.tendon_force(system, location)
    usual = 0.6 * force
    hints = SearchHints(secants=elements.secants(system, location, (0.07 * travel,)))
    return (
        Parameter("slack", "m", 0.0133 * travel, 0.00013 * travel, 0.0, 0.7 * travel, hints=hints),
        Parameter(
            "tension",
            "N",
            0.2 * force,
            0.0,
            0.05 * force,
            3.0 * force,
            null=usual,
            hints=SearchHints((usual,)),
        ),
    )


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    slack, scale = values["slack"], values["tension"]
    if not slack:
        return
    chosen = encoders.encoders(system, location)
    tendons = [system.tendon(name) for name in location.elements]
    fed = [tendon for tendon in tendons if tendon.servo]

    def read(record: Record) -> None:
        for encoder, tendon in zip(chosen, tendons, strict=True):
            tension = np.maximum(actuators.pull(record, tendon), 0.0)
            encoders.add_to_reading(record, encoder, slack * np.exp(-tension / scale))

    if fed:
        effects.add_hook(lambda model: _SagHook(model, fed, slack, scale))
    effects.readings.append(read)
    effects.of_forces.append(read)


class _SagHook:
    """Hook that lets servos feed back the paid-out length.

    It computes with floats, which is faster than with short arrays.
    """

    def __init__(
        self, model: mujoco.MjModel, fed: list[ActuatedTendon], slack: float, scale: float
    ) -> None:
        self._tendons = [_SaggingTendon(model, tendon, slack, scale) for tendon in fed]
        self._fresh = False

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Write the biases that follow from the sags at the end of the coming step."""
        if not self._fresh:
            mujoco.mj_fwdPosition(model, data)
            self._fresh = True
        bias, step = model.actuator_biasprm, model.opt.timestep
        lengths, velocities = data.ten_length, data.ten_velocity
        for tendon in self._tendons:
            drive = tendon.drive(model, data)
            plain = bias[tendon.actuator, 0] - tendon.added
            length = lengths[tendon.id] + step * velocities[tendon.id]
            tendon.added = tendon.slope * tendon.sag(
                -tendon.gear * (tendon.gain * drive + plain + tendon.slope * length)
            )
            bias[tendon.actuator, 0] = plain + tendon.added


class _SaggingTendon:
    """Coefficients of a tendon's actuator, and the table of its sag."""

    def __init__(
        self, model: mujoco.MjModel, tendon: ActuatedTendon, slack: float, scale: float
    ) -> None:
        self.id = int(model.tendon(tendon.name).id)
        self.actuator = i = int(model.actuator(tendon.actuator).id)
        self.drive = actuators.Drive(model, i)
        self.gain, self.gear = float(model.actuator_gainprm[i, 0]), float(model.actuator_gear[i, 0])
        self.slope = float(model.actuator_biasprm[i, 1]) * self.gear
        self.added = 0.0
        straight, sag = _table(model, i, slack, scale)
        self._straight, self._sag = straight.tolist(), sag.tolist()

    def sag(self, straight: float) -> float:
        """Return the sag [m] at the tension that a straight tendon would have [N]."""
        table, sag = self._straight, self._sag
        k = bisect_right(table, straight)
        if k == 0 or k == len(table):
            return sag[min(k, len(table) - 1)]
        share = (straight - table[k - 1]) / (table[k] - table[k - 1])
        return sag[k - 1] + share * (sag[k] - sag[k - 1])


def _table(
    model: mujoco.MjModel, actuator: int, slack: float, scale: float
) -> tuple[Floats, Floats]:
    """Return the tension of a straight tendon, shape (k,) [N], and the sag, shape (k,) [m].

    Both are computed from a grid of the actual tension.
    """
    gear = model.actuator_gear[actuator, 0]
    stiffness = -model.actuator_biasprm[actuator, 1] * gear**2
    low, high = _tension_range(model, actuator)
    tension = np.linspace(low, min(high, low + REACH * scale), POINTS)
    sag = slack * np.exp(-tension / scale)
    return tension - stiffness * sag, sag


def _tension_range(model: mujoco.MjModel, actuator: int) -> tuple[float, float]:
    """Return the smallest and largest tension that an actuator exerts [N]; at least 0."""
    if not model.actuator_forcelimited[actuator]:
        return 0.0, np.inf
    ends = -model.actuator_gear[actuator, 0] * model.actuator_forcerange[actuator]
    return max(float(ends.min()), 0.0), max(float(ends.max()), 0.0)


CAUSE = Cause(
    id="slack",
    title="slack tendon",
    explanation="A tendon sags at low tension, so that more is paid out than its path is long.",
    locations=_locations,
    parameters=_parameters,
    attach=_attach,
)

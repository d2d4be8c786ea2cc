"""A wire that hangs where its tension is low: more of it is paid out than its path is long.

Paid out is ``path + slack exp(-T / tension)``, and all of the slack where the wire does not pull.
With a servo the tension depends on what is paid out; the one solution is tabled over the tension
that a straight wire would have.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from reality_gap.cause import Cause, Effects, Parameter, Place, Record, Values
from reality_gap.causes import actuators, encoders, places
from reality_gap.causes.encoders import Feedback
from reality_gap.system import System, Wire

Array = NDArray[np.float64]

REACH, POINTS = 12.0, 600
"""Of the table: beyond 12 times the tension parameter less than 0.001 % of the slack hangs."""


def _places(system: System) -> tuple[Place, ...]:
    wires = {w.tendon for w in system.wires if w.servo or w.length_sensors}
    found = places.each_wire(system) + places.all_wires(system)
    return tuple(place for place in found if wires.issuperset(place.elements))


def _parameters(system: System, place: Place) -> tuple[Parameter, ...]:
    return (
        Parameter("slack", "m", 0.001, 1e-5, 0.0, 0.05),
        Parameter("tension", "N", 20.0, 0.0, 5.0, 300.0, null=60.0, starts=(60.0,)),
    )


def _attach(effects: Effects, system: System, place: Place, values: Values) -> None:
    slack, scale = values["slack"], values["tension"]
    if not slack:
        return
    chosen = encoders.encoders(system, place)
    wires = [system.wire(name) for name in place.elements]
    fed = [wire for wire in wires if wire.servo]

    def sense(record: Record) -> None:
        for encoder, wire in zip(chosen, wires, strict=True):
            tension = np.maximum(actuators.pull(record, wire), 0.0)
            encoders.add_to_reading(record, encoder, slack * np.exp(-tension / scale))

    if fed:
        effects.act(lambda model: _Sag(model, system, fed, slack, scale))
    effects.senses.append(sense)


class _Sag:
    """Lets the servos of wires see what is paid out."""

    def __init__(
        self, model: mujoco.MjModel, system: System, fed: list[Wire], slack: float, scale: float
    ) -> None:
        place = Place("tendon", tuple(wire.tendon for wire in fed))
        here = np.array([model.actuator(wire.actuator).id for wire in fed])
        self._feedback = Feedback(model, encoders.encoders(system, place))
        self._drive = actuators.driver(model, here)
        self._here, self._bias = here, model.actuator_biasprm[:, 0]
        self._gain, self._gear = model.actuator_gainprm[here, 0], model.actuator_gear[here, 0]
        self._tables = [_table(model, int(i), slack, scale) for i in here]
        self._sag = np.zeros(len(fed))

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Look up the sag that goes with the step to come."""
        position = self._feedback.position(model, data) - self._sag
        force = self._gain * self._drive(data) + self._bias[self._here]
        straight = -self._gear * (force + self._feedback.slope * position)
        pairs = zip(straight, self._tables, strict=True)
        self._sag = np.array([np.interp(x, *table) for x, table in pairs])
        self._feedback.falsify(self._sag)


def _table(model: mujoco.MjModel, actuator: int, slack: float, scale: float) -> tuple[Array, Array]:
    """What hangs, over the tension that a straight wire would have: (k,) [N], (k,) [m].

    It is written from the tension that the wire has, from which the other follows.
    """
    gear = model.actuator_gear[actuator, 0]
    stiffness = -model.actuator_biasprm[actuator, 1] * gear**2
    low, high = _tension_range(model, actuator)
    tension = np.linspace(low, min(high, low + REACH * scale), POINTS)
    sag = slack * np.exp(-tension / scale)
    return tension - stiffness * sag, sag


def _tension_range(model: mujoco.MjModel, actuator: int) -> tuple[float, float]:
    """Least and largest tension that an actuator gives [N]; a wire does not push."""
    if not model.actuator_forcelimited[actuator]:
        return 0.0, np.inf
    ends = -model.actuator_gear[actuator, 0] * model.actuator_forcerange[actuator]
    return max(float(ends.min()), 0.0), max(float(ends.max()), 0.0)


CAUSE = Cause(
    id="slack",
    title="slack wire",
    explanation="A wire hangs where its tension is low, so that more is paid out than its path.",
    places=_places,
    parameters=_parameters,
    attach=_attach,
)

"""Length scale: the encoder of a tendon has a wrong scale, as with a wrong spool radius.

At the length ``l`` it reads ``l0 + (1 + scale) (l - l0)``, where ``l0`` is the length at the
model's ``qpos0``, at which encoders are zeroed. A servo feeds the wrong length and speed back, or
the wrong length only where the speed has another source. If only the conversion of the log is
wrong, only the reading is.
"""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, SearchHints, Values
from reality_gap.causes.support import elements, encoders, servos
from reality_gap.causes.support.encoders import POSITION, READING
from reality_gap.study.system import System


def _locations(system: System) -> tuple[Location, ...]:
    found = elements.each_tendon(system) + elements.all_tendons(system)
    used = tuple(p for p in found if all(map(encoders.is_used, encoders.encoders(system, p))))
    return used + encoders.readings_only(system, used) + encoders.positions_only(system, used)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    # Not linear: a tendon that is held too short pulls against the others, but one that is too long
    # goes slack. Hence the secants.
    hints, tolerance = SearchHints(secants=(0.012, -0.012)), encoders.tolerance(location, 0.0002)
    return (Parameter("scale", "1", 0.02, tolerance, -0.5, 0.5, hints=hints),)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    for tendon in (system.tendon(name) for name in location.elements):
        if tendon.servo and location.note != READING:
            zero = _zero(system, tendon.name)
            speed = location.note != POSITION
            servos.add_reading_error(spec, tendon.actuator, 0.0, values["scale"], zero, speed)


def _zero(system: System, tendon: str) -> float:
    """Return the length at which an encoder reads the true one [m]."""
    return 0.0 if system.study.absolute_encoders else system.tendon(tendon).length0


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    chosen = encoders.encoders(system, location)

    def stretch(record: Record) -> None:
        for encoder in chosen:
            travel = encoders.true_position(record, encoder) - _zero(system, encoder.element)
            encoders.add_to_reading(record, encoder, values["scale"] * travel)

    effects.readings.append(stretch)


CAUSE = Cause(
    id="length_scale",
    title="length scale",
    explanation="An encoder reads a tendon's motion times a factor, as with a wrong spool radius.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
)

"""An encoder of a wire that counts metres too long or too short, as with a wrong spool radius.

It reads ``l0 + (1 + scale) (l - l0)``, where ``l0`` is the length at which encoders are zeroed:
that in the model's ``qpos0``.
"""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, SearchHints, Values
from reality_gap.causes.support import elements, encoders, servos
from reality_gap.study.system import System


def _locations(system: System) -> tuple[Location, ...]:
    found = elements.each_tendon(system) + elements.all_tendons(system)
    return tuple(p for p in found if all(map(encoders.matters, encoders.encoders(system, p))))


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    # A wire that is held too short fights the others, one that is too long goes slack: no line.
    return (
        Parameter(
            "scale", "1", 0.02, 0.0002, -0.5, 0.5, hints=SearchHints(secants=(0.012, -0.012))
        ),
    )


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    for tendon in (system.tendon(name) for name in location.elements):
        if tendon.servo:
            servos.misread(spec, tendon.actuator, 0.0, values["scale"], tendon.length0)


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    chosen = encoders.encoders(system, location)

    def stretch(record: Record) -> None:
        for encoder in chosen:
            travel = encoders.recorded(record, encoder) - system.tendon(encoder.element).length0
            encoders.add_to_reading(record, encoder, values["scale"] * travel)

    effects.readings.append(stretch)


CAUSE = Cause(
    id="length_scale",
    title="wrong scale of a length",
    explanation="An encoder counts more or less than the wire moves, as with a wrong spool radius.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
)

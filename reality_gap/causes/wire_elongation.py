"""Permanent elongation of a tendon, suddenly or slowly.

The encoder is on the motor side and reads less than the length of the path by the elongation. The
time is that of the study, in which an episode begins where the previous one ended, because an
elongated tendon stays longer. A slow elongation continues in the pauses between episodes where
these are known.
"""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, SearchHints, Values
from reality_gap.causes.support import elements, encoders, typical_scales
from reality_gap.study.system import System, column
from reality_gap.types import Floats

RISE = 0.015
"""Time constant of a sudden elongation [s]; 90 % of it happens within 3 time constants."""

STARTS = 8
"""Number of onsets from which fits start; the misfit falls steadily towards the true onset."""

SLOWLY = "slowly"
"""Note of a location with an elongation that grows at a constant rate."""


def _locations(system: System) -> tuple[Location, ...]:
    each = [
        p for p in elements.each_tendon(system) if encoders.is_used(*encoders.encoders(system, p))
    ]
    return tuple(each) + tuple(Location(p.kind, p.elements, SLOWLY) for p in each)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    total, travel = system.study.duration, typical_scales.tendon_travel(system)
    if location.note == SLOWLY:
        per = travel / float(system.study.elapsed(np.array([total]))[0])
        return (Parameter("rate", "m/s", 0.0133 * per, 1.3e-4 * per, -0.3 * per, 0.7 * per),)
    starts = tuple(total * (i + 0.5) / STARTS for i in range(STARTS))
    return (
        Parameter("elongation", "m", 0.0133 * travel, 0.0, -0.3 * travel, 0.7 * travel),
        Parameter("time", "s", 0.1, 0.0, 0.0, total, null=starts[0], hints=SearchHints(starts)),
    )


def _elongation(system: System, location: Location, values: Values, time: Floats) -> Floats:
    """Return the elongation at times in the study, shape (k,) [m]."""
    if location.note == SLOWLY:
        return values["rate"] * system.study.elapsed(time)
    return values["elongation"] * 0.5 * (1 + np.tanh((time - values["time"]) / RISE))


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    chosen = encoders.encoders(system, location)

    def command(model: mujoco.MjModel, time: Floats, command: Floats) -> Floats:
        """Lengthen the targets, which is equivalent to readings that are too short."""
        command = command.copy()
        for encoder in chosen:
            if encoder.actuator:
                i = model.actuator(encoder.actuator).id
                ratio = model.actuator_biasprm[i, 1] * model.actuator_gear[i, 0]
                ratio /= -model.actuator_gainprm[i, 0]
                command[:, column(model, encoder.actuator)] += ratio * _elongation(
                    system, location, values, time
                )
        return command

    def read(record: Record) -> None:
        for encoder in chosen:
            encoders.add_to_reading(
                record, encoder, -_elongation(system, location, values, record.time)
            )

    effects.commands.append(command)
    effects.readings.append(read)


CAUSE = Cause(
    id="wire_elongation",
    title="permanent elongation of a tendon",
    explanation="A tendon becomes permanently longer, which its encoder does not show.",
    locations=_locations,
    parameters=_parameters,
    attach=_attach,
    fine=True,
)

"""Zero of tendon encoders: relative encoders are zeroed at the model's ``qpos0``.

At ``qpos0`` a person sets the reading of each tendon to the nominal length. A cause that changes
the path of a tendon therefore shows no error of the length there. The functions of this module add
such a cause to a model: ``geometry`` changes the paths, and what the lengths at ``qpos0`` change by
is subtracted from the readings and from the feedback of servos. Absolute encoders read lengths.
"""

from __future__ import annotations

from collections.abc import Callable

import mujoco

from reality_gap.causes.base import Effects, Location, Record, Values
from reality_gap.causes.support import servos
from reality_gap.study.system import System

Geometry = Callable[[mujoco.MjSpec, System, Location, Values], None]
"""Edits the paths of tendons in a model; its arguments are those of ``Cause.edit``."""


def edit_zeroed(
    geometry: Geometry, spec: mujoco.MjSpec, system: System, location: Location, values: Values
) -> None:
    """Edit paths, and let servos feed back what their encoders read."""
    geometry(spec, system, location, values)
    for name, excess in _excess(geometry, system, location, values).items():
        tendon = system.tendon(name)
        if tendon.servo:
            servos.add_reading_error(spec, tendon.actuator, -excess)


def attach_zeroed(
    geometry: Geometry, effects: Effects, system: System, location: Location, values: Values
) -> None:
    """Add the effect that relative encoders read lengths that are zeroed at ``qpos0``."""
    excess = _excess(geometry, system, location, values)

    def zero(record: Record) -> None:
        for tendon, length in excess.items():
            for sensor in system.tendon(tendon).length_sensors:
                record.sensors[:, record.column(sensor)] -= length

    effects.readings.append(zero)


def _excess(
    geometry: Geometry, system: System, location: Location, values: Values
) -> dict[str, float]:
    """Return by how much relative encoders read too much at ``qpos0`` [m]."""
    if system.study.absolute_encoders:
        return {}
    spec = system.study.spec()
    geometry(spec, system, location, values)
    model = spec.compile()
    lengths = {t.name: float(model.tendon_length0[model.tendon(t.name).id]) for t in system.tendons}
    changes = {t.name: lengths[t.name] - t.length0 for t in system.tendons}
    return {tendon: change for tendon, change in changes.items() if abs(change) > 1e-12}

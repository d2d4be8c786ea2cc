"""Encoders of wires are relative: they were zeroed where the drawing knows the length.

Whatever changes the path of a wire shows no error in the model's ``qpos0``, where a person put the
machine and called every wire's length that of the drawing.
"""

from __future__ import annotations

from collections.abc import Callable

import mujoco

from reality_gap.causes.base import Effects, Place, Record, Values
from reality_gap.causes.support import servos
from reality_gap.study.system import System

Geometry = Callable[[mujoco.MjSpec, System, Place, Values], None]


def edit(
    geometry: Geometry, spec: mujoco.MjSpec, system: System, place: Place, values: Values
) -> None:
    """Change paths by ``geometry``, and let servos see lengths zeroed at ``qpos0``."""
    geometry(spec, system, place, values)
    for tendon, excess in _excess(geometry, system, place, values).items():
        wire = system.wire(tendon)
        if wire.servo:
            servos.misread(spec, wire.actuator, -excess)


def attach(
    geometry: Geometry, effects: Effects, system: System, place: Place, values: Values
) -> None:
    """The same for what encoders read."""
    excess = _excess(geometry, system, place, values)

    def zero(record: Record) -> None:
        for tendon, length in excess.items():
            for sensor in system.wire(tendon).length_sensors:
                record.sensors[:, record.column(sensor)] -= length

    effects.senses.append(zero)


def _excess(geometry: Geometry, system: System, place: Place, values: Values) -> dict[str, float]:
    """By how much wires are longer than drawn at ``qpos0`` [m]."""
    spec = system.study.spec()
    geometry(spec, system, place, values)
    model = spec.compile()
    lengths = {
        w.tendon: float(model.tendon_length0[model.tendon(w.tendon).id]) for w in system.wires
    }
    changes = {w.tendon: lengths[w.tendon] - w.length0 for w in system.wires}
    return {tendon: change for tendon, change in changes.items() if abs(change) > 1e-12}

"""Encoders of wires are relative: they were zeroed where the drawing knows the length.

Whatever changes the path of a wire shows no error in the model's ``qpos0``, where a person put the
machine and called every wire's length that of the drawing.
"""

from __future__ import annotations

from collections.abc import Callable

import mujoco

from reality_gap.causes.base import Effects, Location, Record, Values
from reality_gap.causes.support import servos
from reality_gap.study.system import System

Geometry = Callable[[mujoco.MjSpec, System, Location, Values], None]


def edit(
    geometry: Geometry, spec: mujoco.MjSpec, system: System, location: Location, values: Values
) -> None:
    """Change paths by ``geometry``, and let servos see lengths zeroed at ``qpos0``."""
    geometry(spec, system, location, values)
    for name, excess in _excess(geometry, system, location, values).items():
        tendon = system.tendon(name)
        if tendon.servo:
            servos.misread(spec, tendon.actuator, -excess)


def attach(
    geometry: Geometry, effects: Effects, system: System, location: Location, values: Values
) -> None:
    """The same for what encoders read."""
    excess = _excess(geometry, system, location, values)

    def zero(record: Record) -> None:
        for tendon, length in excess.items():
            for sensor in system.tendon(tendon).length_sensors:
                record.sensors[:, record.column(sensor)] -= length

    effects.readings.append(zero)


def _excess(
    geometry: Geometry, system: System, location: Location, values: Values
) -> dict[str, float]:
    """By how much wires are longer than drawn at ``qpos0`` [m]."""
    spec = system.study.spec()
    geometry(spec, system, location, values)
    model = spec.compile()
    lengths = {w.name: float(model.tendon_length0[model.tendon(w.name).id]) for w in system.tendons}
    changes = {w.name: lengths[w.name] - w.length0 for w in system.tendons}
    return {tendon: change for tendon, change in changes.items() if abs(change) > 1e-12}

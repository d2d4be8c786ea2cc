"""Unit guesses: the unit of a column from its name, its size and the joint that it belongs to."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from reality_gap.io.column_names import named_unit
from reality_gap.io.units import parse_unit
from reality_gap.types import Floats

DEGREES, MILLIMETRES = 10.0, 20.0
"""Sizes above which positions are taken as degrees or millimetres, not as rad [rad] or m [m]."""
FIT = 3.0
"""Size up to which positions have the unit of a model, over the largest one that it allows."""
TICKS = 720.0
"""Size above which whole numbers are taken as ticks of an encoder, not as degrees."""
ONWARD = 0.8
"""Share of its range by which a position moves from first to last if it turns on and on."""
LONG = 0.95
"""Quantile of the magnitudes that is called the size of a column."""
_JOINTPOS = (int(mujoco.mjtSensor.mjSENS_JOINTPOS), int(mujoco.mjtSensor.mjSENS_ACTUATORPOS))
_ACTUATORPOS = int(mujoco.mjtSensor.mjSENS_ACTUATORPOS)
_JOINT_TRANSMISSIONS = (
    int(mujoco.mjtTrn.mjTRN_JOINT),
    int(mujoco.mjtTrn.mjTRN_JOINTINPARENT),
)


class UnitGuess(NamedTuple):
    """Unit of a column.

    Attributes:
        unit: symbol of the unit.
        reason: why, as the end of a sentence about the column; empty if its name states the unit.
        scale, offset: value = scale * cell + offset, in this unit.
    """

    unit: str
    reason: str = ""
    scale: float = 1.0
    offset: float = 0.0

    @property
    def conversion(self) -> str:
        """Further keys of the line of the study, such as ", scale: 0.001"; empty without any."""
        scale = f", scale: {self.scale:.9g}" if self.scale != 1.0 else ""
        return scale + (f", offset: {self.offset:.9g}" if self.offset else "")

    def si(self, cell: float) -> float:
        """Return the value of a cell in SI units."""
        return parse_unit(self.unit).factor * (self.scale * cell + self.offset)


def guess_unit(
    column: str,
    units: tuple[str, ...],
    cells: Floats | None,
    endless: bool = False,
    largest: float = 0.0,
) -> UnitGuess:
    """Return the unit in a column's name, or else a guess from the size of its values.

    Args:
        column: name of the column.
        units: SI units that are valid, the usual one first.
        cells: its values, shape (n,); None if they are unknown.
        endless: whether the joint has no limits, so that a large angle is not unusual.
        largest: size of the largest position that the model allows [rad or m]; 0 if it allows any.
    """
    named = named_unit(column, units)
    if named:
        return UnitGuess(named)
    size = 0.0 if cells is None else float(np.quantile(np.abs(cells), LONG))
    if cells is None or units[0] not in ("rad", "m"):
        return UnitGuess(units[0])
    own = units[0]
    small, usual = ("mm", MILLIMETRES) if own == "m" else ("deg", DEGREES)
    if largest > 0.0 and parse_unit(small).factor * size <= FIT * largest:
        usual = FIT * largest  # as it fits in one unit or the other
    if size <= usual or (endless and _turns_on(cells)):
        return UnitGuess(own)
    if own == "rad" and size > TICKS and np.all(cells == np.round(cells)):
        return _ticks(cells)
    return UnitGuess(small, f"is taken as {small}")


def _turns_on(cells: Floats) -> bool:
    """Return whether a position moves on and on, as that of a wheel does."""
    return bool(abs(cells[-1] - cells[0]) > ONWARD * np.ptp(cells) > 0.0)


def _ticks(cells: Floats) -> UnitGuess:
    """Return the conversion of ticks, as many a turn as the next power of two, at least 4096."""
    bits = max(12, int(np.ceil(np.log2(1.0 + float(np.max(np.abs(cells)))))))
    count = 2**bits
    # Servos with 4096 ticks are at zero in the middle of their turn.
    zero = count // 2 if np.min(cells) >= 0.0 else 0
    scale = 2.0 * np.pi / count
    reason = f"is taken as ticks of an encoder with {count} per turn, zero at {zero}"
    return UnitGuess("rad", reason, scale, -zero * scale)


def is_endless(model: mujoco.MjModel, part: str, name: str) -> bool:
    """Return whether a sensor or actuator belongs to a hinge without limits.

    Args:
        model: the compiled model.
        part: "sensors", "actuators" or "efforts".
        name: name of the element in this part of a study.
    """
    joint = -1
    if part == "sensors" and int(model.sensor(name).type[0]) in _JOINTPOS:
        joint = int(model.sensor(name).objid[0])
        if int(model.sensor(name).type[0]) == _ACTUATORPOS:
            joint = joint_of(model, joint)
    elif part == "actuators":
        joint = joint_of(model, int(model.actuator(name).id))
    hinge = int(mujoco.mjtJoint.mjJNT_HINGE)
    return joint >= 0 and int(model.jnt_type[joint]) == hinge and not model.jnt_limited[joint]


def joint_of(model: mujoco.MjModel, actuator: int) -> int:
    """Return the id of the joint that an actuator moves; -1 if it moves something else."""
    if int(model.actuator_trntype[actuator]) not in _JOINT_TRANSMISSIONS:
        return -1
    return int(model.actuator_trnid[actuator, 0])

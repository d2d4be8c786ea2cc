"""Column assignment: the columns of logs that belong to the elements of a compiled model."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import mujoco

from reality_gap.io.column_guesses import Element, Found, guess, named_share, silent_words
from reality_gap.io.column_names import KINDS, guess_time, kind_of
from reality_gap.io.dimensions import actuator_units, sensor_units
from reality_gap.io.validation import actuator_names, sensor_names, simple_joints

Note = Callable[[str], None]
"""Called with a sentence on what was guessed or left out."""

_TRANSMISSIONS = {
    int(mujoco.mjtTrn.mjTRN_JOINT): mujoco.mjtObj.mjOBJ_JOINT,
    int(mujoco.mjtTrn.mjTRN_JOINTINPARENT): mujoco.mjtObj.mjOBJ_JOINT,
    int(mujoco.mjtTrn.mjTRN_TENDON): mujoco.mjtObj.mjOBJ_TENDON,
}
"""Types of elements that actuators move, by the transmission."""


@dataclass(frozen=True)
class Assignment:
    """Columns of the elements of a model.

    Attributes:
        parts: the elements that need columns, by part of the study.
        found: columns by the name of the element, by part of the study.
        clock: column of the time; None if no name indicates it.
        free: columns that belong to no element.
    """

    parts: dict[str, list[Element]]
    found: dict[str, dict[str, tuple[str, ...]]]
    clock: str | None
    free: tuple[str, ...]

    @property
    def commands(self) -> tuple[str, ...]:
        """The columns of commands."""
        return tuple(column for group in self.found["actuators"].values() for column in group)


def assign_columns(
    model: mujoco.MjModel, columns: Sequence[str], added: Collection[str] = ()
) -> Assignment:
    """Assign columns to the actuators, sensors and efforts of a model by their names.

    Args:
        model: the compiled model.
        columns: names of the columns of all logs.
        added: names of sensors that the user's model lacks.
    """
    parts = _parts(model, added)
    clock = guess_time(columns)
    columns = [column for column in columns if column != clock]
    found = guess([element for elements in parts.values() for element in elements], columns)
    used = {column for group in found.values() for column in group}
    return Assignment(
        parts,
        {part: {e.name: found[e] for e in some if e in found} for part, some in parts.items()},
        clock,
        tuple(column for column in columns if column not in used),
    )


def efforts_of(joints: Sequence[str], columns: Sequence[str]) -> Found:
    """Return the columns that are named like efforts of joints."""
    return guess([_effort(name) for name in joints], columns)


def undriven(joints: Sequence[str], columns: Sequence[str]) -> str:
    """Return a sentence on columns that seem to be commands of a model without actuators.

    It is empty without such columns, and if other columns are named like efforts, because the
    commands are then not needed.
    """
    if efforts_of(joints, columns):
        return ""
    elements = [Element(name, name, "command") for name in joints]
    silent = silent_words(elements)
    stated = [column for column in columns if kind_of(column, silent(column)) == "command"]
    driven = {column: e.name for e, group in guess(elements, stated).items() for column in group}
    if not driven:
        return ""
    ordered = [column for column in stated if column in driven]
    commands, joint = ", ".join(ordered), driven[ordered[0]]
    return (
        f"the model has no actuators, but {commands} seem to be commands, and no column seems to "
        "be an effort; add to the model what these commands drive, such as "
        f'<actuator><position joint="{joint}" kp=".." kv=".."/></actuator>, or log efforts'
    )


def note_doubts(assignment: Assignment, note: Note) -> None:
    """Note the columns that were assigned by a part of a name or by their order, or not at all."""
    doubtful = [
        f"{', '.join(assignment.found[part][element.name])} to {element.name}"
        for part, elements in assignment.parts.items()
        for element in elements
        if element.name in assignment.found[part]
        and named_share(_alone(element, elements), assignment.found[part][element.name][0]) < 1.0
    ]
    if doubtful:
        note(
            "by their order or by a part of their names only, columns were assigned: "
            f"{'; '.join(doubtful)}"
        )
    unused = [column for column in assignment.free if kind_of(column) not in ("", "time", "other")]
    others = len(assignment.free) - len(unused)
    if unused:
        more = f", and {others} more" if others else ""
        note(f"not used, because no element of the model fits: {', '.join(unused)}{more}")


def _alone(element: Element, elements: Sequence[Element]) -> Element:
    """Return an element without what it moves if others of its kind move that, too."""
    alike = [e for e in elements if (e.moved, e.kind) == (element.moved, element.kind)]
    return replace(element, moved="") if len(alike) > 1 else element


def _parts(model: mujoco.MjModel, added: Collection[str]) -> dict[str, list[Element]]:
    """Return the elements that need columns, by part of the study."""
    joints = () if model.nu else simple_joints(model)
    return {
        "actuators": [_command(model, name) for name in actuator_names(model) if name],
        "sensors": [_sensor(model, name, name in added) for name in sensor_names(model)],
        "efforts": [_effort(name) for name in joints],
    }


def _command(model: mujoco.MjModel, name: str) -> Element:
    quantity = _kind_of_units(actuator_units(model, name))
    return Element(name, "", "command", quantity=quantity, moved=_moved(model, name))


def _moved(model: mujoco.MjModel, actuator: str) -> str:
    """Return the name of the joint or tendon that an actuator moves; empty if it moves neither."""
    one = model.actuator(actuator)
    kind = _TRANSMISSIONS.get(int(model.actuator_trntype[one.id]))
    return "" if kind is None else mujoco.mj_id2name(model, kind, int(one.trnid[0])) or ""


def _sensor(model: mujoco.MjModel, name: str, added: bool) -> Element:
    sensor = model.sensor(name)
    target = mujoco.mj_id2name(model, int(sensor.objtype[0]), int(sensor.objid[0])) or ""
    kind = _kind_of_units(sensor_units(model, name))
    family, count = str(int(sensor.type[0])), int(sensor.dim[0])
    drives = target and int(sensor.objtype[0]) == int(mujoco.mjtObj.mjOBJ_ACTUATOR)
    moved = _moved(model, target) if drives else ""
    return Element(name, target, kind, count, family=family, added=added, moved=moved)


def _effort(joint: str) -> Element:
    return Element(joint, joint, "force", family="effort", added=True)


def _kind_of_units(units: Sequence[str]) -> str:
    """Return the kind of quantity of all units that have one; empty if there is no such kind."""
    kinds = {KINDS[unit] for unit in units if unit in KINDS}
    return kinds.pop() if len(kinds) == 1 else ""

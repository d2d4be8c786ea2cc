"""Template: drafts a STUDY.yaml for a model and its logs, to be edited by hand."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from reality_gap.errors import StudyError
from reality_gap.io.column_assignment import Assignment, assign_columns, note_doubts, undriven
from reality_gap.io.column_guesses import Element
from reality_gap.io.column_names import guess_time_unit, named_unit
from reality_gap.io.dimensions import actuator_units, joint_units, sensor_units
from reality_gap.io.plausibility import largest_position, missing_length, sample_positions
from reality_gap.io.tables import read_header, read_table
from reality_gap.io.unit_guesses import guess_unit, is_endless
from reality_gap.io.validation import simple_joints
from reality_gap.study.data import load_untrusted_spec
from reality_gap.types import Floats

Note = Callable[[str], None]
"""Called with a sentence on what was guessed by size or left out."""
ZEROED = "is taken as 0 at qpos0, so that the tendon's length there is its offset"
"""Why lengths get an offset."""
RESTS = "has the same value in all rows, as a joint at rest or a dead sensor has"
"""Why a sensor is left out."""
_JOINTPOS = int(mujoco.mjtSensor.mjSENS_JOINTPOS)

HEAD = """\
# Draft: columns and units are guesses from the names of the columns. Check each line, then run
#   reality-gap check STUDY.yaml
# A line can also have noise: (standard deviation of one reading), scale: and offset:, all in its
# unit; value = scale * cell + offset. An empty cell of a log was not measured.
"""


@dataclass(frozen=True)
class _Log:
    path: Path
    columns: tuple[str, ...]

    def cells(self, column: str) -> np.ndarray | None:
        """Return the numbers of a column; None if it holds anything else."""
        try:
            cells = read_table(self.path, self.path.name, (column,)).columns[column]
        except StudyError:
            return None
        cells = cells[~np.isnan(cells)]
        return cells if len(cells) else None


def draft_study(
    model_path: Path | str,
    log_paths: Sequence[Path | str],
    folder: Path | str | None = None,
    name: str | None = None,
    note: Note = lambda sentence: None,
    recordings: Mapping[str, str] | None = None,
    added: Collection[str] = (),
    assignment: Assignment | None = None,
) -> str:
    """Draft the text of a STUDY.yaml.

    Lines that cannot be guessed are comments. Each log with commands becomes an episode. The
    other logs become further readings: of the logs with the same columns, the first one belongs
    to the first episode, and so on.

    Args:
        model_path: MJCF file.
        log_paths: CSV or Parquet files.
        folder: folder of the STUDY.yaml; by default that of the model.
        name: name of the study; by default that of the model's file.
        note: called with a sentence on what was guessed by size or left out.
        recordings: name of the recording that a log is a part of, by the file name of the log.
        added: names of sensors that the user's model lacks.
        assignment: columns of the model's elements; by default they are assigned by their names.

    Returns:
        The text of the file.

    Raises:
        StudyError: the model or a log cannot be read, or lies outside of ``folder``.
    """
    path = Path(model_path)
    folder = path.parent if folder is None else Path(folder)
    model = load_untrusted_spec(path, folder).copy().compile()
    logs = [_Log(Path(p), read_header(Path(p), Path(p).name)) for p in log_paths]
    if not logs:
        raise StudyError("a study needs at least one log")
    columns = tuple(dict.fromkeys(c for log in logs for c in log.columns if c))
    assignment = assignment or assign_columns(model, columns, added)
    note_doubts(assignment, note)
    if not model.nu and (sentence := undriven(simple_joints(model), columns)):
        note(sentence)
    parts, found, free = assignment.parts, assignment.found, assignment.free
    positions = sample_positions(model)
    resting = _resting(model, logs, parts["sensors"], found["sensors"], positions)
    for sensor in resting:
        [column] = found["sensors"].pop(sensor)
        note(f"{sensor} was left out of the study: {column} {RESTS}")
    lines = [
        HEAD + f"name: {yaml_text(name or path.stem)}",
        f"model: {yaml_text(_relative(path, folder))}",
        *_episodes(logs, found["actuators"], folder, _positions(model, resting), recordings or {}),
        _time(logs, assignment.clock),
    ]
    for part, elements in parts.items():
        if elements or part == "sensors":
            chosen = found[part], free, positions
            lines += [f"{part}:", *_lines(model, logs, part, elements, *chosen, note)]
    return "\n".join([*lines, _initial(model, found["sensors"])]) + "\n"


def _units(model: mujoco.MjModel, part: str, name: str) -> tuple[str, ...]:
    if part == "actuators":
        return actuator_units(model, name)
    return sensor_units(model, name) if part == "sensors" else joint_units(model, name)[1:]


def _lines(
    model: mujoco.MjModel,
    logs: Sequence[_Log],
    part: str,
    elements: Sequence[Element],
    found: dict[str, tuple[str, ...]],
    free: Sequence[str],
    positions: tuple[Floats, Floats],
    note: Note,
) -> list[str]:
    """Return the lines of a part of the study; elements without a column become comments."""
    lines, guesses = list[str](), dict[str, list[str]]()
    for element in elements:
        units = _units(model, part, element.name) or ("1",)
        key = "column" if element.count == 1 else "columns"
        if element.name in found:
            group = found[element.name]
            shown = ", ".join(map(yaml_text, group))
            shown = shown if element.count == 1 else f"[{shown}]"
            endless = is_endless(model, part, element.name)
            cells = _cells(logs, group[0])
            largest = largest_position(model, part, element.name, positions)
            unit = guess_unit(group[0], units, cells, endless, largest)
            if unit.reason:
                guesses.setdefault(unit.reason, []).append(group[0])
            if cells is not None:
                factor = unit.si(1.0)
                lacks = missing_length(model, part, element.name, factor * cells, positions)
                if lacks:
                    unit = unit._replace(offset=lacks / factor)
                    guesses.setdefault(ZEROED, []).append(group[0])
            scale = unit.conversion or _scale(model, logs, part, element.name, group)
            text = f"  {yaml_text(element.name)}: {{{key}: {shown}, unit: {unit.unit}{scale}}}"
            lines.append(text)
        else:
            shown = "?" if element.count == 1 else f"[{', '.join('?' * element.count)}]"
            lines.append(f"  # {yaml_text(element.name)}: {{{key}: {shown}, unit: {units[0]}}}")
    if part == "sensors" and not elements:
        lines.append(
            '  # the model has no sensors; add some, such as <tendonpos name=".." tendon=".."/>'
        )
    if len(found) < len(elements) and free:
        lines.append(f"  # unused columns: {', '.join(free)}")
    for reason, columns in guesses.items():
        note(f"by the size of its values, each of {', '.join(columns)} {reason}")
    return lines


def _resting(
    model: mujoco.MjModel,
    logs: Sequence[_Log],
    sensors: Sequence[Element],
    found: dict[str, tuple[str, ...]],
    positions: tuple[Floats, Floats],
) -> dict[str, float]:
    """Return the only value of each sensor that has the same in all logs, in its SI unit.

    The positions of all joints are needed where efforts are compared, which is where the model has
    no actuators.
    """
    values = {}
    for element in sensors:
        kind = int(model.sensor(element.name).type[0])
        group = found.get(element.name, ())
        if len(group) != 1 or (not model.nu and kind == _JOINTPOS):
            continue
        held = [log.cells(group[0]) for log in logs if group[0] in log.columns]
        cells = np.concatenate([np.zeros(0), *(one for one in held if one is not None)])
        if len(cells) and np.ptp(cells) == 0.0:
            units = sensor_units(model, element.name) or ("1",)
            largest = largest_position(model, "sensors", element.name, positions)
            unit = guess_unit(group[0], units, cells, largest=largest)
            values[element.name] = unit.si(float(cells[0]))
    return values


def _positions(model: mujoco.MjModel, resting: dict[str, float]) -> str:
    """Return the positions of joints that rest as a line of an episode; empty without any."""
    found = {
        model.joint(int(model.sensor(name).objid[0])).name: value
        for name, value in resting.items()
        if int(model.sensor(name).type[0]) == _JOINTPOS
    }
    text = ", ".join(f"{yaml_text(joint)}: {value:.9g}" for joint, value in found.items())
    return f"    joints: {{{text}}}" if found else ""


def _scale(
    model: mujoco.MjModel, logs: Sequence[_Log], part: str, name: str, group: tuple[str, ...]
) -> str:
    """Return "scale: -1" for tensions that are positive in the log and negative in the model."""
    if part != "sensors":
        return ""
    sensor = model.sensor(name)
    if int(sensor.type[0]) != int(mujoco.mjtSensor.mjSENS_ACTUATORFRC):
        return ""
    i = int(sensor.objid[0])
    cells = _cells(logs, group[0])
    pulls = bool(model.actuator_forcelimited[i]) and float(model.actuator_forcerange[i, 1]) <= 0.0
    return ", scale: -1" if pulls and cells is not None and np.median(cells) > 0.0 else ""


def _cells(logs: Sequence[_Log], column: str) -> np.ndarray | None:
    return next(log for log in logs if column in log.columns).cells(column)


def _time(logs: Sequence[_Log], clock: str | None) -> str:
    if clock is None:
        return "# time: {column: ?, unit: s}  # no column name indicates the time"
    unit = named_unit(clock, ("s",))
    cells = _cells(logs, clock)
    if unit is None:
        unit = "s" if cells is None else guess_time_unit(cells)
    return f"time: {{column: {yaml_text(clock)}, unit: {unit}}}"


def _episodes(
    logs: Sequence[_Log],
    commands: dict[str, tuple[str, ...]],
    folder: Path,
    positions: str,
    recordings: Mapping[str, str],
) -> list[str]:
    keys = {column for group in commands.values() for column in group}
    driven = [log for log in logs if keys & set(log.columns)]
    if not driven:
        driven = [log for log in logs if log.columns == logs[0].columns]
    further: list[list[str]] = [[] for _ in driven]
    seen: dict[tuple[str, ...], int] = {}
    for log in logs:
        if log not in driven:
            k = seen.setdefault(log.columns, 0)
            further[min(k, len(driven) - 1)].append(yaml_text(_relative(log.path, folder)))
            seen[log.columns] += 1
    lines = ["episodes:"]
    names = [recordings.get(log.path.name, log.path.stem) for log in driven]
    for log, readings, name in zip(driven, further, names, strict=True):
        lines.append(f"  - commands: {yaml_text(_relative(log.path, folder))}")
        lines += [f"    readings: [{', '.join(readings)}]"] if readings else []
        lines += [positions] if positions else []
        lines += [f"    log: {yaml_text(name)}"] if len(set(names)) > 1 else []
    return lines


def _initial(model: mujoco.MjModel, sensors: dict[str, tuple[str, ...]]) -> str:
    if any(int(model.sensor(name).type[0]) == _JOINTPOS for name in sensors):
        return "initial: {joints: first_reading, settle: 0}"
    names = ", ".join(f"{yaml_text(name)}: 0.0" for name in simple_joints(model)[:3])
    return f"initial: {{settle: 1.0}}  # or {{joints: {{{names}}}, settle: 0}} in rad and m"


def _relative(path: Path, folder: Path) -> str:
    relative = Path(os.path.relpath(path.resolve(), folder.resolve()))
    if ".." in relative.parts:
        raise StudyError(f"{path} lies outside {folder}, the folder of the study; copy it there")
    return relative.as_posix()


def yaml_text(text: str) -> str:
    """Return a name as YAML: without quotes only if YAML cannot load it as another type."""
    words = {"true", "false", "yes", "no", "on", "off", "null", "y", "n"}
    plain = re.fullmatch(r"[A-Za-z_][\w./-]*", text) and text.lower() not in words
    return text if plain else json.dumps(text, ensure_ascii=False)

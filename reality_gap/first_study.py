"""First study: from a model and logs of any layout to a study that can be diagnosed and edited."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import yaml

from mjcf_sandbox.files import write_text
from reality_gap.errors import StudyError
from reality_gap.io.clock_shifts import correct_clocks
from reality_gap.io.column_assignment import Assignment, assign_columns, efforts_of, undriven
from reality_gap.io.column_guesses import Element, named_share
from reality_gap.io.completed_model import complete_model
from reality_gap.io.held_commands import hold_commands
from reality_gap.io.loader import load_study
from reality_gap.io.new_folder import check_new, new_folder
from reality_gap.io.recordings import TIME, Run, read_runs, write_run
from reality_gap.io.template import draft_study, yaml_text
from reality_gap.report.model_assets import write_model
from reality_gap.simulation.column_errors import ColumnError, column_errors
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Study, load_untrusted_spec

STUDY, MODEL = "STUDY.yaml", "model.xml"
"""Names of the files in the folder of a study."""
DRAFT = "DRAFT"
"""Name of a file that lies in the folder until the columns have been corrected."""
ROUNDS = 3
"""Largest number of replays; each corrects what the one before it found."""

Note = Callable[[str], None]
"""Called with a sentence on what was guessed, changed or left out."""


def write_first_study(model: Path, logs: Sequence[Path], folder: Path, note: Note) -> Path:
    """Write a study of a model and logs into a new folder.

    The folder contains a copy of the model with names and sensors for all that the logs may
    contain, the runs of the logs, and STUDY.yaml, in which columns are assigned by their names.

    Args:
        model: MJCF file.
        logs: CSV or Parquet files.
        folder: folder to create.
        note: called with a sentence on what was guessed, changed or left out.

    Returns:
        Path of STUDY.yaml.

    Raises:
        StudyError: the model or a log cannot be read, the logs contain no long enough run, or
            ``folder`` exists; or they contain commands, but the model has no actuators.
    """
    check_new(folder)
    spec, added = complete_model(load_untrusted_spec(model, model.parent))
    named = zip(logs, _names(logs), strict=True)
    files = [runs for runs in (read_runs(log, note, name) for log, name in named) if runs]
    if not files:
        raise StudyError("the logs contain no run that is long enough for a study")
    together, guessed = _begin_together(files, note)
    runs = [run for file in together for run in file]
    _check_names(runs)
    columns = tuple(dict.fromkeys([TIME, *(name for run in runs for name in run.columns if name)]))
    if not spec.actuators and (reason := undriven([j.name for j in spec.joints], columns)):
        raise StudyError(reason)
    assignment = _assign(spec, columns, added, note)
    runs = [hold_commands(run, assignment.commands, note) for run in runs]
    with new_folder(folder) as new:
        write_model(spec.to_xml(), model, new / MODEL)
        paths = [new / f"{run.name}.csv" for run in runs]
        for run, path in zip(runs, paths, strict=True):
            write_run(run, path)
        recordings = {f"{run.name}.csv": run.recording for run in runs}
        name = model.stem
        text = draft_study(new / MODEL, paths, new, name, note, recordings, added, assignment)
        write_text(new / STUDY, text)
        lines = [f"The columns in {STUDY} have not been corrected by a replay.", *guessed]
        write_text(new / DRAFT, "\n".join(lines) + "\n")
    if added:
        note(f"{MODEL} has further sensors, for what the logs may contain: {', '.join(added)}")
    return folder / STUDY


def correct_columns(path: Path, note: Note) -> Study:
    """Correct signs, units and swapped columns of a drafted study by a replay of its model.

    Args:
        path: STUDY.yaml as `write_first_study` wrote it; lines that are corrected say why.
        note: called with a sentence on each correction.

    Returns:
        The corrected study.

    Raises:
        StudyError: the study cannot be loaded, because the draft lacks columns, for example.
    """
    guessed = _guessed_clocks(path.parent / DRAFT)
    if guessed:  # with a wrong clock, readings may follow the replay with the opposite sign
        correct_clocks(path, guessed, note, only=guessed)
    noted: set[tuple[str, int]] = set()
    reasons: dict[str, list[str]] = {}
    for _ in range(ROUNDS):
        lines = _Lines(path, reasons)
        study, errors = _errors(load_study(path), note)
        for error in errors:
            new = (error.kind, error.channel) not in noted
            noted.add((error.kind, error.channel))
            if lines.correct(study, error):
                note(f"corrected in {path.name}: {error.sentence}")
            elif new:
                note(error.sentence)
        if not lines.changed:
            break
        lines.write()
    correct_clocks(path, guessed, note)
    (path.parent / DRAFT).unlink(missing_ok=True)
    return load_study(path)


def _guessed_clocks(draft: Path) -> list[str]:
    """Return the names of the files whose clock had no time in common with the commands'."""
    return draft.read_text(encoding="utf-8").splitlines()[1:] if draft.is_file() else []


def _errors(study: Study, note: Note) -> tuple[Study, tuple[ColumnError, ...]]:
    """Return the study as it is compared, to whose channels the errors belong, and the errors."""
    with Replayer(study) as replayer:
        compared, prediction = replayer.system.study, replayer.replay([]).prediction
        if np.isfinite(prediction).all():
            return compared, column_errors(compared, replayer.measured, prediction)
        note("the model's replay diverges, so that signs, units and columns were not checked")
        return compared, ()


class _Lines:
    """Lines of the sensors of a drafted study, each with one column.

    Attributes:
        path: the file.
        reasons: why a line was corrected, by the sensor's name.
        before: content of the lines by the sensor's name, as it is in the file.
        now: the same after the corrections.
    """

    def __init__(self, path: Path, reasons: dict[str, list[str]]) -> None:
        self.path, self.reasons = path, reasons
        self.text = path.read_text(encoding="utf-8").splitlines()
        sensors = yaml.safe_load("\n".join(self.text)).get("sensors") or {}
        single = {name: line for name, line in sensors.items() if "column" in line}
        self.at = {name: i for name in single if (i := self._find(name)) is not None}
        self.before: dict[str, dict[str, Any]] = {name: single[name] for name in self.at}
        self.now = {name: dict(line) for name, line in self.before.items()}

    @property
    def changed(self) -> bool:
        """Whether a line was corrected."""
        return self.now != self.before

    def correct(self, study: Study, error: ColumnError) -> bool:
        """Correct the line of a channel, and return whether that was possible.

        Columns are only swapped where none of them was assigned by its name: it is then more
        likely that those of the commands are swapped.
        """
        channel = study.channels[error.channel]
        if channel.kind == "effort" or channel.sensor not in self.now:
            return False
        line = self.now[channel.sensor]
        if error.kind == "column":
            swapped = [study.channels[i].sensor for i in error.cycle]
            if any(s not in self.now or self._is_named(study, s) for s in swapped):
                return False
            other = self.before[swapped[(error.cycle.index(error.channel) + 1) % len(swapped)]]
            line |= {key: other[key] for key in ("column", "unit") if key in other}
        else:
            line["scale"] = float(line.get("scale", 1.0)) * error.factor
        self.reasons.setdefault(channel.sensor, []).append(error.sentence)
        return True

    def write(self) -> None:
        """Write the corrected lines."""
        for sensor, line in self.now.items():
            if line != self.before[sensor]:
                content = yaml.safe_dump(
                    line, default_flow_style=True, sort_keys=False, allow_unicode=True, width=np.inf
                ).strip()
                reason = "; ".join(self.reasons[sensor])
                self.text[self.at[sensor]] = f"{_start(sensor)}{content}  # {reason}"
        write_text(self.path, "\n".join(self.text) + "\n")

    def _find(self, sensor: str) -> int | None:
        """Return the number of the line that is all that the file has on a sensor."""
        for i, line in enumerate(self.text):
            if line.startswith(_start(sensor) + "{") and "}" in line:
                return i
        return None

    def _is_named(self, study: Study, sensor: str) -> bool:
        spec = study.spec()
        found = next(s for s in spec.sensors if s.name == sensor)
        drives = found.objtype == mujoco.mjtObj.mjOBJ_ACTUATOR
        moved = spec.actuator(found.objname).target if drives else ""
        column = str(self.before[sensor]["column"])
        return named_share(Element(sensor, found.objname, "", moved=moved), column) > 0.0


def _start(sensor: str) -> str:
    return f"  {yaml_text(sensor)}: "


def _names(logs: Sequence[Path]) -> list[str]:
    """Return a name for each log: its stem, after that of its folder where stems are equal."""
    stems = [log.stem for log in logs]
    return [
        stem if stems.count(stem) == 1 else f"{log.resolve().parent.name}_{stem}"
        for log, stem in zip(logs, stems, strict=True)
    ]


def _check_names(runs: Sequence[Run]) -> None:
    names = [run.name for run in runs]
    for name in names:
        if names.count(name) > 1:
            raise StudyError(f"two logs are named {name}; rename one of them")


def _begin_together(files: Sequence[list[Run]], note: Note) -> tuple[list[list[Run]], list[str]]:
    """Shift the clocks of logs that have no time in common with logs of other columns.

    The first log with some columns belongs to the first one with those of ``files[0]``, and so on.
    Returned are the runs of each log, and the names of those files that were shifted.
    """
    kinds = [file[0].columns.keys() for file in files]
    partners = [file for file, kind in zip(files, kinds, strict=True) if kind == kinds[0]]
    found, guessed = list[list[Run]](), list[str]()
    for i, (file, own) in enumerate(zip(files, kinds, strict=True)):
        others = [run for f, k in zip(files, kinds, strict=True) if k != own for run in f]
        if own == kinds[0] or any(_overlap(run, other) for run in file for other in others):
            found.append(file)
            continue
        partner = partners[min(kinds[:i].count(own), len(partners) - 1)]
        shift = partner[0].time[0] - file[0].time[0]
        found.append([replace(run, time=run.time + shift) for run in file])
        guessed += [f"{run.name}.csv" for run in file]
        note(
            f"the clocks of {partner[0].name} and {file[0].name} have no time in common; "
            f"{file[0].name} was shifted, so that both begin together"
        )
    return found, guessed


def _overlap(one: Run, other: Run) -> bool:
    return bool(one.time[0] <= other.time[-1] and other.time[0] <= one.time[-1])


def _assign(
    spec: mujoco.MjSpec, columns: Sequence[str], added: Collection[str], note: Note
) -> Assignment:
    """Assign columns, and remove the actuators if the logs have efforts and no commands."""
    assignment = assign_columns(spec.copy().compile(), columns, added)
    if not spec.actuators or assignment.commands:
        return assignment
    if not efforts_of([joint.name for joint in spec.joints], columns):
        wanted = ", ".join(actuator.name for actuator in spec.actuators)
        note(
            f"no column is named like a command of {wanted}, nor like an effort; without either, "
            "nothing can be replayed"
        )
        return assignment
    names = {actuator.name for actuator in spec.actuators}
    actuator = mujoco.mjtObj.mjOBJ_ACTUATOR
    for sensor in [s for s in spec.sensors if s.objtype == actuator and s.objname in names]:
        spec.delete(sensor)
    for element in list(spec.actuators):
        spec.delete(element)
    note("the logs have no commands; efforts are compared along the measured motion")
    return assign_columns(spec.copy().compile(), columns, added)

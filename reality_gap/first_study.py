"""First study: from a model and logs of any layout to a study that can be diagnosed and edited."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import yaml

from mjcf_sandbox.files import write_text
from reality_gap.errors import StudyError
from reality_gap.io.column_names import Element, guess
from reality_gap.io.completed_model import complete_model
from reality_gap.io.loader import load_study
from reality_gap.io.new_folder import new_folder
from reality_gap.io.recordings import Run, read_runs, write_run
from reality_gap.io.template import draft_study, yaml_text
from reality_gap.report.model_assets import write_model
from reality_gap.simulation.column_errors import ColumnError, column_errors
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Study, load_untrusted_spec

STUDY, MODEL = "STUDY.yaml", "model.xml"
"""Names of the files in the folder of a study."""

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
        StudyError: the model or a log cannot be read, or the logs contain no long enough run.
    """
    spec, added = complete_model(load_untrusted_spec(model, model.parent))
    runs = [run for log in logs for run in read_runs(log, note)]
    if not runs:
        raise StudyError("the logs contain no run that is long enough for a study")
    _check_names(runs)
    _begin_together(runs, note)
    columns = tuple(dict.fromkeys(name for run in runs for name in run.columns))
    _without_commands(spec, columns, note)
    with new_folder(folder) as new:
        write_model(spec.to_xml(), model, new / MODEL)
        paths = [new / f"{run.name}.csv" for run in runs]
        for run, path in zip(runs, paths, strict=True):
            write_run(run, path)
        write_text(new / STUDY, draft_study(new / MODEL, paths, new))
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
    study = load_study(path)
    errors = _errors(study)
    if not errors:
        return study
    lines = _Lines(path)
    before = {i: lines.column(c.sensor) for i, c in enumerate(study.channels)}
    for error in errors:
        sensor = study.channels[error.channel].sensor
        line = lines.found.get(sensor)
        if line is None or study.channels[error.channel].kind == "effort":
            note(error.sentence)
            continue
        if error.other is not None:
            line["column"] = before[error.other]
        elif error.factor != 1.0:
            line["scale"] = float(line.get("scale", 1.0)) * error.factor
        lines.reasons[sensor] = error.sentence
        note(f"corrected in {path.name}: {error.sentence}")
    lines.write()
    return load_study(path)


def _errors(study: Study) -> tuple[ColumnError, ...]:
    with Replayer(study) as replayer:
        prediction = replayer.replay([]).prediction
        if not np.isfinite(prediction).all():
            return ()
        return column_errors(replayer.system.study, replayer.measured, prediction)


@dataclass
class _Lines:
    """Lines of the sensors of a drafted study, each with one column.

    Attributes:
        path: the file.
        found: content of the lines by the sensor's name.
        reasons: why a line was corrected, by the sensor's name.
    """

    path: Path

    def __post_init__(self) -> None:
        content = yaml.safe_load(self.path.read_text(encoding="utf-8"))
        sensors: dict[str, dict[str, Any]] = content.get("sensors") or {}
        self.found = {name: line for name, line in sensors.items() if "column" in line}
        self.reasons: dict[str, str] = {}

    def column(self, sensor: str) -> str:
        """Return the column of a sensor; empty if it has several."""
        return str(self.found.get(sensor, {}).get("column", ""))

    def write(self) -> None:
        """Write the corrected lines."""
        lines = self.path.read_text(encoding="utf-8").splitlines()
        for sensor, reason in self.reasons.items():
            start = f"  {yaml_text(sensor)}: {{"
            at = next(i for i, line in enumerate(lines) if line.startswith(start))
            content = dict(self.found[sensor])
            parts = [f"column: {yaml_text(content.pop('column'))}"]
            parts += [f"{key}: {value}" for key, value in content.items()]
            lines[at] = f"{start}{', '.join(parts)}}}  # {reason}"
        write_text(self.path, "\n".join(lines) + "\n")


def _check_names(runs: Sequence[Run]) -> None:
    names = [run.name for run in runs]
    for name in names:
        if names.count(name) > 1:
            raise StudyError(f"two logs are named {name}; rename one of them")


def _begin_together(runs: list[Run], note: Note) -> None:
    """Shift the clocks of logs with different columns that have no time in common."""
    first = runs[0]
    for i, run in enumerate(runs):
        apart = run.time[0] > first.time[-1] or run.time[-1] < first.time[0]
        if apart and run.columns.keys() != first.columns.keys():
            runs[i] = Run(run.name, run.time - run.time[0] + first.time[0], run.columns)
            note(
                f"the clocks of {first.name} and {run.name} have no time in common; {run.name} was "
                "shifted, so that both begin together"
            )


def _without_commands(spec: mujoco.MjSpec, columns: Sequence[str], note: Note) -> None:
    """Remove the actuators from a model whose logs have efforts and no commands."""
    commands = [Element(actuator.name, "", "command") for actuator in spec.actuators]
    efforts = [Element(joint.name, "", "force") for joint in spec.joints]
    if not commands or guess(commands, columns) or not guess(efforts, columns):
        return
    names = {actuator.name for actuator in spec.actuators}
    actuator = mujoco.mjtObj.mjOBJ_ACTUATOR
    for sensor in [s for s in spec.sensors if s.objtype == actuator and s.objname in names]:
        spec.delete(sensor)
    for element in list(spec.actuators):
        spec.delete(element)
    note("the logs have no commands; efforts are compared along the measured motion")

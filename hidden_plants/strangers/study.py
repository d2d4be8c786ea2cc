"""Writer of studies: the logs, nominal model and STUDY.yaml of a real machine."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hidden_plants.secret import Effect
from hidden_plants.strangers.mismatch import sample_mismatch
from hidden_plants.strangers.plant import Readings
from hidden_plants.strangers.readings import Run, command_times, noisy, real_run
from hidden_plants.strangers.stranger import SETTLE, Stranger
from hidden_plants.types import Floats

JITTER = 0.2
"""Half width of the instants of commands and readings, over the sampling interval."""


def write_study(folder: Path, stranger: Stranger, effects: tuple[Effect, ...] = ()) -> Run:
    """Simulate a real machine with hidden effects and write its study.

    Writes sensors_*.csv, commands_*.csv unless torques are logged, model.xml, and STUDY.yaml last.

    Args:
        folder: of the study; created if missing.
        stranger: nominal machine; its seed determines mismatches, noise and jitter, too.
        effects: hidden effects.

    Returns:
        The readings without noise, which are not written to the folder.

    Raises:
        ValueError: the machine leaves its ranges with these effects.
    """
    found = real_run(stranger, sample_mismatch(stranger), effects, JITTER)
    if not found.sound:
        names = ", ".join(effect.id for effect in effects) or "no effect"
        raise ValueError(f"machine {stranger.seed} leaves its ranges with {names}")
    folder.mkdir(parents=True, exist_ok=True)
    for k, (clean, times) in enumerate(zip(found.readings, found.times, strict=True)):
        _write_log(folder / f"sensors_{k}.csv", times, noisy(stranger, k, clean))
        if stranger.traits.kind != "efforts":
            targets = [f"target_{name}" for name in stranger.moved]
            table = dict(zip(targets, stranger.commands[k][1].T, strict=True))
            _write_log(folder / f"commands_{k}.csv", command_times(stranger, k, JITTER), table)
    (folder / "model.xml").write_text(stranger.xml)
    (folder / "STUDY.yaml").write_text(study_text(stranger))
    return found


def _write_log(path: Path, time: Floats, columns: Readings) -> None:
    names = ["time", *columns]
    rows = [",".join(names)]
    rows += [
        ",".join([f"{row[0]:.6f}", *(f"{value:.9g}" for value in row[1:])])
        for row in np.column_stack([time, *columns.values()])
    ]
    path.write_text("\n".join(rows) + "\n")


def study_text(stranger: Stranger) -> str:
    """Text of STUDY.yaml."""
    efforts = stranger.traits.kind == "efforts"
    lines = [f"name: stranger {stranger.seed}", "model: model.xml", "episodes:"]
    for k in range(len(stranger.paths)):
        if efforts:
            lines.append(f"  - commands: sensors_{k}.csv")
        else:
            lines.append(f"  - commands: commands_{k}.csv")
            lines.append(f"    readings: [sensors_{k}.csv]")
    lines.append("time: {column: time, unit: s}")
    if not efforts:
        lines.append("actuators:")
        for name, unit in zip(stranger.moved, _command_units(stranger), strict=True):
            lines.append(f"  m_{name}: {{column: target_{name}, unit: {unit}}}")
    lines.append("sensors:")
    lines += _sensor_lines(stranger, "sensor")
    if efforts:
        lines.append("efforts:")
        lines += _sensor_lines(stranger, "effort")
    lines += ["initial:", "  joints:"]
    home = stranger.paths[0].home
    lines += [
        f"    {joint}: {float(angle):.9g}"
        for joint, angle in zip(stranger.joints, home, strict=True)
    ]
    lines.append(f"  settle: {SETTLE:.1f}")
    return "\n".join(lines) + "\n"


def _sensor_lines(stranger: Stranger, part: str) -> list[str]:
    lines = []
    for sensor in stranger.sensors:
        if (sensor.kind == "effort") != (part == "effort"):
            continue
        noise = f", noise: {sensor.deviation:.6g}" if stranger.traits.noise_stated else ""
        unit = _units(stranger, sensor.index)[sensor.kind]
        lines.append(f"  {sensor.name}: {{column: {sensor.name}, unit: {unit}{noise}}}")
    return lines


def _units(stranger: Stranger, index: int) -> dict[str, str]:
    """Unit of each kind of sensor of a joint or drive."""
    slides = stranger.skeleton.links[index].slides if not stranger.routes else True
    length, force = ("m", "N") if slides else ("rad", '"N m"')
    rate = "m/s" if slides else "rad/s"
    return {"position": length, "length": "m", "velocity": rate, "force": force, "effort": force}


def _command_units(stranger: Stranger) -> list[str]:
    kind = "force" if stranger.traits.kind == "motors" else "position"
    return [_units(stranger, i)[kind] for i in range(len(stranger.moved))]

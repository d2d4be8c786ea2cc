"""Files of a study: logs in CSV and the text of STUDY.yaml."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hidden_plants.machine import Machine
from hidden_plants.nuisance import Nuisance
from hidden_plants.robot import Readings
from hidden_plants.types import Floats

MARKER_COLUMNS = {
    "marker_position": ("marker_x", "marker_y", "marker_z"),
    "marker_orientation": ("marker_qw", "marker_qx", "marker_qy", "marker_qz"),
}


def write_logs(
    folder: Path,
    index: int,
    machine: Machine,
    time: Floats,
    command: Floats,
    sensor_time: Floats,
    camera_time: Floats,
    readings: Readings,
    own_camera_file: bool,
) -> None:
    """Write the commands to episode_<index>.csv and the readings to sensors_<index>.csv.

    The marker's pose goes to camera_<index>.csv if ``own_camera_file``, and else to columns of
    sensors_<index>.csv that are empty in rows without a marker observation. Times are rounded to
    0.1 ms.

    Args:
        folder: of the study.
        index: of the episode.
        machine: nominal model.
        time: of the commands (n,) [s].
        command: target lengths (n, tendons) [m].
        sensor_time: of the readings of lengths and tensions (n,) [s].
        camera_time: of the marker observations (m,) [s].
        readings: by sensor, with noise.
        own_camera_file: whether the camera has a clock of its own.
    """
    columns = {"time": _times(time)}
    for tendon, targets in zip(machine.tendons, command.T, strict=True):
        columns[f"target_{tendon}"] = [f"{value:.7f}" for value in targets]
    _write_csv(folder / f"episode_{index}.csv", columns)
    columns = {"time": _times(sensor_time)}
    for tendon in machine.tendons:
        columns[f"length_{tendon}"] = [f"{value:.6f}" for value in readings[f"length_{tendon}"]]
    for tendon in machine.tendons:
        columns[f"tension_{tendon}"] = [f"{value:.3f}" for value in readings[f"tension_{tendon}"]]
    marker: dict[str, list[str]] = {}
    for sensor, names in MARKER_COLUMNS.items():
        for name, values in zip(names, readings[sensor].T, strict=True):
            marker[name] = [f"{value:.6f}" for value in values]
    if own_camera_file:
        _write_csv(folder / f"camera_{index}.csv", {"time": _times(camera_time), **marker})
    else:
        observed = np.searchsorted(sensor_time, camera_time)
        for name, cells in marker.items():
            columns[name] = [""] * len(sensor_time)
            for row, cell in zip(observed, cells, strict=True):
                columns[name][row] = cell
    _write_csv(folder / f"sensors_{index}.csv", columns)


def _times(time: Floats) -> list[str]:
    return [f"{value:.4f}" for value in time]


def _write_csv(path: Path, columns: dict[str, list[str]]) -> None:
    rows = zip(*columns.values(), strict=True)
    path.write_text("\n".join([",".join(columns), *(",".join(row) for row in rows)]) + "\n")


def study_text(
    machine: Machine,
    nuisance: Nuisance,
    episodes: int,
    initial: Floats,
    settle: float,
    own_camera_file: bool,
) -> str:
    """Text of STUDY.yaml.

    Args:
        machine: nominal model.
        nuisance: its noise is written to the sensors.
        episodes: number of episodes.
        initial: joint positions at the start of every episode (joints,) [rad].
        settle: settling time before every episode [s].
        own_camera_file: whether the camera has files of its own.
    """
    lines = [f"name: {machine.name} of a hidden plant", "model: model.xml", "episodes:"]
    for k in range(episodes):
        lines.append(f"  - commands: episode_{k}.csv")
        camera = f", camera_{k}.csv" if own_camera_file else ""
        lines.append(f"    readings: [sensors_{k}.csv{camera}]")
    lines += ["time: {column: time, unit: s}", "actuators:"]
    lines += [f"  {tendon}: {{column: target_{tendon}, unit: m}}" for tendon in machine.tendons]
    lines.append("sensors:")
    for tendon in machine.tendons:
        name = f"length_{tendon}"
        lines.append(f"  {name}: {{column: {name}, unit: m, noise: {nuisance.encoder_noise:.6g}}}")
    for tendon in machine.tendons:
        name, noise = f"tension_{tendon}", f"noise: {nuisance.tension_noise:.6g}"
        lines.append(f"  {name}: {{column: {name}, unit: N, {noise}, scale: -1}}")
    noises = (nuisance.marker_noise, 0.5 * nuisance.marker_turn_noise)
    for (sensor, names), unit, deviation in zip(
        MARKER_COLUMNS.items(), ("m", '"1"'), noises, strict=True
    ):
        cells = f"columns: [{', '.join(names)}], unit: {unit}, noise: {deviation:.6g}"
        lines.append(f"  {sensor}: {{{cells}}}")
    lines.append("initial:")
    lines.append("  joints:")
    lines += [
        f"    {joint}: {float(angle):.9g}"
        for joint, angle in zip(machine.joints, initial, strict=True)
    ]
    lines.append(f"  settle: {settle:.1f}")
    return "\n".join(lines) + "\n"

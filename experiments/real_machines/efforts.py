"""Studies of arms whose joint angles and joint efforts were measured."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from experiments.harness.errors import ExperimentError
from experiments.real_machines.models import add_position_sensor, write_model
from jmm_agent.types import Floats
from reality_gap.study.data import Channel, Episode, Reading, Study


def read_table(path: Path, columns: int, delimiter: str | None = ",", head: int = 1) -> Floats:
    """Read a table of numbers, shape (n, columns).

    Args:
        path: text file.
        columns: number of columns that it must have.
        delimiter: between cells; None for spaces.
        head: lines above the table.

    Raises:
        ExperimentError: there is no such file, or it is not such a table.
    """
    try:
        table = np.loadtxt(path, delimiter=delimiter, skiprows=head, ndmin=2)
    except (OSError, ValueError) as error:
        raise ExperimentError(
            f"{path} cannot be read as a table of numbers: {' '.join(str(error).split())}"
        ) from error
    if table.shape[1] != columns or not np.all(np.isfinite(table)):
        raise ExperimentError(
            f"{path} has {table.shape[1]} columns; {columns} columns of finite numbers are needed."
        )
    return table


def effort_study(
    name: str,
    spec: mujoco.MjSpec,
    folder: Path,
    time: Floats,
    angles: dict[str, Floats],
    efforts: dict[str, Floats],
) -> Study:
    """Make a study of one log of joint angles and efforts; write model.xml.

    Args:
        name: of the study.
        spec: model with the measured joints only.
        folder: where model.xml goes.
        time: times, shape (n,) [s].
        angles: positions by joint, shape (n,) each [m or rad].
        efforts: efforts by joint, shape (n,) each [N or N m]; joints may lack.
    """
    for actuator in list(spec.actuators):
        spec.delete(actuator)
    for sensor in list(spec.sensors):
        spec.delete(sensor)
    sensors = {joint: add_position_sensor(spec, joint) for joint in angles}
    slides = {j.name for j in spec.joints if j.type == mujoco.mjtJoint.mjJNT_SLIDE}
    channels: Sequence[Channel] = [
        Channel(f"{joint} position", sensor, unit="m" if joint in slides else "rad")
        for joint, sensor in sensors.items()
    ] + [
        Channel(f"{joint} effort", joint, unit="N" if joint in slides else "N m", kind="effort")
        for joint in efforts
    ]
    start = time - time[0]
    readings = tuple(Reading(start, values) for values in (*angles.values(), *efforts.values()))
    episode = Episode(name, start[:1], np.zeros((1, 0)), readings)
    return Study(name, write_model(spec, folder / "model.xml"), tuple(channels), (episode,))

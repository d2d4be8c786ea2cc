"""Aero hand: reader of the logs of its tendons, and its study.

Servos pull one tendon a finger; goals and readings of the servos were recorded at about 4 Hz while
each finger was closed and opened. Source: the repository google-deepmind/mujoco_playground, commit
90338219, folder mujoco_playground/_src/manipulation/tetheria_hand_tendon (Apache-2.0): the files
data/raw_data/motor_data_*.csv and xmls/PreGen1_RightHand_Tendon_thumb.xml. The user provides them;
nothing of them is in this package.

A servo counts from 0 where the finger is straight; `LENGTH` and `COUNTS` are from the authors'
``data_transform.py``. The nominal model is the authors' MJCF with two of the fingers.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from experiments.harness.errors import ExperimentError
from experiments.real_machines.models import read_model, write_model
from jmm_agent.types import Floats
from reality_gap import Study
from reality_gap.study.data import Channel, Episode, Initial, Reading

FOLDER = "aero_hand"
"""Folder of the logs and of the model in the user's data."""
MODEL = f"{FOLDER}/PreGen1_RightHand_Tendon_thumb.xml"
LENGTH, COUNTS = 0.04445, 65535
"""Length of the tendon that a servo winds [m] for its largest count."""
NOISE = 1e-4
"""Error of a reading [m]: the time of a reading is known to about 2 ms, and the tendon moves by up
to 0.06 m/s. At 4 Hz it cannot be estimated from the log."""
FINGERS = {"index": 5, "middle": 8}
"""Fingers that are used, and the numbers of their servos."""
LOG = f"{FOLDER}/motor_data_{{}}.csv"
"""Log of a servo."""
FILES = (*(LOG.format(number) for number in FINGERS.values()), MODEL)
ACTUATOR, SENSOR = "right_{}_A_pip", "len_{}f"
"""Names of a finger's actuator and of the sensor of its tendon's length in the model."""
JOINTS = tuple(
    f"right_{finger}_{part}" for finger in FINGERS for part in ("mcp_flex", "pip", "dip")
)


def make_study(data: Path, out: Path, seconds: float) -> Study:
    """Make the study of two fingers, with one episode each.

    Raises:
        ExperimentError: the files cannot be used.
    """
    spec = read_model(data / MODEL, JOINTS)
    sensors = {finger: SENSOR.format(finger[0]) for finger in FINGERS}
    for sensor in list(spec.sensors):
        if sensor.name not in sensors.values():
            spec.delete(sensor)
    actuators = {finger: ACTUATOR.format(finger) for finger in FINGERS}
    for actuator in list(spec.actuators):
        if actuator.name not in actuators.values():
            spec.delete(actuator)
    for tendon in list(spec.tendons):
        if not tendon.name.startswith(tuple(f"{finger[0]}f_" for finger in FINGERS)):
            spec.delete(tendon)
    if len(spec.sensors) != len(FINGERS) or len(spec.actuators) != len(FINGERS):
        raise ExperimentError(
            f"{data / MODEL} lacks one of {', '.join([*sensors.values(), *actuators.values()])}."
        )
    model = write_model(spec, out / "model.xml")
    order = [actuator.name for actuator in spec.actuators]
    longest = {finger: spec.actuator(name).ctrlrange[1] for finger, name in actuators.items()}
    channels = tuple(
        Channel(f"{finger} tendon", sensor, unit="m", noise=NOISE)
        for finger, sensor in sensors.items()
    )
    episodes = []
    for finger, number in FINGERS.items():
        rows = read_log(data / LOG.format(number), number)
        time, goal, length = rows[rows[:, 0] <= seconds / len(FINGERS)].T
        command = np.tile([longest[f] for f in FINGERS], (len(time), 1))
        command[:, order.index(actuators[finger])] = longest[finger] - goal
        none = Reading(np.empty(0), np.empty(0))
        readings = tuple(
            Reading(time, longest[finger] - length) if other == finger else none
            for other in FINGERS
        )
        episodes.append(Episode(finger, time, command, readings))
    return Study("Aero hand", model, channels, tuple(episodes), Initial(settle=1.0))


def read_log(path: Path, number: int) -> Floats:
    """Read the times [s], goals and readings [m wound] of one servo, shape (n, 3).

    Raises:
        ExperimentError: there is no such file, or it is not such a log.
    """
    names = ("timestamp", f"servo_{number}_sent", f"servo_{number}_read")
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = [[float(row[name]) for name in names] for row in csv.DictReader(file)]
        table = np.array(rows, dtype=float)
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise ExperimentError(f"{path} cannot be read as a log of the hand: {error}") from error
    if table.ndim != 2 or np.any(np.diff(table[:, 0]) <= 0) or not np.all(np.isfinite(table)):
        raise ExperimentError(f"{path} needs finite rows of {', '.join(names)} with rising times.")
    table[:, 0] -= table[0, 0]
    table[:, 1:] *= LENGTH / COUNTS
    return table

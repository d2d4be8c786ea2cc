"""SO-101 arm: reader of the logs, and its study.

An arm with six Feetech STS3215 servos follows motions at 50 Hz; goals and positions were recorded.
Source: the repository isaac-sim2real/sage, folder output/real/so101/custom (Apache-2.0); the
nominal model is Simulation/SO101/so101_new_calib.xml of TheRobotStudio/SO-ARM100 (Apache-2.0). The
user provides both; nothing of them is in this package.

The gripper is left out, for its opening is measured in its own unit. The currents have no sign and
are left out, too.
"""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np

from experiments.harness.errors import ExperimentError
from experiments.real_machines.models import add_position_sensor, read_model, write_model
from jmm_agent.types import Floats
from reality_gap import Study
from reality_gap.study.data import Channel, Episode, Initial, Reading

FOLDER = "so101"
"""Folder of the motions and of the model in the user's data."""
MODEL = f"{FOLDER}/so101_new_calib.xml"
MOTIONS = ("friction_gravity", "inertia_coupling")
"""Motions that are used: a slow and a fast one."""
FILES = (*(f"{FOLDER}/{motion}/*.csv" for motion in MOTIONS), MODEL)
"""Patterns of the files."""
JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")
"""Joints of the model in the order of the log."""
COLUMNS = 6
"""Positions in each row: these joints and the gripper."""
STEP = 0.002
"""Time step of the model [s]."""
GAIN, ERROR_GAIN, VOLTS, CONSTANT, RESISTANCE = 16.0, 0.166, 7.4, 1.21164, 2.67617
"""The servo's gain in this log, and its model M1 by M. Duclusaud, G. Passault et al. (BAM): duty
cycle per gain and error [1/rad], voltage [V], torque constant [N m/A], resistance [Ohm]."""
MODEL_GAIN, MODEL_DAMPING = 998.22, 2.731 + 0.60
"""Stiffness [N m/rad] and damping [N m s/rad] in the nominal model."""
PUBLISHED = {
    "gain": GAIN * ERROR_GAIN * VOLTS * CONSTANT / RESISTANCE / MODEL_GAIN - 1.0,
    "servo_damping": 0.05908 + CONSTANT**2 / RESISTANCE - MODEL_DAMPING,
    "friction": 0.052393 - 0.052,
    "armature": 0.028403 - 0.028,
}
"""BAM's model M1 of this servo relative to the nominal model."""


def make_study(data: Path, out: Path, seconds: float) -> Study:
    """Make the study of the SO-101 arm.

    Raises:
        ExperimentError: the files cannot be used.
    """
    spec = read_model(data / MODEL, JOINTS)
    spec.option.timestep = STEP
    channels = tuple(
        Channel(f"{joint} position", add_position_sensor(spec, joint), unit="rad")
        for joint in JOINTS
    )
    model = write_model(spec, out / "model.xml")
    episodes = tuple(
        _episode(data / FOLDER / motion, motion, seconds / len(MOTIONS)) for motion in MOTIONS
    )
    return Study("SO-101 arm", model, channels, episodes, Initial(settle=0.0))


def _episode(folder: Path, name: str, seconds: float) -> Episode:
    """Episode of the first seconds of a motion."""
    goal, position = (read_positions(folder / file) for file in ("control.csv", "state_motor.csv"))
    goal, position = (table[table[:, 0] <= goal[0, 0] + seconds] for table in (goal, position))
    time = position[:, 0] - goal[0, 0]
    if len(time) < 2 or len(goal) < 2:
        raise ExperimentError(f"{folder} has no {seconds:g} s of goals and positions.")
    count = len(JOINTS)
    readings = tuple(Reading(time, position[:, k + 1]) for k in range(count))
    joints = {joint: float(position[0, k + 1]) for k, joint in enumerate(JOINTS)}
    return Episode(name, goal[:, 0] - goal[0, 0], goal[:, 1 : count + 1], readings, joints)


def read_positions(path: Path) -> Floats:
    """Read times [s] and positions [rad] of a log, shape (n, 7).

    Raises:
        ExperimentError: there is no such file, or it is not such a log.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = [
                [1e-6 * float(row["timestamp"]), *map(float, json.loads(row["positions"]))]
                for row in csv.DictReader(file)
            ]
        table = np.array(rows, dtype=float)
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise ExperimentError(f"{path} cannot be read as a log of the SO-101: {error}") from error
    if table.ndim != 2 or table.shape[1] != COLUMNS + 1 or not np.all(np.isfinite(table)):
        raise ExperimentError(f"{path} needs rows of a time and {COLUMNS} positions.")
    if np.any(np.diff(table[:, 0]) <= 0):
        raise ExperimentError(f"{path} has times that do not rise.")
    return table

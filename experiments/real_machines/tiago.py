"""TIAGo's arm: reader of the log, and its study.

The arm of a mobile manipulator follows an exciting trajectory; positions and motor currents of the
torso and of seven joints were recorded at about 100 Hz. Source: the repository
thanhndv212/figaroh-examples, folder examples/tiago (T. D. V. Nguyen, CNRS and TOWARD, Apache-2.0).
The user provides the folder; nothing of it is in this package.

The nominal model is the manufacturer's URDF. Currents become torques by gear ratios and torque
constants as in the authors' identification. The torso's current does not become a force without an
unknown, and the currents of the three wrist joints are a few steps of their converter; these four
joints are measured in position only.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from experiments.real_machines.efforts import effort_study, read_table
from experiments.real_machines.models import read_model
from reality_gap import Study

FOLDER = "tiago"
"""Folder of the log and of the model in the user's data."""
LOG = f"{FOLDER}/data/identification/dynamic"
MODEL = f"{FOLDER}/urdf/tiago_48_schunk.urdf"
POSITION, CURRENT = f"{LOG}/tiago_position.csv", f"{LOG}/tiago_effort.csv"
FILES = (POSITION, CURRENT, MODEL)
JOINTS = ("torso_lift_joint", *(f"arm_{k}_joint" for k in range(1, 8)))
"""Joints in the order of the columns."""
TORQUE_PER_AMPERE = {
    "arm_1_joint": 100 * 0.136,
    "arm_2_joint": 100 * 0.136,
    "arm_3_joint": 100 * -0.087,
    "arm_4_joint": 100 * -0.087,
}
"""Gear ratio times torque constant of the motors [N m/A]."""
BEGIN = 20.0
"""Start of the part that is used; all joints move [s]."""


def make_study(data: Path, out: Path, seconds: float) -> Study:
    """Make the study of TIAGo's arm.

    Raises:
        ExperimentError: the files cannot be used.
    """
    position = read_table(data / POSITION, len(JOINTS) + 1)
    current = read_table(data / CURRENT, len(JOINTS) + 1)
    spec = read_model(data / MODEL, JOINTS)
    use = (position[:, 0] >= BEGIN) & (position[:, 0] <= BEGIN + seconds)
    time = position[use, 0]
    column = {joint: k + 1 for k, joint in enumerate(JOINTS)}
    angles = {joint: position[use, k] for joint, k in column.items()}
    efforts = {
        joint: factor * np.interp(time, current[:, 0], current[:, column[joint]])
        for joint, factor in TORQUE_PER_AMPERE.items()
    }
    return effort_study("TIAGo arm", spec, out, time, angles, efforts)

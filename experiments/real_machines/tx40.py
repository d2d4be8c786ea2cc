"""Staubli TX40: reader of the log, and its study.

An industrial arm follows an exciting trajectory; angles and torques of its six motors were recorded
at 5 kHz. Source: the repository thanhndv212/figaroh-examples, folder examples/staubli_TX40; the
machine and its identified parameters are those of M. Gautier and S. Briot, "Global Identification
of Joint Drive Gains and Dynamic Parameters of Robots", J. Dyn. Syst. Meas. Control 136(5), 2014.
The user provides the folder; nothing of it is in this package.

The nominal model is the URDF of that folder, without friction and rotors. The motors of joints 5
and 6 are coupled: the sixth one moves by the sum of both angles, and its torque acts on both.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from experiments.real_machines.efforts import effort_study, read_table
from experiments.real_machines.models import read_model
from reality_gap import Study

FOLDER = "tx40"
"""Folder of the log and of the model in the user's data."""
POSITION, TORQUE = f"{FOLDER}/data/pos_read_data.csv", f"{FOLDER}/data/curr_data.csv"
MODEL = f"{FOLDER}/urdf/tx40_mdh_modified.urdf"
JOINTS = tuple(f"joint_{k}" for k in range(1, 7))
RATIOS = np.diag([32.0, 32.0, 45.0, -48.0, 45.0, 32.0])
"""Gear ratios without the coupling."""
ZERO = np.array([0.0, -np.pi / 2, np.pi / 2, 0.0, 0.0, 0.0])
"""Angles of the model where the motors' angles are 0 [rad]."""
STEP, THINNING = 2e-4, 5
"""Time between samples of the log [s]; samples that are averaged."""
MEASURED = JOINTS[:4]
"""Joints whose torque is compared; friction of the coupled wrist is that of a sum of speeds."""
PUBLISHED = {
    "damping": (8.05, 5.53, 1.97, 1.11),
    "friction": (7.14, 8.26, 6.34, 2.48),
    "armature": (0.362, 0.362, 0.0988, 0.0313),
    "offset": (0.392, 1.37, 0.326, -0.102),
}
"""The authors' viscous friction [N m s/rad], dry friction [N m], inertia of the rotors [kg m^2] and
offset of the torques [N m] of these joints."""


def make_study(data: Path, out: Path, seconds: float) -> Study:
    """Make the study of the TX40.

    Raises:
        ExperimentError: the files cannot be used.
    """
    motor = read_table(data / POSITION, len(JOINTS))
    torque = read_table(data / TORQUE, len(JOINTS))
    spec = read_model(data / MODEL, JOINTS)
    count = min(len(motor), len(torque), round(seconds / STEP)) // THINNING
    motor, torque = (
        part[: count * THINNING].reshape(count, THINNING, -1).mean(axis=1)
        for part in (motor, torque)
    )
    gears, pull = RATIOS.copy(), RATIOS.copy()
    gears[5, 4] = pull[4, 5] = RATIOS[5, 5]
    angle = np.linalg.solve(gears, motor.T).T + ZERO
    effort = torque @ pull.T
    time = STEP * THINNING * np.arange(count, dtype=float)
    angles = {joint: angle[:, k] for k, joint in enumerate(JOINTS)}
    efforts = {joint: effort[:, k] for k, joint in enumerate(MEASURED)}
    return effort_study("Staubli TX40", spec, out, time, angles, efforts)

"""Two-link arm: reader of the log, and its study.

A planar arm with two geared motors hangs in its vertical plane and follows a trajectory; angles and
motor commands were recorded at 100 Hz. Source: the repository lvjonok/mujoco-sysid, commit cc768d5,
folder data/trajectories/two_link (L. Kozlov and S. Nedelchev). The user provides the folder;
nothing of it is in this package.

The nominal model has the lengths, masses, centres and inertias of the authors' ``_model.py``, and
their 400 units of the command per N m.
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from experiments.harness.errors import ExperimentError
from experiments.real_machines.efforts import effort_study, read_table
from reality_gap import Study

FOLDER = "two_link"
"""Folder of the log in the user's data."""
LOG = f"{FOLDER}/two_link_observer_05_norm.csv"
COLUMNS = 7
"""Time [s]; angle [rad] and speed [rad/s] of each joint; command of each motor [units]."""
UNITS_PER_TORQUE = 400.0
"""Command of a motor [units/(N m)]."""
BEGIN, STEP = 5.0, 0.01
"""Start of the part that is used, and its time step [s]."""
MODEL = """<mujoco model="two-link arm">
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 -1 0"/>
      <inertial pos="0.144 0 0" mass="0.91" diaginertia="0.0001 0.012 0.012"/>
      <body name="lower" pos="0.327 0 0">
        <joint name="elbow" axis="0 -1 0"/>
        <inertial pos="0.1 0 0" mass="0.19" diaginertia="0.00002 0.0009 0.0009"/>
        <site name="tip" pos="0.2 0 0"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
"""MJCF of the nominal model; both links are horizontal at zero."""


def make_study(data: Path, out: Path, seconds: float) -> Study:
    """Make the study of the two-link arm; the elbow is measured from the horizontal, too.

    Raises:
        ExperimentError: the file cannot be used.
    """
    table = read_table(data / LOG, COLUMNS, delimiter=None, head=0)
    end = min(BEGIN + seconds, table[-1, 0])
    if np.any(np.diff(table[:, 0]) <= 0) or end - BEGIN < 1.0:
        raise ExperimentError(
            f"{data / LOG} ends at {table[-1, 0]:g} s, or its times do not rise; "
            f"{BEGIN + 1.0:g} s are needed."
        )
    time = np.arange(BEGIN, end, STEP)
    shoulder, elbow, first, second = (
        np.interp(time, table[:, 0], table[:, column]) for column in (1, 3, 5, 6)
    )
    angles = {"shoulder": shoulder, "elbow": elbow - shoulder}
    efforts = {"shoulder": first / UNITS_PER_TORQUE, "elbow": second / UNITS_PER_TORQUE}
    return effort_study(
        "two-link arm", mujoco.MjSpec.from_string(MODEL), out, time, angles, efforts
    )

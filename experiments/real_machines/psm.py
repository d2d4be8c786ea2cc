"""dVRK patient side manipulator with a weight: reader of the logs, and its study.

The arm of a da Vinci Research Kit follows one exciting trajectory without and with weights of 105 g
and 205 g at its parallelogram; positions, speeds and efforts of seven joints were recorded at
200 Hz. Source: the repository WPI-AIM/dvrk_dynamics_identification, folder
data/psm/measured_trajectory (Y. Wang, R. Gondokaryono, A. Munawar and G. S. Fischer, "A Convex
Optimization-Based Dynamic Model Identification Package for the da Vinci Research Kit", IEEE RA-L
4(4):3657-3664, 2019). The user provides the folder; nothing of it is in this package.

No nominal model is published that MuJoCo can load. `MODEL` is a chain of yaw, pitch and insertion
that was fitted to the run without a weight: an equivalent of parallelogram, springs, counterweight
and instrument, not the mass of any part. It leaves 0.18 N m, 0.21 N m and 0.23 N there. What is
wrong with it in the run with a weight is the weight, and what it leaves without one.
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from experiments.real_machines.efforts import effort_study, read_table
from reality_gap import Study

FOLDER = "psm"
"""Folder of the log in the user's data."""
LOG = f"{FOLDER}/one_205_grams_parallel_results.csv"
JOINTS = ("yaw", "pitch", "insertion")
"""Joints that are used, in the order of the columns."""
COLUMNS, FIRST_EFFORT = 21, 14
"""Positions, speeds and efforts of seven joints; column of the first effort."""
RATE, BEGIN = 200.0, 5.0
"""Sampling rate [Hz], and start of the part that is used [s]."""
MODEL = """<mujoco model="dVRK PSM">
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody>
    <body name="base_link">
      <joint name="yaw" axis="1 0 0" damping="0.049" frictionloss="0.116" stiffness="0.307"
             springref="0.164"/>
      <inertial pos="0.020 -0.028 0.053" mass="2.33" diaginertia="0.0181 0.0291 0.0291"/>
      <body name="arm">
        <joint name="pitch" axis="0 1 0" damping="0.090" frictionloss="0.183" stiffness="0.336"
               springref="0.580" armature="0.063"/>
        <inertial pos="-0.007 0.038 0.008" mass="1.03" diaginertia="0.119 0.116 0.0152"/>
        <body name="tool">
          <joint name="insertion" type="slide" axis="0 0 -1" damping="0.49" frictionloss="0.56"
                 stiffness="0.30" springref="-0.48" armature="0.72"/>
          <inertial pos="0.31 0.26 0.091" mass="0.021" diaginertia="0.0040 0.0039 0.0034"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
"""MJCF of the chain without a weight."""


def make_study(data: Path, out: Path, seconds: float) -> Study:
    """Make the study of the run with 205 g.

    Raises:
        ExperimentError: the file cannot be used.
    """
    table = read_table(data / LOG, COLUMNS, head=0)
    part = table[round(BEGIN * RATE) : round((BEGIN + seconds) * RATE)]
    time = np.arange(len(part)) / RATE
    angles = {joint: part[:, k] for k, joint in enumerate(JOINTS)}
    efforts = {joint: part[:, FIRST_EFFORT + k] for k, joint in enumerate(JOINTS)}
    spec = mujoco.MjSpec.from_string(MODEL)
    return effort_study("dVRK PSM with 205 g", spec, out, time, angles, efforts)

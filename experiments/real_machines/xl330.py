"""XL330 pendulum: reader of the logs, and the study that it writes.

A Dynamixel XL330-M288 servo holds a mass on a rod and follows trajectories with a proportional gain
of its firmware. Source: M. Duclusaud, G. Passault et al., "Extended Friction Models for the Physics
Simulation of Servo Actuators" (BAM), arXiv 2410.08650, Apache-2.0. The user provides the data; none
are in this package.

The nominal model is what the data sheet and the manual say. The firmware turns an error of one
count (2 pi / 4096) into ``kp`` / 128 steps of a pulse width of 885 steps; with the supply voltage
U, torque constant k and resistance R, the servo has the stiffness

    kp / 128 * 4096 / (2 pi) / 885 * U k / R

and the damping k^2 / R by its back EMF. The servo has neither friction nor rotor inertia, and the
mass is a point.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from experiments.harness.errors import ExperimentError
from jmm_agent.types import Floats
from mjcf_sandbox.files import write_text
from reality_gap import Study, load_study

FOLDER = "bam_xl330"
"""Folder of the logs in the user's data."""
KEYS = ("mass", "length", "kp", "vin", "trajectory", "entries")
FIELDS = ("timestamp", "goal_position", "position", "torque_enable")

COUNTS, PULSE_STEPS, MANUAL_DIVISOR = 4096, 885, 128
"""Counts of the encoder per turn, steps of the pulse width, divisor of the gain in the manual."""
STALL_TORQUE, STALL_CURRENT, STALL_VOLTAGE = 0.52, 1.47, 5.0
"""Data sheet of the motor at a standstill [N m, A, V]."""
CONSTANT, RESISTANCE = STALL_TORQUE / STALL_CURRENT, STALL_VOLTAGE / STALL_CURRENT
"""Torque constant [N m/A] and resistance [Ohm] that follow from it."""
AUTHORS_DIVISOR, AUTHORS_CONSTANT, AUTHORS_RESISTANCE = 256, 0.37005, 3.49835
"""Divisor of the gain that the authors observed, and their torque constant [N m/A] and resistance
[Ohm]."""
PUBLISHED = {
    "gain": MANUAL_DIVISOR
    / AUTHORS_DIVISOR
    * (AUTHORS_CONSTANT / AUTHORS_RESISTANCE)
    / (CONSTANT / RESISTANCE)
    - 1.0,
    "damping": 0.005902 + AUTHORS_CONSTANT**2 / AUTHORS_RESISTANCE - CONSTANT**2 / RESISTANCE,
    "friction": 0.018212,
    "armature": 0.0019898,
    "bias": -0.0017672,
}
"""The authors' model M1 of viscous and dry friction, relative to the nominal model: gain [1],
damping [N m s/rad], friction [N m], armature [kg m^2] and zero of the encoder [rad]."""
STEP = 0.002
"""Time step of the model [s]."""
LEAST = 100
"""Least number of rows of a log."""


@dataclass(frozen=True)
class Log:
    """One run.

    Attributes:
        trajectory: its name.
        mass, length: of the pendulum [kg, m].
        kp: proportional gain in units of the firmware.
        volts: supply voltage [V].
        rows: time [s], goal and position [rad], shape (n, 3).
        powered: whether the servo holds the pendulum throughout.
    """

    trajectory: str
    mass: float
    length: float
    kp: float
    volts: float
    rows: Floats
    powered: bool


def read_log(path: Path) -> Log:
    """Read one run.

    Raises:
        ExperimentError: the file is not such a run.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        mass, length, kp, volts = (float(content[key]) for key in KEYS[:4])
        entries = content["entries"]
        rows = np.array([[float(entry[key]) for key in FIELDS[:3]] for entry in entries])
        powered = all(entry["torque_enable"] for entry in entries)
    except (OSError, ValueError, TypeError, KeyError) as error:
        reason = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise ExperimentError(
            f"{path} cannot be read as a run of the XL330 pendulum: {reason}; a run has "
            f"{', '.join(KEYS)}, and each entry {', '.join(FIELDS)}."
        ) from error
    if len(rows) < LEAST or not np.all(np.isfinite(rows)) or np.any(np.diff(rows[:, 0]) <= 0):
        raise ExperimentError(
            f"{path} has {len(rows)} entries; a run has at least {LEAST}, with finite numbers and "
            "times that rise."
        )
    if not all(0.0 < size < np.inf for size in (mass, length, kp, volts)):
        raise ExperimentError(
            f"{path} has the mass {mass:g} kg, length {length:g} m, gain {kp:g} and voltage "
            f"{volts:g} V; all must be above 0 and finite."
        )
    rows[:, 0] -= rows[0, 0]
    return Log(str(content["trajectory"]), mass, length, kp, volts, rows, powered)


def read_logs(data: Path, kp: float) -> list[Log]:
    """Read the runs at one gain in which the servo is on throughout, in the order of their names.

    Args:
        data: the user's folder, with the folder `FOLDER`.
        kp: gain in units of the firmware.
    """
    logs = [read_log(path) for path in sorted((data / FOLDER).glob("*.json"))]
    return [log for log in logs if log.kp == kp and log.powered]


def stiffness(kp: float, volts: float, divisor: float = MANUAL_DIVISOR) -> float:
    """Stiffness of the servo [N m/rad]."""
    return kp / divisor * COUNTS / (2 * np.pi) / PULSE_STEPS * volts * CONSTANT / RESISTANCE


def model(log: Log) -> str:
    """MJCF of the nominal model."""
    limit = log.volts * CONSTANT / RESISTANCE
    return f"""<mujoco model="XL330 pendulum">
  <!-- A point mass on a rod, on the axis of a servo; gains from the manual and the data sheet. -->
  <option timestep="{STEP}" integrator="implicitfast"/>
  <worldbody>
    <body name="pendulum">
      <joint name="axis" axis="0 -1 0"/>
      <geom name="mass" type="sphere" size="0.001" pos="0 0 {-log.length}" mass="{log.mass}"
            contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <actuator>
    <position name="servo" joint="axis" kp="{stiffness(log.kp, log.volts):.6g}"
              kv="{CONSTANT**2 / RESISTANCE:.6g}" forcerange="{-limit:.6g} {limit:.6g}"/>
  </actuator>
  <sensor>
    <jointpos name="angle" joint="axis"/>
  </sensor>
</mujoco>
"""


def write_study(logs: Sequence[Log], folder: Path, seconds: float) -> Study:
    """Write model.xml, one CSV file a run and STUDY.yaml; load them.

    Args:
        logs: runs of the same pendulum.
        folder: where the files go.
        seconds: length of all runs together; each is cut to its share [s].
    """
    folder.mkdir(parents=True, exist_ok=True)
    episodes = []
    for number, log in enumerate(logs):
        rows = log.rows[log.rows[:, 0] <= seconds / len(logs)]
        name = f"{number}_{log.trajectory}.csv"
        lines = ["time,goal,position", *(f"{t:.6f},{g:.9g},{q:.9g}" for t, g, q in rows)]
        write_text(folder / name, "\n".join(lines) + "\n")
        episodes.append({"commands": name})
    study = {
        "name": f"XL330 pendulum, gain {logs[0].kp:g}",
        "model": "model.xml",
        "episodes": episodes,
        "time": {"column": "time", "unit": "s"},
        "actuators": {"servo": {"column": "goal", "unit": "rad"}},
        "sensors": {"angle": {"column": "position", "unit": "rad"}},
        "initial": {"joints": "first_reading", "settle": 0.0},
    }
    write_text(folder / "model.xml", model(logs[0]))
    write_text(folder / "STUDY.yaml", yaml.safe_dump(study, sort_keys=False))
    return load_study(folder / "STUDY.yaml")

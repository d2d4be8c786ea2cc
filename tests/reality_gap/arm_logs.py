"""An arm with two position servos, its motion, and logs of it in any layout."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from reality_gap.types import Floats

HEADER = "time,cmd_shoulder_pan,cmd_elbow_flex,q_shoulder_pan,q_elbow_flex"
"""Names of the columns of times, commands and angles."""
ARM = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002"/>
  <default>
    <joint axis="0 1 0" damping="0.3"/>
    <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="0.8"/>
  </default>
  <worldbody>
    <body name="upper">
      <joint name="shoulder_pan" range="-2 2"/><geom/>
      <body name="lower" pos="0.3 0 0"><joint name="elbow_flex" range="-2 2"/><geom/></body>
    </body>
  </worldbody>
  <actuator>
    <position joint="shoulder_pan" kp="60" kv="2"/>
    <position joint="elbow_flex" kp="30" kv="1"/>
  </actuator>
</mujoco>
"""


def write_arm(folder: Path) -> Path:
    """Write the model into a folder."""
    path = folder / "arm.xml"
    path.write_text(ARM)
    return path


def motion(phase: float = 0.0) -> tuple[Floats, Floats, Floats]:
    """Times (k,) [s], commands (k, 2) and angles (k, 2) [rad] of the arm."""
    simulated = mujoco.MjModel.from_xml_string(ARM)
    data = mujoco.MjData(simulated)
    time = 0.02 * np.arange(200)
    command = np.column_stack(
        [0.6 * np.sin(2.1 * time + phase), 0.5 * np.sin(3.3 * time + 1.0) - 0.4]
    )
    angles = np.zeros((len(time), 2))
    for row, target in zip(angles, command, strict=True):
        row[:] = data.qpos
        data.ctrl[:] = target
        mujoco.mj_step(simulated, data, 10)
    return time, command, angles + 1e-3 * np.random.default_rng(0).standard_normal(angles.shape)


def table(path: Path, header: str, *columns: Floats | list[str]) -> Path:
    """Write columns as CSV."""
    rows = zip(*columns, strict=True)
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n")
    return path

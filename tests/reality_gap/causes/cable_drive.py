"""Machines with a simulated spool that pulls a load by a cable that is a spring.

The model has neither the spring nor the friction of the motor, but a servo of the cable's length.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from reality_gap import load_study
from reality_gap.study.data import Study

LOAD = """<body name="load"><joint name="slide" type="slide" axis="1 0 0" damping="{damping}"
 stiffness="{spring}"/><geom size="0.01" mass="{mass}"/><site name="hook"/></body></worldbody>"""
PATH = """<site site="eye"/><site site="hook"/></spatial></tendon>"""
MACHINE = f"""<mujoco><option timestep="0.0001" integrator="implicitfast"/><worldbody>
<body name="motor" pos="-1 0 0"><joint name="spool" type="slide" axis="1 0 0" armature="{{spool}}"
 damping="{{motor}}" frictionloss="{{friction}}" solreffriction="0.0005 1"
 solimpfriction=".9999 .9999 .001 .5 2"/>
<geom size="0.01" mass="0.001"/><site name="eye"/></body>{LOAD}
<tendon><spatial name="cable" stiffness="{{cable}}" springlength="1">{PATH}
<actuator><position name="servo" joint="spool" kp="{{kp}}" kv="{{kv}}"/></actuator></mujoco>"""
MODEL = f"""<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody>
<site name="eye" pos="-1 0 0"/>{LOAD}<tendon><spatial name="cable" damping="{{motor}}">{PATH}
<actuator><general name="servo" tendon="cable" gainprm="{{gain}}" biastype="affine"
 biasprm="0 -{{kp}} -{{kv}}"/></actuator>
<sensor><actuatorfrc name="force" actuator="servo"/>
<jointpos name="position" joint="slide"/></sensor>
</mujoco>"""
STUDY = """name: cable
model: model.xml
episodes: [{{commands: log.csv}}]
time: {{column: time, unit: s}}
actuators: {{servo: {{column: command, unit: {unit}}}}}
sensors:
  force: {{column: force, unit: N, noise: {force}}}
  position: {{column: position, unit: m, noise: {position}}}
initial: {{settle: 1.0}}
"""


class Size(NamedTuple):
    """Sizes of a machine: largest pull [N], travel [m], friction over the pull."""

    pull: float
    travel: float
    friction: float

    @property
    def sizes(self) -> dict[str, float]:
        spring = self.pull / self.travel
        return {
            "spring": spring,
            "damping": 0.15 * spring,
            "mass": 1e-4 * spring,
            "spool": 2e-5 * spring,
            "kp": 50.0 * spring,
            "kv": 0.01 * spring,
            "motor": 0.0,
            "cable": 20.0 * spring,
            "friction": self.friction * self.pull,
        }


DRIVE, FINGER, WINCH = Size(80.0, 0.02, 0.12), Size(4.0, 0.008, 0.2), Size(2000.0, 0.3, 0.08)


def logged(
    folder: Path,
    size: Size,
    friction: float = 1.0,
    unit: float = 1.0,
    held: bool = False,
    **changed: float,
) -> Study:
    """Study of a machine that pulls to and fro for 6 s, with five commands for each reading.

    One of the commands is a length of ``unit`` [m]. A command that is held is followed by the next
    one at the next reading. ``changed`` replaces sizes of the machine and the model.
    """
    sizes = size.sizes | changed
    machine = MACHINE.format(**sizes | {"friction": friction * sizes["friction"]})
    model = mujoco.MjModel.from_xml_string(machine)
    data, rng = mujoco.MjData(model), np.random.default_rng(4)
    noise = {"force": 5e-3 * size.pull, "position": 1e-3 * size.travel}

    def command(t: float) -> float:
        t = 0.01 * np.floor(t / 0.01 + 1e-9) if held else t
        pulled = 0.5 + 0.35 * np.sin(2.1 * t - 1.5) + 0.12 * np.sin(5.3 * t)
        return -size.travel * float(pulled)

    data.ctrl[0] = command(0.0)
    mujoco.mj_step(model, data, 20_000)
    rows = []
    for k in range(3000):
        row = f"{0.002 * k:.9g},{(1.0 + command(0.002 * k)) / unit:.9g}"
        if k % 5 == 0:
            force = data.actuator_force[0] + noise["force"] * rng.standard_normal()
            position = data.joint("slide").qpos[0] + noise["position"] * rng.standard_normal()
            rows.append(f"{row},{force:.9g},{position:.9g}")
        else:
            rows.append(f"{row},,")
        for i in range(20):  # the drive goes on smoothly between two commands, unless one is held
            data.ctrl[0] = command(0.002 * k + 0.0001 * i)
            mujoco.mj_step(model, data)
    (folder / "log.csv").write_text("\n".join(["time,command,force,position", *rows]))
    (folder / "model.xml").write_text(MODEL.format(gain=unit * sizes["kp"], **sizes))
    (folder / "STUDY.yaml").write_text(STUDY.format(unit="m" if unit == 1.0 else "1", **noise))
    return load_study(folder / "STUDY.yaml")

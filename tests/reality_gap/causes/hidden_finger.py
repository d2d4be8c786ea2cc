"""A finger that a servo flexes by a tendon, whose real machine is simulated here.

No code of the package is used: plain MuJoCo steps a motor at the tendon at 0.5 ms, and the servo is
computed in Python; an effect replaces one method of `Finger`. Readings are taken half a period
after commands.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

from reality_gap.study.data import Channel, Episode, Initial, Reading, Study

MODEL = """
<mujoco>
  <option timestep="0.002" integrator="implicitfast"/>
  <default>
    <joint axis="0 1 0" armature="2e-4" damping="0.01" stiffness="0.3"/>
    <geom type="capsule" size="0.008" contype="0" conaffinity="0"/>
  </default>
  <worldbody>
    <site name="palm" pos="-0.02 0 -0.012"/>
    <body name="proximal">
      <joint name="mcp"/>
      <geom fromto="0 0 0 0.05 0 0" mass="0.05"/>
      <site name="first" pos="0.02 0 -0.012"/><site name="second" pos="0.04 0 -0.011"/>
      <body name="distal" pos="0.05 0 0">
        <joint name="pip"/>
        <geom fromto="0 0 0 0.04 0 0" mass="0.03"/>
        <site name="end" pos="0.015 0 -0.01"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <spatial name="flexor"><site site="palm"/><site site="first"/><site site="second"/>
      <site site="end"/></spatial>
  </tendon>
  <actuator>{actuator}</actuator>
  <sensor>
    <tendonpos name="length" tendon="flexor"/>
    <jointpos name="mcp" joint="mcp"/><jointpos name="pip" joint="pip"/>
    {sensor}
  </sensor>
</mujoco>
"""
KP, KD, LIMIT = 6000.0, 60.0, 40.0
STEP, PERIOD, SETTLE, REST = 5e-4, 0.02, 1.0, 0.0865
NOISE = {"length": 2e-5, "mcp": 1e-3, "pip": 1e-3, "pull": 0.2}
SERVO = (
    f'<general name="winch" tendon="flexor" gainprm="{KP}" biastype="affine" '
    f'biasprm="0 -{KP} -{KD}" forcelimited="true" forcerange="-{LIMIT} 0"/>'
)


@dataclass
class Finger:
    """The real machine; its methods are those of the nominal one.

    Attributes:
        seconds: length of the log [s].
        memory: state of an effect.
    """

    seconds: float = 6.0
    memory: dict[str, float] = field(default_factory=dict)

    def command(self, time: float) -> float:
        """The logged command: a length of the tendon [m], with steps and waves."""
        t = max(0.0, time)
        step = 0.006 * (t % 0.7 > 0.35)
        return REST - 0.006 + min(1.0, t) * 0.002 * np.sin(5.1 * t) - step

    def force(self, error: float, speed: float, target: float) -> float:
        """Force of the servo [N]."""
        return KP * error - KD * speed

    def least(self, speed: float) -> float:
        """Limit of the force by which the motor pulls [N]."""
        return -LIMIT


@dataclass
class SlowWinch(Finger):
    """The set point moves at 15 mm/s at most."""

    def force(self, error: float, speed: float, target: float) -> float:
        """The error from the set point, which follows the target."""
        here = self.memory.setdefault("point", target)
        most = 0.015 * STEP
        point = here + min(max(target - here, -most), most)
        self.memory["point"] = point
        return super().force(error + point - target, speed, target)


@dataclass
class SoftWinch(Finger):
    """The position gain is 40 % lower."""

    def force(self, error: float, speed: float, target: float) -> float:
        """A part of the force by the error."""
        return super().force(0.6 * error, speed, target)


@dataclass
class DampedWinch(Finger):
    """The velocity gain is twice as large."""

    def force(self, error: float, speed: float, target: float) -> float:
        """More force against the speed."""
        return super().force(error, 2.0 * speed, target)


@dataclass
class DeadWinch(Finger):
    """Errors below 0.4 mm have no effect."""

    def force(self, error: float, speed: float, target: float) -> float:
        """The error less its part within the band."""
        return super().force(error - min(max(error, -4e-4), 4e-4), speed, target)


@dataclass
class WeakAtSpeed(Finger):
    """The motor pulls with less force the faster it winds, and with none at 0.15 m/s."""

    def least(self, speed: float) -> float:
        """The tendon gets shorter at a negative speed."""
        return -LIMIT * min(max(1.0 + speed / 0.15, 0.0), 1.0)


def make_study(machine: Finger, folder: Path, seed: int = 0) -> Study:
    """A log of a real machine, beside its nominal model."""
    path = folder / "finger.xml"
    path.write_text(
        MODEL.format(actuator=SERVO, sensor='<actuatorfrc name="pull" actuator="winch"/>')
    )
    rows = _simulated(machine)
    rng = np.random.default_rng(seed)
    channels, readings = [], []
    for (name, noise), values in zip(NOISE.items(), rows[:, 1:].T, strict=True):
        unit = {"length": "m", "pull": "N"}.get(name, "rad")
        channels.append(Channel(name, name, unit=unit, noise=noise))
        readings.append(Reading(rows[:, 0], values + noise * rng.normal(size=len(values))))
    times = np.arange(0.0, machine.seconds, PERIOD)
    commands = np.array([[machine.command(t)] for t in times])
    episode = Episode("flexing", times, commands, tuple(readings))
    return Study("finger", path, tuple(channels), (episode,), Initial(settle=SETTLE))


def _simulated(machine: Finger) -> np.ndarray:
    """Times, lengths, two angles and forces, shape (k, 5)."""
    text = MODEL.format(actuator='<motor name="winch" tendon="flexor"/>', sensor="")
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.timestep = STEP
    data, rows = mujoco.MjData(model), []
    every, settle = round(PERIOD / STEP), round(SETTLE / STEP)
    for k in range(-settle, round(machine.seconds / STEP)):
        if k % every == 0:
            target = machine.command(k * STEP)
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        length, speed = float(data.ten_length[0]), float(data.ten_velocity[0])
        wanted = machine.force(target - length, speed, target)
        data.ctrl[0] = min(max(wanted, machine.least(speed)), 0.0)
        if k >= 0 and k % every == every // 2:
            rows.append([k * STEP, length, *data.qpos, data.ctrl[0]])
        mujoco.mj_step(model, data)
    return np.array(rows)

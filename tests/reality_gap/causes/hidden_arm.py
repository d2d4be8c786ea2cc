"""A servo arm and a motor arm whose real machines are simulated here, without code of the package.

Each real machine steps MuJoCo's plain motors at 0.5 ms and computes drives, friction and readings
in Python; an effect replaces one method of `Machine`. Readings are taken half a period after
commands.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

from reality_gap.study.data import Channel, Episode, Initial, Reading, Study
from reality_gap.types import Floats

LINKS = """
<mujoco>
  <option timestep="0.002" integrator="implicitfast"/>
  <default><joint axis="0 1 0" armature="{rotor}" damping="0.3" {joint}/></default>
  <worldbody>
    <body name="upper">
      <joint name="shoulder"/>
      <geom type="capsule" size="0.03" fromto="0 0 0 0.3 0 0" mass="1.0"/>
      <body name="lower" pos="0.3 0 0">
        <joint name="elbow"/>
        <geom type="capsule" size="0.02" fromto="0 0 0 0.25 0 0" mass="0.5"/>
        {more}
      </body>
    </body>
  </worldbody>
  <actuator>{actuators}</actuator>
  <sensor>{sensors}</sensor>
</mujoco>
"""
FINGERTIP = """<body name="tip" pos="0.25 0 0"><joint name="tip" stiffness="0.2" damping="0.03"/>
<geom type="capsule" size="0.015" fromto="0 0 0 0.1 0 0" mass="0.1"/></body>"""
JOINTS = ("shoulder", "elbow")
KP, KD, LIMIT = np.array([60.0, 30.0]), np.array([3.0, 1.5]), np.array([25.0, 8.0])
ROTOR = 0.02
STEP, PERIOD, SETTLE = 5e-4, 0.02, 1.0
NOISE = {"at": 5e-4, "force": 0.02}


def model_text(motors: bool, tip: bool = False) -> str:
    """The nominal model, with torque motors at springy joints or with position servos."""
    limited = [f'forcerange="{-x} {x}" forcelimited="true"' for x in LIMIT]
    servos = [
        f'<position name="{j}" joint="{j}" kp="{p}" kv="{d}" {limit}/>'
        for j, p, d, limit in zip(JOINTS, KP, KD, limited, strict=True)
    ]
    plain = [
        f'<motor name="{j}" joint="{j}" {limit}/>' for j, limit in zip(JOINTS, limited, strict=True)
    ]
    read = (*JOINTS, "tip") if tip else JOINTS
    sensors = [f'<jointpos name="at_{j}" joint="{j}"/>' for j in read]
    if not motors:
        sensors += [f'<actuatorfrc name="force_{j}" actuator="{j}"/>' for j in JOINTS]
    return LINKS.format(
        rotor=ROTOR,
        joint='stiffness="20"' if motors else "",
        more=FINGERTIP if tip else "",
        actuators="".join(plain if motors else servos),
        sensors="".join(sensors),
    )


@dataclass
class Machine:
    """The real machine; its methods are those of the nominal one.

    Attributes:
        motors: whether it has torque motors instead of position servos.
        tip: whether a last joint without a motor follows.
        seconds: length of the log [s].
        rotors: joints whose rotors the machine moves itself.
        memory: state of an effect.
    """

    motors: bool = False
    tip: bool = False
    seconds: float = 8.0
    rotors: tuple[str, ...] = ()
    memory: dict[str, Floats] = field(default_factory=dict)

    def command(self, time: float) -> Floats:
        """The logged command, which is sampled each `PERIOD`."""
        t = max(0.0, time)
        wave = np.array([np.sin(2.1 * t) + 0.4 * np.sin(7.3 * t), np.sin(3.3 * t + 1.0)])
        wave = wave * min(1.0, t)
        return np.array([9.0, 3.0]) * wave if self.motors else np.array([0.5, 0.8]) * wave

    def target(self, command: Floats) -> Floats:
        """What the drives get of a command."""
        return command

    def encoder(self, q: Floats, force: Floats) -> Floats:
        """Readings of the encoders of driven joints, which the drives use, too."""
        return q[:2]

    def force(self, error: Floats, speed: Floats, target: Floats) -> Floats:
        """Force of the drives."""
        return target if self.motors else KP * error - KD * speed

    def clip(self, force: Floats, speed: Floats) -> Floats:
        """Force within the limits of the drives."""
        return np.clip(force, -LIMIT, LIMIT)

    def passive(self, q: Floats, v: Floats, force: Floats) -> Floats:
        """Further torques on all joints."""
        return np.zeros(len(q))

    def transmit(self, force: Floats) -> Floats:
        """Torques on the driven joints by the forces of the drives."""
        return force

    def log_time(self, time: Floats) -> Floats:
        """Time stamps of the readings."""
        return time


def make_study(machine: Machine, folder: Path, seed: int = 0) -> Study:
    """A log of a real machine, beside its nominal model."""
    path = folder / "arm.xml"
    path.write_text(model_text(machine.motors, machine.tip))
    times, rows = _simulated(machine)
    rng = np.random.default_rng(seed)
    names = [f"at_{j}" for j in (*JOINTS, *(("tip",) if machine.tip else ()))]
    if not machine.motors:
        names += [f"force_{j}" for j in JOINTS]
    noise = [NOISE[name.split("_")[0]] for name in names]
    values = rows[:, : len(names)] + rng.normal(size=(len(rows), len(names))) * noise
    channels = tuple(
        Channel(name, name, unit="rad" if name[0] == "a" else "N m", noise=size)
        for name, size in zip(names, noise, strict=True)
    )
    stamps = machine.log_time(times)
    kept = (stamps >= 0.0) & (stamps < machine.seconds)
    readings = tuple(Reading(stamps[kept], column[kept]) for column in values.T)
    command_times = np.arange(0.0, machine.seconds, PERIOD)
    commands = np.array([machine.command(t) for t in command_times])
    episode = Episode("waves", command_times, commands, readings)
    return Study("arm", path, channels, (episode,), Initial(settle=SETTLE))


def _simulated(machine: Machine) -> tuple[Floats, Floats]:
    """Times (k,), and positions of all joints and forces of the drives (k, ...)."""
    spec = mujoco.MjSpec.from_string(model_text(True, machine.tip))
    for element in (*spec.actuators, *spec.sensors):
        spec.delete(element)
    if not machine.motors:
        for j in JOINTS:
            spec.joint(j).stiffness = [0.0, 0.0, 0.0]
    for j in machine.rotors:
        spec.joint(j).armature = 0.0
    spec.option.timestep = STEP
    model = spec.compile()
    data, force, driven = mujoco.MjData(model), np.zeros(2), slice(0, 2)
    times, rows = [], []
    every, settle = round(PERIOD / STEP), round(SETTLE / STEP)
    for k in range(-settle, round(machine.seconds / STEP) + every):
        if k % every == 0:
            target = machine.target(machine.command(k * STEP))
        encoder = machine.encoder(data.qpos, force)
        if k >= 0 and k % every == every // 2:
            times.append(k * STEP)
            rows.append(np.concatenate([encoder, data.qpos[2:], force]))
        speed = data.qvel[driven]
        force = machine.clip(machine.force(target - encoder, speed, target), speed)
        torque = machine.passive(data.qpos, data.qvel, force)
        torque[driven] += machine.transmit(force)
        data.qfrc_applied[:] = torque
        mujoco.mj_step(model, data)
    return np.array(times), np.array(rows)

"""Plant: the real machine, which is the nominal one with mismatches and hidden effects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache

import mujoco
import numpy as np

from hidden_plants.strangers.drives import Law, tendon_lengths
from hidden_plants.strangers.mismatch import Mismatch, sites_of
from hidden_plants.strangers.stranger import Stranger
from hidden_plants.types import Floats

FINE = 2.5e-4
"""Usual physics step of a real machine [s]."""
UNFELT = 1e-12
"""Share of gravity that a compiled model has to compensate so that it can be changed later."""
BRISTLE = 2e-4
"""Travel over which dry friction builds up, over the travel of the joint or tendon."""


@dataclass
class State:
    """Signals of one physics step, which devices read and change.

    Attributes:
        data: MuJoCo's, with positions and velocities up to date.
        position, velocity: of what each drive moves (drives,).
        encoder: readings of its encoder, which the drive's law uses (drives,).
        command: of each drive in this step (drives,).
        force: of each drive (drives,); a pull of a tendon is negative. While encoder devices run,
            that of the previous step.
        pull: force behind the sensor of the force (drives,).
        torque: further forces on the joints (joints,).
        step: physics step [s].
        time: log time, episodes end to end [s]; constant while the machine settles.
    """

    data: mujoco.MjData
    position: Floats
    velocity: Floats
    encoder: Floats
    force: Floats
    pull: Floats
    torque: Floats
    step: float
    command: Floats
    time: float = 0.0


Device = Callable[[State], None]
DeviceFactory = Callable[[], Device]
Readings = dict[str, Floats]
ReadingEffect = Callable[[Readings, Floats], None]
"""Changes readings by the name of their sensor, at the log times (k,) [s]."""


@dataclass
class Plant:
    """Parameters and devices of a real machine; mechanisms modify them.

    Attributes:
        stranger: nominal machine.
        model: of the real machine, with a plain motor for each drive.
        step: physics step [s].
        law: of the drives.
        scale, offset: of the encoders (drives,): encoder = scale x + offset.
        force_scale, force_offset: of the drives (drives,).
        inner, outer: dry friction before and behind the sensor of a force (drives, 2), for positive
            and negative velocities.
        load_friction: dry friction behind it, over the force (drives,).
        joint_friction: dry friction of the joints (joints,).
        lag: time constant of each drive's force (drives,) [s].
        delay: of the commands (drives,) [s].
        bristle, joint_bristle: travels over which friction builds up (drives,), (joints,).
        reading_scale, reading_offset, reading_delay: of readings by sensor.
        compensates: whether the drives compensate gravity in part, by ``body_gravcomp``.
        drift: by how much the clock of the sensors is faster than that of the commands [1].
        encoder_devices: change the encoder readings.
        law_devices: change the forces by the drives' laws, before their limits.
        pull_devices: change the forces behind the sensors.
        body_devices: apply forces to bodies and joints.
        reading_effects: change all readings of an episode.
    """

    stranger: Stranger
    model: mujoco.MjModel
    step: float
    law: Law
    scale: Floats
    offset: Floats
    force_scale: Floats
    force_offset: Floats
    inner: Floats
    outer: Floats
    load_friction: Floats
    joint_friction: Floats
    lag: Floats
    delay: Floats
    bristle: Floats
    joint_bristle: Floats
    reading_scale: dict[str, float] = field(default_factory=dict)
    reading_offset: dict[str, float] = field(default_factory=dict)
    reading_delay: dict[str, float] = field(default_factory=dict)
    compensates: bool = False
    drift: float = 0.0
    encoder_devices: list[DeviceFactory] = field(default_factory=list)
    law_devices: list[DeviceFactory] = field(default_factory=list)
    pull_devices: list[DeviceFactory] = field(default_factory=list)
    body_devices: list[DeviceFactory] = field(default_factory=list)
    reading_effects: list[ReadingEffect] = field(default_factory=list)


def real_step(stranger: Stranger) -> float:
    """Physics step of the real machine [s]: at most a quarter of the model's, near `FINE`."""
    return min(0.25 * float(stranger.model.opt.timestep), FINE)


@lru_cache(maxsize=4)
def _bare(stranger: Stranger) -> mujoco.MjModel:
    """Model with plain motors in place of the drives; callers copy it."""
    spec = mujoco.MjSpec.from_string(stranger.xml)
    for element in [*spec.sensors, *spec.actuators]:
        spec.delete(element)
    kinds = mujoco.mjtTrn
    kind = kinds.mjTRN_TENDON if stranger.routes else kinds.mjTRN_JOINT
    for name in stranger.moved:
        motor = spec.add_actuator(name=f"m_{name}", trntype=kind, target=name)
        motor.gear[:] = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        motor.gaintype, motor.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_NONE
        motor.gainprm[:], motor.biasprm[:], motor.dynprm[:] = 0.0, 0.0, 0.0
        motor.gainprm[0] = 1.0
        motor.dyntype = mujoco.mjtDyn.mjDYN_NONE
        motor.ctrllimited = motor.forcelimited = mujoco.mjtLimited.mjLIMITED_FALSE
    for link in stranger.skeleton.links if stranger.traits.kind == "servos" else ():
        spec.body(link.body).gravcomp = UNFELT
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    return spec.compile()


def assemble(stranger: Stranger, mismatch: Mismatch, step: float) -> Plant:
    """Build the real machine without hidden effects."""
    model = _bare(stranger).__copy__()
    model.opt.timestep = step
    _change_model(stranger, model, mismatch)
    law, count = stranger.law, len(stranger.moved)
    if len(mismatch.gain):
        law = replace(
            law,
            gain=law.gain * (1.0 + mismatch.gain),
            position=law.position * (1.0 + mismatch.gain),
        )
    if len(mismatch.rate_gain):
        law = replace(law, rate=law.rate * (1.0 + mismatch.rate_gain))
    limit = np.maximum(np.abs(law.low), np.abs(law.high))
    travel = travels(stranger)
    outer = np.repeat((mismatch.outer_friction * limit)[:, None], 2, axis=1)
    inner = np.zeros((count, 2))
    if len(mismatch.inner_friction):
        inner += (mismatch.inner_friction * limit)[:, None]
    plant = Plant(
        stranger=stranger,
        model=model,
        step=step,
        law=law,
        scale=np.ones(count),
        offset=mismatch.zero * travel + _zero_shift(stranger, model),
        force_scale=np.ones(count),
        force_offset=np.zeros(count),
        inner=inner,
        outer=outer,
        load_friction=np.zeros(count),
        joint_friction=np.zeros(model.nv),
        lag=np.zeros(count),
        delay=np.zeros(count),
        bristle=BRISTLE * travel,
        joint_bristle=BRISTLE * stranger.travel,
    )
    for sensor in stranger.sensors:
        if sensor.kind in ("force", "effort"):
            i = sensor.index
            plant.reading_scale[sensor.name] = 1.0 + float(mismatch.force_scale[i])
            plant.reading_offset[sensor.name] = float(mismatch.force_zero[i] * limit[i])
    return plant


def _change_model(stranger: Stranger, model: mujoco.MjModel, mismatch: Mismatch) -> None:
    for link in stranger.skeleton.links:
        body, i = model.body(link.body).id, link.index
        model.body_mass[body] *= 1.0 + mismatch.mass[i]
        model.body_inertia[body] *= 1.0 + mismatch.mass[i]
        model.body_ipos[body] += mismatch.centre[i] * link.length
        for other in range(model.nbody):
            if model.body_parentid[other] == body:
                model.body_pos[other, 0] += mismatch.length[i] * link.length
    model.dof_armature[:] *= 1.0 + mismatch.armature
    model.dof_damping[:] *= (1.0 + mismatch.damping).reshape(model.dof_damping.shape)
    if len(mismatch.friction):
        model.dof_frictionloss[:] *= 1.0 + mismatch.friction
    if len(mismatch.stiffness):
        model.jnt_stiffness[:] *= (1.0 + mismatch.stiffness).reshape(model.jnt_stiffness.shape)
    shortest = min(link.length for link in stranger.skeleton.links)
    for name, shift in zip(sites_of(stranger), mismatch.site, strict=True):
        model.site_pos[model.site(name).id] += shift * shortest


def travels(stranger: Stranger) -> Floats:
    """Travel of what each drive moves (drives,) [rad or m]."""
    if not stranger.routes:
        return stranger.travel
    postures = np.vstack([p.at(np.arange(0.0, p.duration, 0.1)) for p in stranger.paths])
    return np.ptp(tendon_lengths(stranger.model, postures), axis=0)


def _zero_shift(stranger: Stranger, model: mujoco.MjModel) -> Floats:
    """Shift of tendon encoders, which read the nominal lengths at ``qpos0`` (drives,) [m]."""
    if not stranger.routes:
        return np.zeros(len(stranger.moved))
    zero = np.array(model.qpos0)[None]
    return (tendon_lengths(stranger.model, zero) - tendon_lengths(model, zero))[0]

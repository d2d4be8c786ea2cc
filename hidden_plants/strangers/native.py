"""Quick simulation of a machine with mismatches by MuJoCo's own drives and friction.

It serves for differences between machines that deviate in a mismatch only: dry friction is
MuJoCo's, and forces are those of the drives.
"""

from __future__ import annotations

from functools import lru_cache

import mujoco
import numpy as np
from mujoco import rollout

from hidden_plants.strangers.loop import controlled, mean_commands
from hidden_plants.strangers.mismatch import Mismatch
from hidden_plants.strangers.plant import assemble
from hidden_plants.strangers.readings import reading_times
from hidden_plants.strangers.stranger import SETTLE, Stranger
from hidden_plants.types import Floats


@lru_cache(maxsize=2)
def _driven(stranger: Stranger) -> mujoco.MjModel:
    """Model with the drives as affine actuators, and one more motor for each; callers copy it."""
    spec = mujoco.MjSpec.from_string(stranger.xml)
    for element in [*spec.sensors, *spec.actuators]:
        spec.delete(element)
    kinds = mujoco.mjtTrn
    kind = kinds.mjTRN_TENDON if stranger.routes else kinds.mjTRN_JOINT
    for prefix in ("m", "added"):
        for name in stranger.moved:
            motor = spec.add_actuator(name=f"{prefix}_{name}", trntype=kind, target=name)
            motor.gear[:] = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
            motor.gaintype = mujoco.mjtGain.mjGAIN_FIXED
            motor.biastype = mujoco.mjtBias.mjBIAS_AFFINE
            motor.gainprm[:], motor.biasprm[:] = 0.0, 0.0
            motor.gainprm[0], motor.dyntype = 1.0, mujoco.mjtDyn.mjDYN_NONE
            motor.ctrllimited = motor.forcelimited = mujoco.mjtLimited.mjLIMITED_FALSE
    names = (stranger.actuators, stranger.moved, stranger.joints)
    position = mujoco.mjtSensor.mjSENS_JOINTPOS
    objects = mujoco.mjtObj
    own = (mujoco.mjtSensor.mjSENS_TENDONPOS, objects.mjOBJ_TENDON)
    kinds_of = (
        (mujoco.mjtSensor.mjSENS_ACTUATORFRC, objects.mjOBJ_ACTUATOR),
        own if stranger.routes else (position, objects.mjOBJ_JOINT),
        (mujoco.mjtSensor.mjSENS_JOINTVEL, objects.mjOBJ_JOINT),
    )
    for block, (sensor, on) in zip(names, kinds_of, strict=True):
        for name in block:
            spec.add_sensor(type=sensor, objtype=on, objname=name)
    if stranger.traits.kind == "efforts":
        for name in stranger.joints:
            spec.add_sensor(
                type=mujoco.mjtSensor.mjSENS_ACTUATORFRC,
                objtype=objects.mjOBJ_ACTUATOR,
                objname=f"added_{name}",
            )
    return spec.compile()


def whitened_natively(stranger: Stranger, mismatch: Mismatch, step: float) -> Floats:
    """Simulate all episodes; returns all readings over their standard deviations (k,)."""
    plant = assemble(stranger, mismatch, step)
    model = _with_numbers(stranger, plant.model)
    count, law = len(stranger.moved), plant.law
    model.opt.timestep = step
    model.actuator_gainprm[:count, 0] = law.gain
    model.actuator_biasprm[:count, 0] = law.bias + law.position * plant.offset
    model.actuator_biasprm[:count, 1] = law.position
    model.actuator_biasprm[:count, 2] = law.rate
    model.actuator_forcelimited[:count] = stranger.traits.kind != "efforts"
    model.actuator_forcerange[:count, 0], model.actuator_forcerange[:count, 1] = law.low, law.high
    model.actuator_gainprm[count:, 0] = 1.0
    friction = plant.outer[:, 0] + plant.inner[:, 0]
    if stranger.routes:
        model.tendon_frictionloss[:] += friction
    else:
        model.dof_frictionloss[:] += friction
    mujoco.mj_setConst(model, mujoco.MjData(model))
    rows = []
    for k in range(len(stranger.paths)):
        forces, moved, velocity, added = _episode(stranger, model, k, step)
        friction_read = plant.inner[:, 0] * np.sign(
            _moved_velocity(stranger, moved, velocity, step)
        )
        force = forces + added - friction_read
        signals = {"force": force, "effort": force, "velocity": velocity}
        signals |= {"position": moved + plant.offset, "length": moved + plant.offset}
        time = step * np.arange(len(moved))
        when = reading_times(stranger, k, 0.0)
        for sensor in stranger.sensors:
            values = np.interp(when, time, signals[sensor.kind][:, sensor.index])
            values = values * plant.reading_scale.get(sensor.name, 1.0)
            values = values + plant.reading_offset.get(sensor.name, 0.0)
            rows.append(values / sensor.deviation)
    return np.concatenate(rows)


def _moved_velocity(stranger: Stranger, moved: Floats, velocity: Floats, step: float) -> Floats:
    """Velocity of what each drive moves (k, drives)."""
    found: Floats = np.gradient(moved, step, axis=0) if stranger.routes else velocity
    return found


def _with_numbers(stranger: Stranger, plain: mujoco.MjModel) -> mujoco.MjModel:
    """Copy of the driven model with the bodies, joints and sites of a plain one."""
    model = _driven(stranger).__copy__()
    for name in ("body_mass", "body_inertia", "body_ipos", "body_pos", "site_pos"):
        getattr(model, name)[:] = getattr(plain, name)
    for name in ("dof_armature", "dof_damping", "dof_frictionloss", "jnt_stiffness"):
        getattr(model, name)[:] = getattr(plain, name)
    return model


def _episode(
    stranger: Stranger, model: mujoco.MjModel, episode: int, step: float
) -> tuple[Floats, Floats, Floats, Floats]:
    """Forces, positions of what is moved, joint velocities and added forces, each (k, ...)."""
    count, joints = len(stranger.moved), model.nv
    control = _control(stranger, model, episode, step)
    data = mujoco.MjData(model)
    data.qpos[:] = stranger.paths[episode].home
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    first = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, first, kind)
    _, sensors = rollout.rollout(model, data, first[None], control[None])
    kept = sensors[0][round(SETTLE / step) :]
    ends = np.cumsum([count, count, joints])
    force, moved, velocity, added = np.split(kept, ends, axis=1)
    return force, moved, velocity, added if added.shape[1] else 0.0 * force


def _control(stranger: Stranger, model: mujoco.MjModel, episode: int, step: float) -> Floats:
    """Controls of each physics step, settling included (steps, 2 drives)."""
    path, (time, command) = stranger.paths[episode], stranger.commands[episode]
    count = len(stranger.moved)
    steps = round((SETTLE + path.duration) / step) + 2
    begin = step * np.arange(steps, dtype=np.float64) - SETTLE
    if stranger.traits.kind == "efforts":
        return np.hstack(controlled(stranger, episode, begin + 0.5 * step))
    plan = mean_commands(begin, step, time, command, np.zeros(count))
    return np.hstack([plan, np.zeros((len(begin), count))])

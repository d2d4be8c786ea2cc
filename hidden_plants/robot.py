"""Robot: the nominal model with mismatches and hidden effects, ready for simulation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import mujoco
import numpy as np

from hidden_plants.machine import BIAS, CUT, MARKER, STIFFNESS, Machine
from hidden_plants.nuisance import Mismatch
from hidden_plants.secret import Effect
from hidden_plants.types import Floats

STEP = 0.0005
"""Physics step [s], a quarter of the nominal model's step."""


@dataclass
class State:
    """Signals that the devices of a robot read and change at one physics step.

    Attributes:
        model, data: MuJoCo's; positions and velocities are up to date.
        length, velocity: of the tendons' paths (tendons,) [m], [m/s].
        encoder: encoder readings, the controller's input (tendons,) [m].
        motor: tension at the motor (tendons,) [N]; while encoder devices run, the tension of the
            previous step.
        pull: tension at the bone (tendons,) [N].
        step: physics step [s].
        time: time since the first command of the episode [s], negative while the robot settles.
        log_time: time since the first command of the first episode [s], episodes end to end; it
            is constant while the robot settles.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    length: Floats
    velocity: Floats
    encoder: Floats
    motor: Floats
    pull: Floats
    step: float
    time: float = 0.0
    log_time: float = 0.0


Reshape = Callable[[mujoco.MjSpec, Effect], None]
Device = Callable[[State], None]
DeviceFactory = Callable[[], Device]
Readings = dict[str, Floats]
SensorEffect = Callable[[Readings, "Robot"], None]


@dataclass
class Robot:
    """Parameters and devices of the simulated robot; mechanisms modify them.

    Attributes:
        machine: nominal model.
        model: model of the robot.
        scale, offset: of the encoders (tendons,) [1], [m]:
            encoder = scale * (length - length at zero) + nominal length at zero + offset.
        stiffness, bias, cut: of the motor law (tendons,) [N/m], [N], [N].
        gain, force_offset: tension = gain * commanded tension + offset (tendons,) [1], [N].
        friction_out, friction_in: dry friction of a tendon that lengthens or shortens
            (tendons,) [N].
        load_friction: dry friction per tension (tendons,) [1].
        tension_scale, tension_offset: of the tension readings (tendons,) [1], [N].
        command_delay: delay of the commands (tendons,) [s].
        step: physics step [s].
        sensor_delay: delay of readings by sensor name [s].
        encoder_devices: change the encoder readings. This list and the next three hold factories
            that make one device for each episode; the devices run at each physics step.
        motor_devices: change the tension at the motor.
        pull_devices: change the tension at the bone.
        body_devices: apply forces to bodies and torques to joints.
        sensor_effects: change all readings of an episode after its simulation.
    """

    machine: Machine
    model: mujoco.MjModel
    scale: Floats
    offset: Floats
    stiffness: Floats
    bias: Floats
    cut: Floats
    gain: Floats
    force_offset: Floats
    friction_out: Floats
    friction_in: Floats
    load_friction: Floats
    tension_scale: Floats
    tension_offset: Floats
    command_delay: Floats
    step: float = STEP
    sensor_delay: dict[str, float] = field(default_factory=dict)
    encoder_devices: list[DeviceFactory] = field(default_factory=list)
    motor_devices: list[DeviceFactory] = field(default_factory=list)
    pull_devices: list[DeviceFactory] = field(default_factory=list)
    body_devices: list[DeviceFactory] = field(default_factory=list)
    sensor_effects: list[SensorEffect] = field(default_factory=list)

    def tendon(self, name: str) -> int:
        """Index of a tendon."""
        return self.machine.tendons.index(name)

    def zero_lengths(self) -> Floats:
        """Path lengths of the robot at ``qpos0``, where the encoders are zeroed (tendons,) [m]."""
        return path_lengths(self.model, self.model.qpos0)


def path_lengths(model: mujoco.MjModel, qpos: Floats) -> Floats:
    """Lengths of the tendons' paths at joint positions ``qpos`` (tendons,) [m]."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_fwdPosition(model, data)
    return np.array(data.ten_length)


def bare_spec(machine: Machine, reshape: Sequence[tuple[Reshape, Effect]] = ()) -> mujoco.MjSpec:
    """Spec of the nominal model with plain motors and without sensors.

    It has this module's physics step and an implicit integrator.

    Args:
        machine: nominal model.
        reshape: edits of the spec with their effects, applied in order before motors are added.
    """
    spec = machine.spec()
    for element in [*spec.sensors, *spec.actuators]:
        spec.delete(element)
    for edit, effect in reshape:
        edit(spec, effect)
    for tendon in machine.tendons:
        motor = spec.add_actuator(name=tendon, trntype=mujoco.mjtTrn.mjTRN_TENDON, target=tendon)
        motor.gainprm[0] = -1.0
    spec.option.timestep = STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICIT
    return spec


@lru_cache(maxsize=4)
def bare_model(machine: Machine) -> mujoco.MjModel:
    """The compiled `bare_spec`; callers must not modify it."""
    return bare_spec(machine).compile()


def assemble(
    machine: Machine, model: mujoco.MjModel, mismatch: Mismatch, step: float = STEP
) -> Robot:
    """Build a robot with mismatches and without effects; modifies ``model``."""
    model.opt.timestep = step
    for name, factor in zip(machine.bodies, mismatch.mass, strict=True):
        body = model.body(name).id
        model.body_mass[body] *= 1.0 + factor
        model.body_inertia[body] *= 1.0 + factor
    for name, shift in zip(machine.sites, mismatch.site, strict=True):
        model.site_pos[model.site(name).id] += shift
    model.dof_damping[:] *= 1.0 + mismatch.damping
    model.site_pos[model.site(MARKER).id] += mismatch.marker_shift
    move_camera(model, machine.camera, mismatch.camera_shift, mismatch.camera_turn)
    count = len(machine.tendons)
    return Robot(
        machine=machine,
        model=model,
        scale=np.ones(count),
        offset=mismatch.encoder_offset.copy(),
        stiffness=np.full(count, STIFFNESS),
        bias=np.full(count, BIAS),
        cut=np.full(count, CUT),
        gain=1.0 + mismatch.gain,
        force_offset=np.zeros(count),
        friction_out=mismatch.friction.copy(),
        friction_in=mismatch.friction.copy(),
        load_friction=np.zeros(count),
        tension_scale=np.ones(count),
        tension_offset=mismatch.tension_offset.copy(),
        command_delay=np.zeros(count),
        step=step,
    )


def move_camera(model: mujoco.MjModel, camera: str, shift: Floats, turn: Floats) -> None:
    """Shift a camera in the frame of its body [m] and turn it about its own axes [rad]."""
    index = model.camera(camera).id
    model.cam_pos[index] += shift
    angle = float(np.linalg.norm(turn))
    if angle > 0.0:
        quat, turned = np.zeros(4), np.zeros(4)
        mujoco.mju_axisAngle2Quat(quat, turn / angle, angle)
        mujoco.mju_mulQuat(turned, model.cam_quat[index], quat)
        model.cam_quat[index] = turned

"""A real machine: the drawing with mismatches and hidden effects, ready to be run."""

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
"""Physics step [s], a quarter of the drawing's."""


@dataclass
class State:
    """What the devices of a machine share at one physics step.

    Attributes:
        model, data: of MuJoCo; positions and velocities are up to date.
        time: since the episode's first command [s], negative while it settles.
        log_time: since the first command of the first episode [s], episodes end to end; it stands
            still while the machine settles.
        length, velocity: of the wires' paths (wires,) [m], [m/s].
        encoder: what the controller is told (wires,) [m].
        motor: tension at the motor (wires,) [N]; that of the step before while ``encode`` runs.
        pull: what pulls at the bone (wires,) [N].
        step: of the physics [s].
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
Maker = Callable[[], Device]
Readings = dict[str, Floats]
ReadingEffect = Callable[[Readings, "Robot"], None]


@dataclass
class Robot:
    """A machine under construction; mechanisms write into it.

    Attributes:
        machine: the drawing.
        model: the true machine.
        scale, offset: encoder = scale * (length - at zero) + length of the drawing at zero +
            offset (wires,) [1], [m].
        stiffness, bias, cut: of the motor law (wires,).
        gain, force_offset: real tension = gain * asked + offset (wires,) [1], [N].
        friction_out, friction_in: dry friction of a wire that lengthens, shortens (wires,) [N].
        load_friction: dry friction per tension (wires,) [1].
        tension_scale, tension_offset: of the tension's reading (wires,) [1], [N].
        command_delay: of every wire's commands (wires,) [s].
        step: of the physics [s].
        sensor_delay: by the name of a sensor [s].
        encode, drive, tug, body: makers of devices, one device for each episode: they change what
            the encoder reads, what the motor gives, what pulls at the bone, and act on the bones.
        senses: change the readings of an episode, after it.
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
    encode: list[Maker] = field(default_factory=list)
    drive: list[Maker] = field(default_factory=list)
    tug: list[Maker] = field(default_factory=list)
    body: list[Maker] = field(default_factory=list)
    senses: list[ReadingEffect] = field(default_factory=list)

    def tendon(self, name: str) -> int:
        """Index of a wire."""
        return self.machine.tendons.index(name)

    def zero_lengths(self) -> Floats:
        """Lengths of the true paths where the encoders were zeroed, at ``qpos0`` (wires,) [m]."""
        return path_lengths(self.model, self.model.qpos0)


def path_lengths(model: mujoco.MjModel, qpos: Floats) -> Floats:
    """True lengths of the wires' paths at a posture (wires,) [m]."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_fwdPosition(model, data)
    return np.array(data.ten_length)


def bare_spec(machine: Machine, reshape: Sequence[tuple[Reshape, Effect]] = ()) -> mujoco.MjSpec:
    """The drawing with plain motors, this package's step and integrator, and no sensors.

    ``reshape`` are applied in order while it has no actuators.
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
    """`bare_spec`, compiled; read-only by agreement."""
    return bare_spec(machine).compile()


def assemble(machine: Machine, model: mujoco.MjModel, slip: Mismatch, step: float = STEP) -> Robot:
    """A robot with mismatches and no effects; ``model`` is written into."""
    model.opt.timestep = step
    for name, factor in zip(machine.bodies, slip.mass, strict=True):
        body = model.body(name).id
        model.body_mass[body] *= 1.0 + factor
        model.body_inertia[body] *= 1.0 + factor
    for name, shift in zip(machine.sites, slip.site, strict=True):
        model.site_pos[model.site(name).id] += shift
    model.dof_damping[:] *= 1.0 + slip.damping
    model.site_pos[model.site(MARKER).id] += slip.marker_shift
    move_camera(model, machine.camera, slip.camera_shift, slip.camera_turn)
    count = len(machine.tendons)
    return Robot(
        machine=machine,
        model=model,
        scale=np.ones(count),
        offset=slip.encoder_offset.copy(),
        stiffness=np.full(count, STIFFNESS),
        bias=np.full(count, BIAS),
        cut=np.full(count, CUT),
        gain=1.0 + slip.gain,
        force_offset=np.zeros(count),
        friction_out=slip.friction.copy(),
        friction_in=slip.friction.copy(),
        load_friction=np.zeros(count),
        tension_scale=np.ones(count),
        tension_offset=slip.tension_offset.copy(),
        command_delay=np.zeros(count),
        step=step,
    )


def move_camera(model: mujoco.MjModel, camera: str, shift: Floats, turn: Floats) -> None:
    """Shift the camera in its body's frame [m] and turn it about its own axes [rad]."""
    index = model.camera(camera).id
    model.cam_pos[index] += shift
    angle = float(np.linalg.norm(turn))
    if angle > 0.0:
        quat, turned = np.zeros(4), np.zeros(4)
        mujoco.mju_axisAngle2Quat(quat, turn / angle, angle)
        mujoco.mju_mulQuat(turned, model.cam_quat[index], quat)
        model.cam_quat[index] = turned

"""Nominal model of the robot as an MJCF model of its own: tendons, motors, and a sensor for each
reading of the agent."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from kengoro_env.departures.camera import EYE
from kengoro_env.robot.draft import Draft
from kengoro_env.robot.fingers import FINGERS, add_fingers
from kengoro_env.robot.model_file import load_spec
from kengoro_env.robot.motor_gains import gains_of
from kengoro_env.robot.muscle_law import Gains
from kengoro_env.robot.tendons import wind

MARKER = "marker_hand"
MARKER_POSITION, MARKER_ORIENTATION = "marker_position", "marker_orientation"
"""Sensors of the hand's marker in the camera frame, which has MuJoCo's axes: z backwards."""


def length_sensor(muscle: str) -> str:
    """Name of the sensor of a tendon's length along its whole path [m]."""
    return f"length_{muscle}"


def tension_sensor(muscle: str) -> str:
    """Name of the sensor of a motor's force [N], which is negative when the motor pulls."""
    return f"tension_{muscle}"


def study_model(
    scene: Path,
    gains: Gains | None = None,
    folders: Sequence[Path | str] = (),
    fingers: bool = False,
) -> mujoco.MjSpec:
    """Model that `Robot` simulates without departures, with sensors and without textures.

    Actuators and tendons have the names of the muscles. The motor of the fingers, which has no
    command in a study, is replaced by a spring that keeps them open, unless it is asked for.

    Args:
        scene: MJCF file of the robot and its surroundings.
        gains: of the muscle stiffness control; those of `gains_of` if left out.
        folders: further folders whose files the model may include or load.
        fingers: whether the fingers have their motor, as ``Kengoro/CanGrasp-v0`` needs it.

    Returns:
        The compiled spec.
    """
    gains = gains_of(scene, folders).gains if gains is None else gains
    draft = Draft.of(load_spec(scene, folders))
    wind(draft, gains.damping)
    spec = draft.spec
    for muscle in draft.tendons:
        _set_gains(spec.actuator(muscle), gains)
        _add_sensor(spec, length_sensor(muscle), mujoco.mjtSensor.mjSENS_TENDONPOS, muscle)
        _add_sensor(spec, tension_sensor(muscle), mujoco.mjtSensor.mjSENS_ACTUATORFRC, muscle)
    if spec.camera(EYE) is not None and spec.site(MARKER) is not None:
        for name, kind in (
            (MARKER_POSITION, mujoco.mjtSensor.mjSENS_FRAMEPOS),
            (MARKER_ORIENTATION, mujoco.mjtSensor.mjSENS_FRAMEQUAT),
        ):
            sensor = _add_sensor(spec, name, kind, MARKER)
            sensor.reftype, sensor.refname = mujoco.mjtObj.mjOBJ_CAMERA, EYE
    add_fingers(spec)
    if not fingers:
        _keep_fingers_open(spec)
    _remove_pictures(spec)
    spec.compile()
    return spec


def _set_gains(motor: mujoco.MjsActuator, gains: Gains) -> None:
    """T = bias + stiffness (l - l_target), cut at bias and limit; a tendon pulls with -T."""
    motor.gainprm[0] = gains.stiffness
    motor.biasprm[:2] = (-gains.bias, -gains.stiffness)
    motor.forcerange = np.array([-gains.limit, -gains.bias])


_KINDS = {
    mujoco.mjtSensor.mjSENS_TENDONPOS: mujoco.mjtObj.mjOBJ_TENDON,
    mujoco.mjtSensor.mjSENS_ACTUATORFRC: mujoco.mjtObj.mjOBJ_ACTUATOR,
    mujoco.mjtSensor.mjSENS_FRAMEPOS: mujoco.mjtObj.mjOBJ_SITE,
    mujoco.mjtSensor.mjSENS_FRAMEQUAT: mujoco.mjtObj.mjOBJ_SITE,
}


def _add_sensor(
    spec: mujoco.MjSpec, name: str, kind: mujoco.mjtSensor, element: str
) -> mujoco.MjsSensor:
    return spec.add_sensor(name=name, type=kind, objtype=_KINDS[kind], objname=element)


def _keep_fingers_open(spec: mujoco.MjSpec) -> None:
    motor = spec.actuator(FINGERS)
    if motor is None:
        return
    coupling = spec.tendon(FINGERS)
    coupling.stiffness = np.array([-motor.biasprm[1], 0.0, 0.0])
    coupling.springlength = np.zeros(2)
    spec.delete(motor)


def _remove_pictures(spec: mujoco.MjSpec) -> None:
    """Drop materials, textures and meshes that are only seen: the model needs no file of theirs."""
    for geom in list(spec.geoms):
        if geom.meshname and geom.mass == 0.0 and not (geom.contype or geom.conaffinity):
            spec.delete(geom)
    used = {geom.meshname for geom in spec.geoms}
    for mesh in list(spec.meshes):
        if mesh.name not in used:
            spec.delete(mesh)
    for geom in spec.geoms:
        geom.material = ""
    for element in [*spec.materials, *spec.textures]:
        spec.delete(element)
    spec.compiler.texturedir = ""


def zero_lengths(spec: mujoco.MjSpec, muscles: Sequence[str]) -> NDArray[np.float64]:
    """Tendon lengths in the zero posture of a spec, shape (m,) [m]."""
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return np.array([data.tendon(muscle).length[0] for muscle in muscles])

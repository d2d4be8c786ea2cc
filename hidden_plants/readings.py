"""What the sensors of a machine read, from what really happened."""

from __future__ import annotations

import mujoco
import numpy as np

from hidden_plants.loop import Trace
from hidden_plants.machine import MARKER
from hidden_plants.nuisance import Nuisance
from hidden_plants.robot import Readings, Robot
from hidden_plants.types import Floats

CAMERA_SENSORS = ("marker_position", "marker_orientation")


def clean_readings(robot: Robot, trace: Trace, time: Floats, camera_time: Floats) -> Readings:
    """Every sensor without noise: of wires at ``time`` (n,) [s], of the camera at its own (m,).

    Names are those of the drawing's sensors; lengths [m] and tensions [N] have shape (n,),
    ``marker_position`` (m, 3) [m] and ``marker_orientation`` (m, 4), both in the camera's frame.
    Tensions are positive.
    """
    readings: Readings = {}
    for i, tendon in enumerate(robot.machine.tendons):
        length, tension = f"length_{tendon}", f"tension_{tendon}"
        readings[length] = _late(robot, trace, trace.encoder[:, i], length, time)
        felt = _late(robot, trace, trace.tension[:, i], tension, time)
        readings[tension] = robot.tension_scale[i] * felt + robot.tension_offset[i]
    for name in CAMERA_SENSORS:
        late = camera_time - robot.sensor_delay.get(name, 0.0)
        poses = marker_poses(robot, postures(trace, late))
        readings[name] = poses[:, :3] if name == "marker_position" else poses[:, 3:]
    for sense in robot.senses:
        sense(readings, robot)
    return readings


def postures(trace: Trace, time: Floats) -> Floats:
    """Joint positions at ``time`` (n,) [s]: (n, joints) [rad]."""
    columns = [np.interp(time, trace.time, column) for column in trace.qpos.T]
    return np.stack(columns, axis=1)


def _late(robot: Robot, trace: Trace, signal: Floats, sensor: str, time: Floats) -> Floats:
    """A signal at ``time`` (n,), read just before a command given at that time takes effect."""
    place = (time - robot.sensor_delay.get(sensor, 0.0)) / (trace.time[1] - trace.time[0])
    last = np.clip(np.ceil(place - 1e-6).astype(int) - 1, 1, len(signal) - 1)
    return signal[last] + (place - last) * (signal[last] - signal[last - 1])


def marker_poses(robot: Robot, qpos: Floats) -> Floats:
    """Position [m] and quaternion of the marker in the camera's frame (n, 7)."""
    model, data = robot.model, mujoco.MjData(robot.model)
    camera, site = model.camera(robot.machine.camera).id, model.site(MARKER).id
    body = int(model.site_bodyid[site])
    poses = np.empty((len(qpos), 7))
    eye, marker = np.zeros(4), np.zeros(4)
    for pose, posture in zip(poses, qpos, strict=True):
        data.qpos[:] = posture
        mujoco.mj_kinematics(model, data)
        mujoco.mj_camlight(model, data)
        frame = data.cam_xmat[camera].reshape(3, 3)
        pose[:3] = frame.T @ (data.site_xpos[site] - data.cam_xpos[camera])
        mujoco.mju_mulQuat(eye, data.xquat[int(model.cam_bodyid[camera])], model.cam_quat[camera])
        mujoco.mju_negQuat(eye, eye)
        mujoco.mju_mulQuat(marker, data.xquat[body], model.site_quat[site])
        mujoco.mju_mulQuat(pose[3:], eye, marker)
    return poses


def noisy_readings(clean: Readings, nuisance: Nuisance, rng: np.random.Generator) -> Readings:
    """The readings with the noise of their sensors."""
    noisy = {}
    for name, values in clean.items():
        if name == "marker_orientation":
            noisy[name] = _turned(values, nuisance.marker_turn_noise, rng)
        else:
            deviation = (
                nuisance.marker_noise
                if name == "marker_position"
                else nuisance.encoder_noise
                if name.startswith("length")
                else nuisance.tension_noise
            )
            noisy[name] = values + deviation * rng.standard_normal(values.shape)
    return noisy


def _turned(quats: Floats, deviation: float, rng: np.random.Generator) -> Floats:
    """Quaternions (n, 4), each turned by a random small angle about a random axis."""
    turned = np.empty_like(quats)
    step = np.zeros(4)
    for row, quat in zip(turned, quats, strict=True):
        turn = deviation * rng.standard_normal(3)
        angle = float(np.linalg.norm(turn))
        axis = turn / angle if angle > 0.0 else np.array([1.0, 0.0, 0.0])
        mujoco.mju_axisAngle2Quat(step, axis, angle)
        mujoco.mju_mulQuat(row, quat, step)
    return turned

"""Sensor readings of an episode, computed from its true signals."""

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
    """Compute the readings of all sensors without noise.

    Args:
        robot: the robot that performed the episode.
        trace: its true signals.
        time: sampling instants of lengths and tensions (n,) [s].
        camera_time: sampling instants of the camera (m,) [s].

    Returns:
        Readings by the sensor names of the nominal model: lengths (n,) [m], tensions (n,) [N],
        which are positive, and the marker's pose in the camera's frame, ``marker_position`` (m, 3)
        [m] and ``marker_orientation`` (m, 4), a quaternion w, x, y, z.
    """
    readings: Readings = {}
    for i, tendon in enumerate(robot.machine.tendons):
        length, tension = f"length_{tendon}", f"tension_{tendon}"
        readings[length] = _delayed(robot, trace, trace.encoder[:, i], length, time)
        true = _delayed(robot, trace, trace.tension[:, i], tension, time)
        readings[tension] = robot.tension_scale[i] * true + robot.tension_offset[i]
    for name in CAMERA_SENSORS:
        exposure = camera_time - robot.sensor_delay.get(name, 0.0)
        poses = marker_poses(robot, postures(trace, exposure))
        readings[name] = poses[:, :3] if name == "marker_position" else poses[:, 3:]
    for change in robot.sensor_effects:
        change(readings, robot)
    return readings


def postures(trace: Trace, time: Floats) -> Floats:
    """Interpolate joint positions (n, joints) [rad] at ``time`` (n,) [s]."""
    columns = [np.interp(time, trace.time, column) for column in trace.qpos.T]
    return np.stack(columns, axis=1)


def _delayed(robot: Robot, trace: Trace, signal: Floats, sensor: str, time: Floats) -> Floats:
    """Value of a signal at ``time`` (n,) minus the sensor's delay.

    It extrapolates from the two samples before, so that a command at the same instant has no
    effect yet.
    """
    position = (time - robot.sensor_delay.get(sensor, 0.0)) / (trace.time[1] - trace.time[0])
    last = np.clip(np.ceil(position - 1e-6).astype(int) - 1, 1, len(signal) - 1)
    return signal[last] + (position - last) * (signal[last] - signal[last - 1])


def marker_poses(robot: Robot, qpos: Floats) -> Floats:
    """Position [m] and quaternion of the marker in the camera's frame (n, 7).

    Args:
        robot: with its true camera and marker.
        qpos: joint positions (n, joints) [rad].
    """
    model, data = robot.model, mujoco.MjData(robot.model)
    camera, site = model.camera(robot.machine.camera).id, model.site(MARKER).id
    body = int(model.site_bodyid[site])
    poses = np.empty((len(qpos), 7))
    mounting, marker = np.zeros(4), np.zeros(4)
    for pose, posture in zip(poses, qpos, strict=True):
        data.qpos[:] = posture
        mujoco.mj_kinematics(model, data)
        mujoco.mj_camlight(model, data)
        frame = data.cam_xmat[camera].reshape(3, 3)
        pose[:3] = frame.T @ (data.site_xpos[site] - data.cam_xpos[camera])
        camera_body = data.xquat[int(model.cam_bodyid[camera])]
        mujoco.mju_mulQuat(mounting, camera_body, model.cam_quat[camera])
        mujoco.mju_negQuat(mounting, mounting)
        mujoco.mju_mulQuat(marker, data.xquat[body], model.site_quat[site])
        mujoco.mju_mulQuat(pose[3:], mounting, marker)
    return poses


def noisy_readings(clean: Readings, nuisance: Nuisance, rng: np.random.Generator) -> Readings:
    """Add the sensors' noise to clean readings."""
    noisy = {}
    for name, values in clean.items():
        deviation = noise_of(name, nuisance)
        if name == "marker_orientation":
            noisy[name] = _turned(values, deviation, rng)
        else:
            noisy[name] = values + deviation * rng.standard_normal(values.shape)
    return noisy


def noise_of(sensor: str, nuisance: Nuisance) -> float:
    """Standard deviation of a sensor's noise [m], [N] or, for the orientation, [rad]."""
    if sensor == "marker_orientation":
        return nuisance.marker_turn_noise
    if sensor == "marker_position":
        return nuisance.marker_noise
    return nuisance.encoder_noise if sensor.startswith("length") else nuisance.tension_noise


def _turned(quats: Floats, deviation: float, rng: np.random.Generator) -> Floats:
    """Turn quaternions (n, 4) by random small rotation vectors."""
    turned = np.empty_like(quats)
    step = np.zeros(4)
    for row, quat in zip(turned, quats, strict=True):
        turn = deviation * rng.standard_normal(3)
        angle = float(np.linalg.norm(turn))
        axis = turn / angle if angle > 0.0 else np.array([1.0, 0.0, 0.0])
        mujoco.mju_axisAngle2Quat(step, axis, angle)
        mujoco.mju_mulQuat(row, quat, step)
    return turned

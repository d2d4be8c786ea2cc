"""What a log of torques shows: nothing is simulated there, and positions are inputs with noise.

A detector has the torques and the positions, but not what the machine was told to do. All that it
can compare is the torques with those of the nominal model for the measured motion. The noise of
positions enters these through accelerations, and grows with the square of the frequency.
"""

from __future__ import annotations

import mujoco
import numpy as np
import scipy.signal
from scipy.fft import dct
from scipy.interpolate import CubicSpline

from hidden_plants.strangers.stranger import Stranger
from hidden_plants.types import Floats

ENDS = 0.1
"""Share of an episode at each end in which readings fade, because no others lie beyond them."""


def seen_torques(stranger: Stranger, readings: Floats) -> Floats:
    """Measured torques minus those of the nominal model, over their standard deviations.

    They are given by their frequencies (an orthonormal cosine transform of each episode), at which
    the noise is independent.

    Args:
        stranger: a machine with a log of torques.
        readings: all readings over their standard deviations, by episode and sensor (k,).

    Returns:
        By episode and joint, shape (m,).
    """
    rows, start = [], 0
    for time, _ in stranger.commands:
        found = {}
        for sensor in stranger.sensors:
            values = readings[start : start + len(time)] * sensor.deviation
            found[sensor.kind, sensor.index] = values
            start += len(time)
        rows.append(_of_episode(stranger, time, found))
    return np.concatenate(rows)


def _of_episode(
    stranger: Stranger, time: Floats, readings: dict[tuple[str, int], Floats]
) -> Floats:
    model, joints = _frictionless(stranger), range(len(stranger.joints))
    position = CubicSpline(time, np.stack([readings["position", j] for j in joints], axis=1))
    motion = [position(time, order) for order in range(3)]
    data, torque = mujoco.MjData(model), np.empty((len(time), model.nv))
    inertia = np.zeros((model.nv, model.nv))
    for k, (data.qpos[:], data.qvel[:], data.qacc[:]) in enumerate(zip(*motion, strict=True)):
        mujoco.mj_inverse(model, data)
        torque[k] = data.qfrc_inverse
    mujoco.mj_fullM(model, data, inertia)
    noise = {(s.kind, s.index): s.deviation for s in stranger.sensors}
    angular = np.pi * np.arange(len(time)) / (len(time) * float(np.mean(np.diff(time))))
    taper = scipy.signal.windows.tukey(len(time), 2.0 * ENDS) ** 2
    found = []
    for j in joints:
        accelerated = sum((inertia[j, i] * noise["position", i]) ** 2 for i in joints)
        deviation = np.sqrt(noise["effort", j] ** 2 + accelerated * angular**4)
        found.append(dct(taper * (readings["effort", j] - torque[:, j]), norm="ortho") / deviation)
    return np.concatenate(found)


def _frictionless(stranger: Stranger) -> mujoco.MjModel:
    """The nominal model without dry friction, which is the same in all machines."""
    model = stranger.model.__copy__()
    model.dof_frictionloss[:] = 0.0
    return model

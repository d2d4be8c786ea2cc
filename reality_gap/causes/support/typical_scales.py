"""Typical scales of forces, velocities and positions, from which causes derive their parameters."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np

from reality_gap.causes.base import Location
from reality_gap.study.data import Channel, Reading
from reality_gap.study.system import System

TENDON_SPEED = 0.1
"""Typical velocity of a tendon [m/s]."""

SPEED_PERIOD = 0.02
"""Interval over which a measured velocity is averaged [s]."""


def joint_force(system: System, location: Location) -> tuple[str, float]:
    """Return unit and typical size of a joint's force: RMS of its effort, or 10 N or N m."""
    joint = location.elements[0]
    efforts = [
        np.sqrt(np.mean(reading.value**2))
        for channel, reading in _readings(system)
        if channel.kind == "effort" and channel.sensor == joint
    ]
    size = max(efforts, default=0.0)
    return ("N" if _slides(system, joint) else "N m"), float(size) or 10.0


def joint_speed(system: System, location: Location) -> float:
    """Return the typical velocity of a joint: the measured RMS, or else 0.1 m/s or 1 rad/s."""
    squares = []
    for reading in _positions(system, location.elements[0]):
        period = (reading.time[-1] - reading.time[0]) / (len(reading.time) - 1)
        stride = max(1, round(SPEED_PERIOD / period))
        time, value = reading.time[::stride], reading.value[::stride]
        squares.append(np.mean((np.diff(value) / np.diff(time)) ** 2))
    speed = float(np.sqrt(np.mean(squares))) if squares else 0.0
    return speed or (0.1 if _slides(system, location.elements[0]) else 1.0)


def joint_damping(system: System, location: Location) -> tuple[str, float]:
    """Return unit and size of the damping that gives a joint's typical force at its speed."""
    unit, force = joint_force(system, location)
    per = "s/m" if _slides(system, location.elements[0]) else "s/rad"
    return f"{unit} {per}", force / joint_speed(system, location)


def joint_travel(system: System, location: Location) -> tuple[str, float]:
    """Return unit and typical size of a joint's motion: the measured one, or 0.1 m or 1 rad."""
    joint = location.elements[0]
    travels = [float(np.ptp(reading.value)) for reading in _positions(system, joint)]
    slides = _slides(system, joint)
    return ("m" if slides else "rad"), max(travels, default=0.0) or (0.1 if slides else 1.0)


def actuator_force(system: System, location: Location) -> tuple[str, float]:
    """Return unit and typical size of an actuator's force.

    The size is half of the actuator's limit, but at most 100. Without a limit it is 100 N for an
    actuator of a tendon, and 10 N or N m for others.
    """
    actuator = system.model.actuator(location.elements[0])
    if any(tendon.actuator == actuator.name for tendon in system.tendons):
        unit, size = "N", 100.0
    else:
        joint = int(actuator.trntype[0]) == int(mujoco.mjtTrn.mjTRN_JOINT)
        on = system.model.joint(int(actuator.trnid[0])).name if joint else ""
        unit, size = ("N" if on and _slides(system, on) else "N m"), 10.0
    if actuator.forcelimited[0]:
        size = min(100.0, 0.5 * float(np.max(np.abs(actuator.forcerange))))
    return unit, size


def tendon_force(system: System, location: Location) -> float:
    """Return the typical force of the weakest of a location's tendons [N]."""
    actuators = [
        Location("actuator", (system.tendon(name).actuator,)) for name in location.elements
    ]
    return min(actuator_force(system, actuator)[1] for actuator in actuators)


def _slides(system: System, joint: str) -> bool:
    return int(system.model.joint(joint).type[0]) == int(mujoco.mjtJoint.mjJNT_SLIDE)


def _readings(system: System) -> Iterator[tuple[Channel, Reading]]:
    for episode in system.study.episodes:
        yield from zip(system.study.channels, episode.readings, strict=True)


def _positions(system: System, joint: str) -> list[Reading]:
    """Return the measured positions of a joint in each episode."""
    model, id_ = system.model, system.model.joint(joint).id
    kind = int(mujoco.mjtSensor.mjSENS_JOINTPOS)
    return [
        reading
        for channel, reading in _readings(system)
        if channel.kind == "sensor"
        and int(model.sensor(channel.sensor).type[0]) == kind
        and int(model.sensor(channel.sensor).objid[0]) == id_
        and len(reading.time) > 1
    ]

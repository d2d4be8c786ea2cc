"""Typical sizes of what happens at joints and actuators: the yardsticks of causes' parameters."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np

from reality_gap.causes.base import Location
from reality_gap.study.data import Channel, Reading
from reality_gap.study.system import System

TENDON_SPEED = 0.1
"""Typical velocity of a wire [m/s]."""

SPEED_PERIOD = 0.02
"""Over which a measured velocity is averaged [s]."""


def _slides(system: System, joint: str) -> bool:
    return int(system.model.joint(joint).type[0]) == int(mujoco.mjtJoint.mjJNT_SLIDE)


def joint_force(system: System, location: Location) -> tuple[str, float]:
    """Unit and typical size of a joint's force: its measured effort's, or 10."""
    joint = location.elements[0]
    efforts = [
        np.sqrt(np.mean(reading.value**2))
        for channel, reading in _readings(system)
        if channel.kind == "effort" and channel.sensor == joint
    ]
    size = max(efforts, default=0.0)
    return ("N" if _slides(system, joint) else "N m"), float(size) or 10.0


def joint_speed(system: System, location: Location) -> float:
    """Typical velocity of a joint: as measured by a jointpos sensor, or 0.1 m/s or 1 rad/s."""
    squares = []
    for reading in _positions(system, location.elements[0]):
        period = (reading.time[-1] - reading.time[0]) / (len(reading.time) - 1)
        stride = max(1, round(SPEED_PERIOD / period))
        time, value = reading.time[::stride], reading.value[::stride]
        squares.append(np.mean((np.diff(value) / np.diff(time)) ** 2))
    speed = float(np.sqrt(np.mean(squares))) if squares else 0.0
    return speed or (0.1 if _slides(system, location.elements[0]) else 1.0)


def joint_damping(system: System, location: Location) -> tuple[str, float]:
    """Unit and size of the viscous friction that takes a joint's typical force."""
    unit, force = joint_force(system, location)
    per = "s/m" if _slides(system, location.elements[0]) else "s/rad"
    return f"{unit} {per}", force / joint_speed(system, location)


def joint_travel(system: System, location: Location) -> tuple[str, float]:
    """Unit and typical size of a joint's motion: as measured, or 0.1 m or 1 rad."""
    joint = location.elements[0]
    travels = [float(np.ptp(reading.value)) for reading in _positions(system, joint)]
    slides = _slides(system, joint)
    return ("m" if slides else "rad"), max(travels, default=0.0) or (0.1 if slides else 1.0)


def actuator_force(system: System, location: Location) -> tuple[str, float]:
    """Unit and typical size of an actuator's force: half its limit, at most 100, or else 10."""
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
    """Typical size of the force of the weakest of a place's wires [N]."""
    actuators = [
        Location("actuator", (system.tendon(name).actuator,)) for name in location.elements
    ]
    return min(actuator_force(system, actuator)[1] for actuator in actuators)


def _readings(system: System) -> Iterator[tuple[Channel, Reading]]:
    for episode in system.study.episodes:
        yield from zip(system.study.channels, episode.readings, strict=True)


def _positions(system: System, joint: str) -> list[Reading]:
    """What jointpos sensors measured of a joint, in each episode where they did."""
    model, here = system.model, system.model.joint(joint).id
    kind = int(mujoco.mjtSensor.mjSENS_JOINTPOS)
    return [
        reading
        for channel, reading in _readings(system)
        if channel.kind == "sensor"
        and int(model.sensor(channel.sensor).type[0]) == kind
        and int(model.sensor(channel.sensor).objid[0]) == here
        and len(reading.time) > 1
    ]

"""Dimensions: SI units in which a sensor, actuator or joint of a model can be measured."""

from __future__ import annotations

import mujoco
from mujoco import mjtSensor as Kind

Units = tuple[str, ...]

_FORCES: Units = ("N", "N m")
_POSITIONS: Units = ("m", "rad")
_RATES: Units = ("m/s", "rad/s")

_FIXED: dict[int, Units] = {
    int(kind): (unit,)
    for kind, unit in {
        Kind.mjSENS_TOUCH: "N",
        Kind.mjSENS_ACCELEROMETER: "m/s^2",
        Kind.mjSENS_VELOCIMETER: "m/s",
        Kind.mjSENS_GYRO: "rad/s",
        Kind.mjSENS_FORCE: "N",
        Kind.mjSENS_TORQUE: "N m",
        Kind.mjSENS_RANGEFINDER: "m",
        Kind.mjSENS_CAMPROJECTION: "1",
        Kind.mjSENS_BALLQUAT: "1",
        Kind.mjSENS_BALLANGVEL: "rad/s",
        Kind.mjSENS_FRAMEPOS: "m",
        Kind.mjSENS_FRAMEQUAT: "1",
        Kind.mjSENS_FRAMEXAXIS: "1",
        Kind.mjSENS_FRAMEYAXIS: "1",
        Kind.mjSENS_FRAMEZAXIS: "1",
        Kind.mjSENS_FRAMELINVEL: "m/s",
        Kind.mjSENS_FRAMEANGVEL: "rad/s",
        Kind.mjSENS_FRAMELINACC: "m/s^2",
        Kind.mjSENS_FRAMEANGACC: "rad/s^2",
        Kind.mjSENS_SUBTREECOM: "m",
        Kind.mjSENS_SUBTREELINVEL: "m/s",
        Kind.mjSENS_GEOMDIST: "m",
    }.items()
}

# Index into (position, rate, force) of what a sensor of a joint, tendon or actuator measures.
_OF_JOINT = {
    int(Kind.mjSENS_JOINTPOS): 0,
    int(Kind.mjSENS_JOINTVEL): 1,
    int(Kind.mjSENS_JOINTACTFRC): 2,
    int(Kind.mjSENS_JOINTLIMITPOS): 0,
    int(Kind.mjSENS_JOINTLIMITVEL): 1,
    int(Kind.mjSENS_JOINTLIMITFRC): 2,
}
_OF_TENDON = {
    int(Kind.mjSENS_TENDONPOS): 0,
    int(Kind.mjSENS_TENDONVEL): 1,
    int(Kind.mjSENS_TENDONACTFRC): 2,
    int(Kind.mjSENS_TENDONLIMITPOS): 0,
    int(Kind.mjSENS_TENDONLIMITVEL): 1,
    int(Kind.mjSENS_TENDONLIMITFRC): 2,
}
_OF_ACTUATOR = {
    int(Kind.mjSENS_ACTUATORPOS): 0,
    int(Kind.mjSENS_ACTUATORVEL): 1,
    int(Kind.mjSENS_ACTUATORFRC): 2,
}


def sensor_units(model: mujoco.MjModel, sensor: str) -> Units:
    """Return the SI units that the values of a sensor may have; empty if all are valid."""
    kind, target = int(model.sensor(sensor).type[0]), int(model.sensor(sensor).objid[0])
    if kind in _OF_JOINT:
        return _joint(model, target)[_OF_JOINT[kind]]
    if kind in _OF_TENDON:
        return _tendon(model, target)[_OF_TENDON[kind]]
    if kind in _OF_ACTUATOR:
        return _transmission(model, target)[_OF_ACTUATOR[kind]]
    return _FIXED.get(kind, ())


def joint_units(model: mujoco.MjModel, joint: str) -> tuple[str, str]:
    """Return the SI units of the position and of the force of a hinge or slide joint."""
    position, _, force = _joint(model, int(model.joint(joint).id))
    return position[0], force[0]


def actuator_units(model: mujoco.MjModel, actuator: str) -> Units:
    """Return the SI units that the command of an actuator may have; empty if all are valid.

    A servo, whose bias feeds back the position or the rate, is commanded in that unit; if it
    integrates its command, as `intvelocity` does, it is commanded in the rate of that unit. All
    other actuators are commanded in a force, volts, amperes or 1.
    """
    i = int(model.actuator(actuator).id)
    position, rate, force = _transmission(model, i)
    affine = int(model.actuator_biastype[i]) == int(mujoco.mjtBias.mjBIAS_AFFINE)
    gain = float(model.actuator_gainprm[i, 0])
    integrates = int(model.actuator_dyntype[i]) == int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
    commands: tuple[Units, Units] = (rate, ()) if integrates else (position, rate)
    for feedback, units in zip(model.actuator_biasprm[i, 1:3], commands, strict=True):
        if affine and feedback != 0.0 and gain == -feedback:
            return units
    if affine and model.actuator_biasprm[i, 1:3].any():
        return ()
    if int(model.actuator_gaintype[i]) != int(mujoco.mjtGain.mjGAIN_FIXED):
        return ()
    if integrates:
        return ()
    return (*force, "V", "A", "1")


def _joint(model: mujoco.MjModel, joint: int) -> tuple[Units, Units, Units]:
    if int(model.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_SLIDE):
        return ("m",), ("m/s",), ("N",)
    return ("rad",), ("rad/s",), ("N m",)


def _tendon(model: mujoco.MjModel, tendon: int) -> tuple[Units, Units, Units]:
    first = int(model.wrap_type[model.tendon_adr[tendon]])
    if first == int(mujoco.mjtWrap.mjWRAP_JOINT):
        return _POSITIONS, _RATES, _FORCES
    return ("m",), ("m/s",), ("N",)


def _transmission(model: mujoco.MjModel, actuator: int) -> tuple[Units, Units, Units]:
    """Return the units of position, rate and force; those of a gear may be of angle or length."""
    own = _direct(model, actuator)
    if abs(float(model.actuator_gear[actuator, 0])) == 1.0:
        return own
    position, rate, force = (
        (*some, *(unit for unit in both if unit not in some))
        for some, both in zip(own, (_POSITIONS, _RATES, _FORCES), strict=True)
    )
    return position, rate, force


def _direct(model: mujoco.MjModel, actuator: int) -> tuple[Units, Units, Units]:
    kind, target = int(model.actuator_trntype[actuator]), int(model.actuator_trnid[actuator, 0])
    joint = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
    if kind in joint:
        return _joint(model, target)
    if kind == int(mujoco.mjtTrn.mjTRN_TENDON):
        return _tendon(model, target)
    return _POSITIONS, _RATES, _FORCES

"""Plausibility: detects wrong units by the range of values that the model can have."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from reality_gap.io.dimensions import actuator_units, sensor_units
from reality_gap.io.unit_guesses import is_endless, joint_of
from reality_gap.study.data import Study
from reality_gap.study.system import commanded
from reality_gap.types import Floats, Ints

SMALL = 0.2
"""Largest angle of a model that may have been meant in radians but read as degrees [rad]."""
NEARLY = 0.2
"""Share of a range by which lengths may exceed it."""
LEAST_TRAVEL = 0.01
"""Share of a range that lengths cover, unless they have another unit."""
LARGE = 8.0 * np.pi
"""Angle of a limit that may have been meant in degrees but read as radians [rad]."""
SAMPLES = 200
"""Number of postures, sampled uniformly from the ranges of the joints."""

_POSITIONS = tuple(
    int(kind)
    for kind in (
        mujoco.mjtSensor.mjSENS_JOINTPOS,
        mujoco.mjtSensor.mjSENS_TENDONPOS,
        mujoco.mjtSensor.mjSENS_ACTUATORPOS,
        mujoco.mjtSensor.mjSENS_FRAMEPOS,
        mujoco.mjtSensor.mjSENS_SUBTREECOM,
    )
)


@dataclass(frozen=True)
class ScaleWarning:
    """A position whose size does not fit the model.

    Attributes:
        sentence: the warning.
        certain: whether only a wrong unit can explain it.
    """

    sentence: str
    certain: bool


def wrong_unit(study: Study) -> str | None:
    """Return a sentence on the first unit that is certainly wrong, or None."""
    return next((found.sentence for found in scale_warnings(study) if found.certain), None)


def scale_warnings(study: Study) -> tuple[ScaleWarning, ...]:
    """Return warnings on measured and commanded positions that are suspiciously large or small.

    The median distance from zero over the log is compared with the range of the same quantity
    over the postures of the model.
    """
    model = study.spec().compile()
    sensors, lengths = sample_positions(model)
    found: list[tuple[str, ScaleWarning | None]] = [("", one) for one in _large_ranges(model)]
    for name, unit, values in _measured_positions(study, model):
        if is_endless(model, "sensors", name):
            continue  # a wheel may turn any number of times
        start, count = int(model.sensor(name).adr[0]), int(model.sensor(name).dim[0])
        possible, length = sensors[:, start : start + count], _length_at_zero(model, name)
        found.append((unit, _compare(name, unit, values, possible, length)))
    if not study.inverse:
        for column, i in enumerate(commanded(model)):
            name = model.actuator(i).name
            units = actuator_units(model, name)
            single = len(units) == 1 or (_has_gear(model, i) and len(units) == 2)
            position = single and set(units) <= {"m", "rad"}
            if position and not is_endless(model, "actuators", name):
                values = np.concatenate([episode.command[:, column] for episode in study.episodes])
                what, possible = f"the command of {name}", lengths[:, [i]]
                length = _driven_at_zero(model, i)
                found.append(
                    (units[0], _compare(what, units[0], values[:, None], possible, length))
                )
    return tuple(
        ScaleWarning(warning.sentence, warning.certain and _bounded(model, unit))
        for unit, warning in found
        if warning is not None
    )


def _has_gear(model: mujoco.MjModel, actuator: int) -> bool:
    """Return whether a joint or tendon moves by another amount than the actuator's position."""
    of_tendon = int(model.actuator_trntype[actuator]) == int(mujoco.mjtTrn.mjTRN_TENDON)
    moves = of_tendon or joint_of(model, actuator) >= 0
    return moves and abs(float(model.actuator_gear[actuator, 0])) != 1.0


def _large_ranges(model: mujoco.MjModel) -> list[ScaleWarning]:
    """Return warnings on ranges of hinges that are so large that they may be in degrees."""
    found = []
    for i in range(model.njnt):
        low, high = model.jnt_range[i]
        hinge = int(model.jnt_type[i]) == int(mujoco.mjtJoint.mjJNT_HINGE)
        if hinge and model.jnt_limited[i] and max(-low, high) > LARGE:
            text = f"the range of joint {model.joint(i).name} is {low:.3g} to {high:.3g} rad in the"
            advice = "model: is it in degrees, but read as radians (compiler angle=radian)?"
            found.append(ScaleWarning(f"{text} {advice}", False))
    return found


def _measured_positions(study: Study, model: mujoco.MjModel) -> list[tuple[str, str, Floats]]:
    """Return name, unit and values (n, components) of each measured position."""
    parts: dict[str, list[Floats]] = {}
    for i, channel in enumerate(study.channels):
        if channel.kind == "sensor":
            values = np.concatenate([episode.readings[i].value for episode in study.episodes])
            parts.setdefault(channel.sensor, []).append(values)
    positions = []
    for name, columns in parts.items():
        kind, units = int(model.sensor(name).type[0]), sensor_units(model, name)
        # Rows with a part of a position only are rare and hardly change a median.
        count = min(len(column) for column in columns)
        if kind in _POSITIONS and len(units) == 1:
            values = np.stack([column[:count] for column in columns], axis=1)
            positions.append((name, units[0], values))
    return positions


def sample_positions(model: mujoco.MjModel) -> tuple[Floats, Floats]:
    """Return sensor data (k, nsensordata) and actuator lengths (k, nactuator) at postures."""
    data = mujoco.MjData(model)
    random = np.random.default_rng(0)
    sensors = np.zeros((SAMPLES, model.nsensordata))
    lengths = np.zeros((SAMPLES, model.nactuator))
    for k in range(SAMPLES):
        mujoco.mj_resetData(model, data)
        for i in range(model.njnt):
            low, high = _range(model, i)
            data.qpos[model.jnt_qposadr[i]] += random.uniform(low, high)
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_sensorPos(model, data)
        sensors[k], lengths[k] = data.sensordata, data.actuator_length
    return sensors, lengths


def _range(model: mujoco.MjModel, joint: int) -> tuple[float, float]:
    """Return the range of a hinge or slide joint relative to ``qpos0``; (0, 0) for others."""
    kind = int(model.jnt_type[joint])
    if kind in (int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)):
        return 0.0, 0.0
    if model.jnt_limited[joint]:
        zero = float(model.qpos0[model.jnt_qposadr[joint]])
        return float(model.jnt_range[joint, 0]) - zero, float(model.jnt_range[joint, 1]) - zero
    turn = np.pi if kind == int(mujoco.mjtJoint.mjJNT_HINGE) else 1.0
    return -turn, turn


def _bounded(model: mujoco.MjModel, unit: str) -> bool:
    """Return whether the joint limits bound all positions of this unit."""
    if unit == "rad":
        return bool(np.all(model.jnt_limited))
    hinges = model.jnt_type == int(mujoco.mjtJoint.mjJNT_HINGE)
    return bool(np.all(model.jnt_limited | hinges))


def _length_at_zero(model: mujoco.MjModel, sensor: str) -> float:
    """Return the length at ``qpos0`` of the tendon that a sensor reads [m]; 0 if it reads none."""
    kind, at = int(model.sensor(sensor).type[0]), int(model.sensor(sensor).objid[0])
    if kind == int(mujoco.mjtSensor.mjSENS_ACTUATORPOS):
        return _driven_at_zero(model, at)
    of_tendon = kind == int(mujoco.mjtSensor.mjSENS_TENDONPOS)
    return float(model.tendon_length0[at]) if of_tendon else 0.0


def _driven_at_zero(model: mujoco.MjModel, actuator: int) -> float:
    """Return the length of an actuator at ``qpos0`` if it pulls a tendon [m]; 0 if not."""
    if int(model.actuator_trntype[actuator]) != int(mujoco.mjtTrn.mjTRN_TENDON):
        return 0.0
    tendon = int(model.actuator_trnid[actuator, 0])
    return float(model.actuator_gear[actuator, 0] * model.tendon_length0[tendon])


def largest_position(
    model: mujoco.MjModel, part: str, name: str, positions: tuple[Floats, Floats]
) -> float:
    """Return the size of the largest position of an element that the limits of joints allow.

    Args:
        model: the compiled model.
        part: "sensors", "actuators" or "efforts".
        name: name of the element in this part of a study.
        positions: those of `sample_positions`.

    Returns:
        The size [rad or m]; 0 if a joint without limits moves it, if angles are so large or small
        that the model may have them in another unit, or if it is no single position.
    """
    if part == "sensors":
        sensor = model.sensor(name)
        kind, at = int(sensor.type[0]), int(sensor.objid[0])
        if kind not in _POSITIONS or int(sensor.dim[0]) != 1:
            return 0.0
        values = positions[0][:, int(sensor.adr[0])]
        is_joint = kind == int(mujoco.mjtSensor.mjSENS_JOINTPOS)
        actuator = at if kind == int(mujoco.mjtSensor.mjSENS_ACTUATORPOS) else -1
        joints = np.array([at]) if is_joint else _moving(model, actuator)
    elif part == "actuators":
        actuator = int(model.actuator(name).id)
        values, joints = positions[1][:, actuator], _moving(model, actuator)
    else:
        return 0.0
    hinges = model.jnt_type[joints] == int(mujoco.mjtJoint.mjJNT_HINGE)
    ranges = np.abs(model.jnt_range[joints]).max(axis=1, initial=0.0)
    doubtful = hinges & ((ranges < SMALL) | (ranges > LARGE))
    if not model.jnt_limited[joints].all() or doubtful.any():
        return 0.0
    return float(np.abs(values).max())


def _moving(model: mujoco.MjModel, actuator: int) -> Ints:
    """Return the joint that an actuator moves; all joints if it moves something else."""
    joint = joint_of(model, actuator) if actuator >= 0 else -1
    return np.array([joint]) if joint >= 0 else np.arange(model.njnt)


def missing_length(
    model: mujoco.MjModel, part: str, name: str, values: Floats, positions: tuple[Floats, Floats]
) -> float:
    """Return what lengths of a tendon lack that are 0 at ``qpos0``, as those of relative encoders.

    Their sign need not be that of the model.

    Args:
        model: the compiled model.
        part: "sensors", "actuators" or "efforts".
        name: name of the element in this part of a study.
        values: readings or commands, shape (n,) [m].
        positions: those of `sample_positions`.

    Returns:
        The length of the tendon at ``qpos0`` [m]; 0 if the lengths are whole, or no lengths.
    """
    sensors, lengths = positions
    if part == "sensors":
        possible, length = sensors[:, int(model.sensor(name).adr[0])], _length_at_zero(model, name)
    elif part == "actuators":
        i = int(model.actuator(name).id)
        possible, length = lengths[:, i], _driven_at_zero(model, i)
    else:
        return 0.0
    whole = bool(_margins(possible)[0] <= values.min() <= values.max() <= _margins(possible)[1])
    if length == 0.0 or whole:
        return 0.0
    return length if any(_is_zeroed(s * values, possible, length) for s in (1, -1)) else 0.0


def _margins(possible: Floats) -> tuple[float, float]:
    """Return between what lengths of a model lie, with a margin [m]."""
    low, high = float(possible.min()), float(possible.max())
    margin = NEARLY * (high - low)
    return low - margin, high + margin


def _is_zeroed(values: Floats, possible: Floats, length: float) -> bool:
    """Return whether lengths fit the model only with that at ``qpos0`` added."""
    low, high = _margins(possible)
    begin, end = float(values.min()), float(values.max())
    fits = low <= begin + length <= end + length <= high
    return begin < low and fits and end - begin >= LEAST_TRAVEL * float(np.ptp(possible))


def _zeroed(what: str, values: Floats, possible: Floats, length: float) -> ScaleWarning | None:
    """Return a warning on lengths that are 0 at ``qpos0``, where a tendon has a length [m]."""
    if not _is_zeroed(values, possible, length):
        return None
    begin, end, low, high = values.min(), values.max(), possible.min(), possible.max()
    return ScaleWarning(
        f"{what} is {begin:.3g} to {end:.3g} m, but between {low:.3g} and {high:.3g} in the model: "
        f"it seems to be 0 at qpos0, where the length is {length:.4g} m; add offset: {length:.4g}",
        False,
    )


def _compare(
    what: str, unit: str, values: Floats, possible: Floats, length: float
) -> ScaleWarning | None:
    """Return a warning on values that do not fit the model; a tendon has this length at qpos0."""
    zeroed = _zeroed(what, values, possible, length)
    if zeroed is not None:
        return zeroed
    sizes, range_ = np.linalg.norm(values, axis=1), np.linalg.norm(possible, axis=1)
    size, low, high = float(np.median(sizes)), float(range_.min()), float(range_.max())
    large, small = ("degrees", "radians") if unit == "rad" else ("millimetres", "metres")
    # A joint may rest near zero for a long time, so that a high quantile is the better measure.
    if unit == "rad":
        size = float(np.quantile(sizes, 0.95))
    limit = 10.0 if unit == "rad" else 100.0
    text = f"{what} is {size:.3g} {unit}, but between {low:.3g} and {high:.3g} in the model"
    if size > limit * high:
        model = " (or the model's ranges are in radians, without compiler angle=radian)"
        also = model if unit == "rad" and high < SMALL else ""
        return ScaleWarning(f"{text}: the log seems to be in {large}, not in {small}{also}", True)
    if unit == "m" and 0.0 < size < low / limit:
        return ScaleWarning(f"{text}: the log seems to be in {small}, not in {large}", True)
    if size > 2.0 * high or (unit == "m" and size < low / 2.0):
        return ScaleWarning(f"{text}: check unit, scale and offset", False)
    return None

"""Inverse dynamics: the effort that the measured motion asks for, beside the effort measured.

For machines in closed loop, whose position hides every fault and whose effort shows it. As in
identification with the inverse dynamic model (Gautier, Janot and Vandanjon, IEEE Trans. Control
Systems Technology 21(2), 2013): positions are low-passed with zero phase and differentiated by
central differences; measured and computed efforts then go through the same low-pass (parallel
filtering), and only as many samples are kept as that leaves independent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt, welch

from reality_gap.causes.base import Hook, Record
from reality_gap.errors import StudyError
from reality_gap.simulation.hypothesis import Plant
from reality_gap.simulation.replay import Replay
from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.study.measurements import Measured, channel_noise
from reality_gap.types import Floats

KEPT_POWER = 0.999
"""Share of an effort's power above its white noise that is kept: the rest is 3 % of it in RMS."""
MARGIN = 1.5
"""Cutoff over the frequency below which that power lies, where the filter still passes 96 %."""
POSITION_BAND = 4.0
"""Cutoff of the positions over that of the efforts: its edge is not seen in the efforts."""
GRID_RATE = 8.0
"""Samples of the motion per period of the cutoff, at least."""
EDGE = 3.0
"""Left out at both ends of a log, where filters start and end [periods of the cutoff]."""
SLOW = 0.01
"""A joint slower than this share of its usual speed stands, and dry friction may be anything."""
FRICTION_RATE = 1e6
"""Damping of dry friction's constraint [1/s]; see `_crisp`."""


@dataclass(frozen=True)
class Motion:
    """What a machine did in one episode, on an even grid of k samples.

    Attributes:
        time: (k,) [s].
        qpos, qvel, qacc: (k, nq), (k, nv), (k, nv) in SI units.
        cutoff: of the low-pass of the efforts [Hz].
    """

    time: Floats
    qpos: Floats
    qvel: Floats
    qacc: Floats
    cutoff: float


@dataclass(frozen=True, kw_only=True)
class Traced(Episode):
    """An episode of a prepared study, with the motion that its efforts were measured along."""

    motion: Motion


def ready(study: Study) -> Study:
    """The study as it is compared: one with efforts is prepared, unless it was already."""
    done = all(isinstance(episode, Traced) for episode in study.episodes)
    return prepare(study) if study.inverse and not done else study


def prepare(study: Study) -> Study:
    """What is compared, and along which motion, for a study with efforts.

    The cutoff is `MARGIN` times the frequency below which `KEPT_POWER` of each effort's power lies.
    Samples at which the effort's joint stands are left out: dry friction is then anything
    up to its size.

    Returns:
        the study with its efforts alone, low-passed and thinned to two samples per period of the
        cutoff, their noise reduced accordingly, and with the motion of each episode.

    Raises:
        StudyError: a joint of the model is not measured, or a log is too short or too slow.
    """
    model = study.spec().compile()
    columns = _position_channels(study, model)
    efforts = [c for c, channel in enumerate(study.channels) if channel.kind == "effort"]
    noise = channel_noise(study)
    period = max(_period(e.readings[c]) for e in study.episodes for c in [*columns, *efforts])
    cutoff = _cutoff(study, efforts, period)
    episodes = []
    for episode in study.episodes:
        motion = _motion(model, columns, episode, cutoff, period)
        still = _still(motion, noise[columns], period)
        readings = tuple(
            _effort(motion, episode.readings[c], still[:, _dof(model, study.channels[c])], period)
            for c in efforts
        )
        kept = {f.name: getattr(episode, f.name) for f in fields(Episode)}
        episodes.append(Traced(**kept | {"readings": readings}, motion=motion))
    left = np.sqrt(2 * cutoff * period)
    channels = tuple(replace(study.channels[c], noise=float(noise[c] * left)) for c in efforts)
    return replace(study, channels=channels, episodes=tuple(episodes))


def inverse_replay(plant: Plant, study: Study, measured: Measured) -> Replay:
    """Efforts that a plant needs for the measured motion.

    Args:
        plant: its hooks are called at every sample; what they apply needs no effort.
        study: as `prepare` gives it.
        measured: the readings of that study.
    """
    model = plant.spec.compile()
    _crisp(model)
    dofs = np.array([_dof(model, channel) for channel in study.channels])
    prediction = np.full(len(measured.value), np.nan)
    records = []
    start = 0.0
    for e, episode in enumerate(study.episodes):
        if not isinstance(episode, Traced):
            raise StudyError(f"the study {study.name} compares efforts and was not prepared")
        motion = episode.motion
        effort, record = _run(plant, model, motion, start)
        filtered = _low_pass(effort[:, dofs], motion.cutoff, _step(motion.time))
        for c in range(len(study.channels)):
            at = (measured.episode == e) & (measured.channel == c)
            prediction[at] = np.interp(measured.time[at], motion.time, filtered[:, c])
        records.append(record)
        start += episode.duration
    return Replay(prediction, tuple(records))


def _run(
    plant: Plant, model: mujoco.MjModel, motion: Motion, start: float
) -> tuple[Floats, Record]:
    """Effort of every degree of freedom (k, nv), and what the machine did; sensors are not read."""
    data = mujoco.MjData(model)
    time = start + motion.time
    acting = [h for h in plant.effects.hooks if h.start < time[-1] and h.end > time[0]]
    hooks = [(h.make(model), h.start, h.end) for h in acting]
    effort = np.empty_like(motion.qvel)
    record = Record(
        time=time,
        sensors=np.zeros((len(time), model.nsensordata)),
        force=np.zeros((len(time), model.nactuator)),
        length=np.empty((len(time), model.ntendon)),
        velocity=np.empty((len(time), model.ntendon)),
        qpos=motion.qpos,
        qvel=motion.qvel,
        model=model,
    )
    for k, now in enumerate(time):
        data.time = now
        data.qpos, data.qvel, data.qacc = motion.qpos[k], motion.qvel[k], motion.qacc[k]
        called = [hook for hook, begin, end in hooks if begin <= now <= end]
        applied = _applied(model, data, called) if called else 0.0
        mujoco.mj_inverseSkip(model, data, mujoco.mjtStage.mjSTAGE_NONE, 1)
        effort[k] = data.qfrc_inverse - applied
        if model.ntendon:
            record.length[k], record.velocity[k] = data.ten_length, data.ten_velocity
    return effort, record


def _applied(model: mujoco.MjModel, data: mujoco.MjData, hooks: Sequence[Hook]) -> Floats:
    """Generalized force of the hooks (nv,), called on a state whose positions are known."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    if model.ntendon:
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
    data.qfrc_applied[:] = 0.0
    data.xfrc_applied[:] = 0.0
    for hook in hooks:
        hook(model, data)
    force = data.qfrc_applied.copy()
    if not data.xfrc_applied.any():
        return force
    for body in np.flatnonzero(np.any(data.xfrc_applied, axis=1)):
        wrench, at = data.xfrc_applied[body], data.xipos[body]
        mujoco.mj_applyFT(model, data, wrench[:3], wrench[3:], at, int(body), force)
    return force


def _crisp(model: mujoco.MjModel) -> None:
    """Dry friction opposes the measured velocity alone.

    MuJoCo's is a soft constraint on a + B v, which turns round 1/B before the velocity does:
    10 ms by default, to be stable in a simulation. Where the motion is known, B can be large.
    """
    model.dof_solref[:] = (0.0, -FRICTION_RATE)
    model.tendon_solref_fri[:] = (0.0, -FRICTION_RATE)


def _position_channels(study: Study, model: mujoco.MjModel) -> list[int]:
    """Channel of the position of every joint, in the order of the joints."""
    found = {}
    for c, channel in enumerate(study.channels):
        if channel.kind == "sensor":
            sensor = model.sensor(channel.sensor)
            if int(sensor.type[0]) == int(mujoco.mjtSensor.mjSENS_JOINTPOS):
                found[int(sensor.objid[0])] = c
    if model.nq != model.njnt:
        raise StudyError("efforts need a model whose joints are hinges and slides")
    missing = [model.joint(j).name for j in range(model.njnt) if j not in found]
    if missing:
        raise StudyError(
            "efforts need the position of every joint, measured by a jointpos sensor; "
            f"missing: {', '.join(missing)}"
        )
    return [found[j] for j in range(model.njnt)]


def _dof(model: mujoco.MjModel, channel: Channel) -> int:
    return int(model.joint(channel.sensor).dofadr[0])


def _period(reading: Reading) -> float:
    if len(reading.time) < 10:
        raise StudyError(f"inverse dynamics need logs, but one has {len(reading.time)} samples")
    return float(np.median(np.diff(reading.time)))


def _cutoff(study: Study, efforts: list[int], period: float) -> float:
    """Of the low-pass of the efforts [Hz]."""
    highest = 0.0
    for c in efforts:
        total = frequency = np.zeros(1)
        size = min(4096, *(len(e.readings[c].value) for e in study.episodes))
        for episode in study.episodes:
            value = episode.readings[c].value
            frequency, power = welch(value, 1.0 / period, nperseg=size)
            noise = np.median(power[len(power) // 2 :])
            total = total + np.maximum(power - 2 * noise, 0.0) * len(value)
        if not np.any(total):
            raise StudyError(f"the effort {study.channels[c].name} is constant")
        share = np.cumsum(total) / np.sum(total)
        highest = max(highest, float(frequency[np.searchsorted(share, KEPT_POWER)]))
    return min(MARGIN * highest, 0.45 / (POSITION_BAND * period))


def _motion(
    model: mujoco.MjModel, columns: list[int], episode: Episode, cutoff: float, period: float
) -> Motion:
    readings = [episode.readings[c] for c in columns]
    begin = max(r.time[0] for r in episode.readings if len(r.time))
    end = min(r.time[-1] for r in episode.readings if len(r.time))
    if end - begin < 20.0 / cutoff:
        raise StudyError(
            f"the log {episode.name} lasts {end - begin:.3g} s, which is too short for inverse "
            f"dynamics at {cutoff:.3g} Hz; at least {20.0 / cutoff:.3g} s are needed"
        )
    time = np.arange(begin, end + 1e-9, period)
    raw = np.stack([CubicSpline(r.time, r.value)(time) for r in readings], axis=1)
    sections = butter(4, 2 * POSITION_BAND * cutoff * period, output="sos")
    qpos = sosfiltfilt(sections, raw, axis=0)
    qvel = np.gradient(qpos, period, axis=0)
    qacc = np.gradient(qvel, period, axis=0)
    stride = max(1, int(1.0 / (GRID_RATE * cutoff * period)))
    kept = slice(None, None, stride)
    return Motion(time[kept], qpos[kept], qvel[kept], qacc[kept], cutoff)


def _still(motion: Motion, noise: Floats, period: float) -> NDArray[np.bool_]:
    """Whether each joint stands, (k, nv): slower than its speed is known, or than `SLOW`."""
    band = POSITION_BAND * motion.cutoff
    speed_noise = noise * 2 * np.pi * np.sqrt(2 * period * band**3 / 3)
    usual = np.quantile(np.abs(motion.qvel), 0.95, axis=0)
    return np.abs(motion.qvel) < np.maximum(4 * speed_noise, SLOW * usual)


def _effort(motion: Motion, reading: Reading, still: NDArray[np.bool_], period: float) -> Reading:
    time = np.arange(motion.time[0], motion.time[-1] + 1e-9, period)
    value = _low_pass(np.interp(time, reading.time, reading.value), motion.cutoff, period)
    grid = _step(motion.time)
    step = max(1, round(0.5 / (motion.cutoff * grid)))
    edge = int(np.ceil(EDGE / (motion.cutoff * grid)))
    kept = np.arange(edge, len(motion.time) - edge, step)
    kept = kept[~still[kept]]
    if len(kept) < 10:
        raise StudyError("the joint of an effort hardly moves: nothing can be said of its force")
    return Reading(motion.time[kept], np.interp(motion.time[kept], time, value))


def _step(time: Floats) -> float:
    return float(time[1] - time[0])


def _low_pass(effort: Floats, cutoff: float, period: float) -> Floats:
    return sosfiltfilt(butter(4, 2 * cutoff * period, output="sos"), effort, axis=0)

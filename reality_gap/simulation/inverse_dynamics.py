"""Inverse dynamics: the effort that the measured motion requires, compared with the measured one.

This is for machines in closed loop, where the controller hides a fault from the positions and the
efforts show it. The method is that of identification with the inverse dynamic model (Gautier, Janot
and Vandanjon, IEEE Trans. Control Systems Technology 21(2), 2013): positions are low-pass filtered
with zero phase and differentiated by central differences; measured and computed efforts pass the
same low-pass filter (parallel filtering); as many samples are kept as are independent after it.
Noise of the positions becomes noise of the computed efforts. Its size is found by adding the same
noise once more.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields, replace

import mujoco
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt, welch

from reality_gap.causes.base import Effects, Hook, Record
from reality_gap.errors import StudyError
from reality_gap.simulation.hypothesis import Plant
from reality_gap.simulation.light_model import light_spec
from reality_gap.simulation.replay import Replay
from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.study.measurements import Measured, channel_noise
from reality_gap.types import Bools, Floats

KEPT_POWER = 0.999
"""Share of an effort's power above its white noise that is kept; the rest is 3 % of it in RMS."""
MARGIN = 1.5
"""Cutoff over the frequency below which that power lies; the filter passes 96 % there."""
POSITION_BAND = 4.0
"""Cutoff of the positions over that of the efforts, so that it does not affect the efforts."""
GRID_RATE = 8.0
"""Samples of the motion per period of the cutoff, at least."""
EDGE = 3.0
"""Length that is left out at both ends of a log, where filters start [periods of the cutoff]."""
LEAST = 10
"""Number of samples in motion below which an effort is not compared."""
SLOW = 0.01
"""Share of its usual speed below which a joint stands still; its dry friction is then unknown."""
FRICTION_RATE = 1e6
"""Damping of the constraint of dry friction [1/s]; see `_stiffen_dry_friction`."""


@dataclass(frozen=True)
class Motion:
    """Motion of one episode on an even grid of k samples.

    Attributes:
        time: time of each sample, shape (k,) [s].
        qpos, qvel, qacc: positions, velocities and accelerations in SI units, shapes (k, nq),
            (k, nv) and (k, nv).
        cutoff: cutoff of the low-pass filter of the efforts [Hz].
    """

    time: Floats
    qpos: Floats
    qvel: Floats
    qacc: Floats
    cutoff: float


@dataclass(frozen=True, kw_only=True)
class PreparedEpisode(Episode):
    """An episode of a prepared study, with the motion along which its efforts were measured."""

    motion: Motion


def ensure_prepared(study: Study) -> Study:
    """Prepare a study with efforts unless it is prepared; return any other study as it is."""
    prepared = all(isinstance(episode, PreparedEpisode) for episode in study.episodes)
    return prepare(study) if study.inverse and not prepared else study


def prepare(study: Study) -> Study:
    """Filter the efforts of a study and compute the motion along which they were measured.

    The cutoff is `MARGIN` times the frequency below which `KEPT_POWER` of each effort's power lies.
    Samples at which the joint stands still are left out, because dry friction then takes any value
    up to its limit.

    Args:
        study: a study with efforts and with the position of each joint.

    Returns:
        The study with its efforts only, filtered and thinned to two samples per period of the
        cutoff, with accordingly reduced noise and with the motion of each episode. Efforts of
        joints that stand still are left out.

    Raises:
        StudyError: a joint of the model is not measured, a log is too short, or no joint moves.
    """
    plant = Plant(light_spec(study.spec()), Effects())
    model = plant.spec.compile()
    _stiffen_dry_friction(model)
    columns = _position_channels(study, model)
    efforts = [c for c, channel in enumerate(study.channels) if channel.kind == "effort"]
    noise = channel_noise(study)
    period = max(_period(e.readings[c]) for e in study.episodes for c in [*columns, *efforts])
    cutoff = _cutoff(study, efforts, period)
    dofs = [_dof(model, study.channels[c]) for c in efforts]
    rng = np.random.default_rng(0)
    episodes, changes = [], []
    for episode in study.episodes:
        motion = _motion(model, columns, episode, cutoff, period)
        still = _standing_still(motion, noise[columns], period)
        readings = tuple(
            _effort(motion, episode.readings[c], still[:, dof], period)
            for c, dof in zip(efforts, dofs, strict=True)
        )
        again = _motion(model, columns, _noisy(episode, columns, noise, rng), cutoff, period)
        before, after = (
            _filtered(_inverse_dynamics(plant, model, m, 0.0)[0], m, dofs) for m in (motion, again)
        )
        used = np.stack([np.isin(motion.time, reading.time) for reading in readings], axis=1)
        changes.append(np.where(used, after - before, np.nan))
        kept = {f.name: getattr(episode, f.name) for f in fields(Episode)}
        episodes.append(PreparedEpisode(**kept | {"readings": readings}, motion=motion))
    moving = [k for k in range(len(efforts)) if any(len(e.readings[k].time) for e in episodes)]
    if not moving:
        raise StudyError(
            "the joints of all efforts hardly move; their forces can be compared in motion only"
        )
    reduction = np.sqrt(2 * cutoff * period)
    computed = np.sqrt(np.nanmean(np.concatenate(changes)[:, moving] ** 2, axis=0))
    whole = np.hypot(noise[efforts][moving] * reduction, computed)
    channels = tuple(
        replace(study.channels[efforts[k]], noise=float(size))
        for k, size in zip(moving, whole, strict=True)
    )
    compared = (replace(e, readings=tuple(e.readings[k] for k in moving)) for e in episodes)
    return replace(study, channels=channels, episodes=tuple(compared))


def left_out(study: Study) -> list[str]:
    """Return the names of the efforts that `prepare` leaves out, because their joints stand still.

    Args:
        study: a study that is not prepared.
    """
    compared = {channel.name for channel in ensure_prepared(study).channels}
    efforts = [channel.name for channel in study.channels if channel.kind == "effort"]
    return [name for name in efforts if name not in compared]


def inverse_replay(
    plant: Plant, study: Study, measured: Measured, only: Collection[int] | None = None
) -> Replay:
    """Compute the efforts that a plant needs for the measured motion.

    Args:
        plant: the model and its effects; forces that its hooks apply reduce the effort.
        study: a prepared study; see `prepare`.
        measured: the readings of that study.
        only: indices of the episodes to compute; by default all.

    Returns:
        The predicted efforts and the simulated signals.

    Raises:
        StudyError: the study is not prepared.
    """
    model = plant.spec.compile()
    _stiffen_dry_friction(model)
    dofs = [_dof(model, channel) for channel in study.channels]
    prediction = np.full(len(measured.value), np.nan)
    records = []
    start = 0.0
    for e, episode in enumerate(study.episodes):
        if not isinstance(episode, PreparedEpisode):
            raise StudyError(f"the study {study.name} compares efforts and was not prepared")
        if only is not None and e not in only:
            start += episode.duration
            continue
        motion = episode.motion
        effort, record = _inverse_dynamics(plant, model, motion, start)
        for effect in plant.effects.efforts:
            effect(model, record.time, effort)
        filtered = _filtered(effort, motion, dofs)
        for c in range(len(study.channels)):
            at = (measured.episode == e) & (measured.channel == c)
            prediction[at] = np.interp(measured.time[at], motion.time, filtered[:, c])
        records.append(record)
        start += episode.duration
    return Replay(prediction, tuple(records))


def _inverse_dynamics(
    plant: Plant, model: mujoco.MjModel, motion: Motion, start: float
) -> tuple[Floats, Record]:
    """Return the effort of each degree of freedom (k, nv), and a record without sensor values."""
    data = mujoco.MjData(model)
    time = start + motion.time
    scheduled = [h for h in plant.effects.hooks if h.start < time[-1] and h.end > time[0]]
    hooks = [(h.make(model), h.start, h.end) for h in scheduled]
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
        active = [hook for hook, begin, end in hooks if begin <= now <= end]
        applied = _applied_force(model, data, active) if active else 0.0
        mujoco.mj_inverseSkip(model, data, mujoco.mjtStage.mjSTAGE_NONE, 1)
        effort[k] = data.qfrc_inverse - applied
        if model.ntendon:
            record.length[k], record.velocity[k] = data.ten_length, data.ten_velocity
    return effort, record


def _filtered(effort: Floats, motion: Motion, dofs: Sequence[int]) -> Floats:
    """Return efforts (k, nv) at some degrees of freedom, low-passed as the measured ones."""
    return _low_pass(effort[:, dofs], motion.cutoff, _step(motion.time))


def _noisy(
    episode: Episode, columns: Sequence[int], noise: Floats, rng: np.random.Generator
) -> Episode:
    """Return an episode with more noise on the readings of some channels."""
    readings = list(episode.readings)
    for c in columns:
        errors = noise[c] * rng.standard_normal(len(readings[c].value))
        readings[c] = replace(readings[c], value=readings[c].value + errors)
    return replace(episode, readings=tuple(readings))


def _applied_force(model: mujoco.MjModel, data: mujoco.MjData, hooks: Sequence[Hook]) -> Floats:
    """Return the generalized force of the hooks at the state of ``data``, shape (nv,)."""
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


def _stiffen_dry_friction(model: mujoco.MjModel) -> None:
    """Let dry friction oppose the measured velocity.

    In MuJoCo it is a soft constraint on a + B v, which changes its sign 1/B before the velocity
    does. By default this is 10 ms, for stability of the simulation. Nothing is integrated here, so
    that B can be large.
    """
    model.dof_solref[:] = (0.0, -FRICTION_RATE)
    model.tendon_solref_fri[:] = (0.0, -FRICTION_RATE)


def _position_channels(study: Study, model: mujoco.MjModel) -> list[int]:
    """Return the channel of the position of each joint, in the order of the joints."""
    found = {}
    for c, channel in enumerate(study.channels):
        if channel.kind == "sensor":
            sensor = model.sensor(channel.sensor)
            if int(sensor.type[0]) == int(mujoco.mjtSensor.mjSENS_JOINTPOS):
                found[int(sensor.objid[0])] = c
    if model.nq != model.njnt:
        raise StudyError("efforts need a model whose joints are all hinges or slides")
    missing = [model.joint(j).name for j in range(model.njnt) if j not in found]
    if missing:
        raise StudyError(
            "efforts need the position of each joint, measured by a jointpos sensor; "
            f"missing: {', '.join(missing)}"
        )
    return [found[j] for j in range(model.njnt)]


def _dof(model: mujoco.MjModel, channel: Channel) -> int:
    return int(model.joint(channel.sensor).dofadr[0])


def _period(reading: Reading) -> float:
    if len(reading.time) < 10:
        raise StudyError(
            f"a reading has {len(reading.time)} samples, but inverse dynamics need at least 10"
        )
    return float(np.median(np.diff(reading.time)))


def _cutoff(study: Study, efforts: list[int], period: float) -> float:
    """Return the cutoff of the low-pass filter of the efforts [Hz]."""
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


def _standing_still(motion: Motion, noise: Floats, period: float) -> Bools:
    """Return whether each joint is slower than the noise of its speed or than `SLOW`, (k, nv)."""
    band = POSITION_BAND * motion.cutoff
    speed_noise = noise * 2 * np.pi * np.sqrt(2 * period * band**3 / 3)
    usual = np.quantile(np.abs(motion.qvel), 0.95, axis=0)
    return np.abs(motion.qvel) < np.maximum(4 * speed_noise, SLOW * usual)


def _effort(motion: Motion, reading: Reading, still: Bools, period: float) -> Reading:
    time = np.arange(motion.time[0], motion.time[-1] + 1e-9, period)
    value = _low_pass(np.interp(time, reading.time, reading.value), motion.cutoff, period)
    grid = _step(motion.time)
    step = max(1, round(0.5 / (motion.cutoff * grid)))
    edge = int(np.ceil(EDGE / (motion.cutoff * grid)))
    kept = np.arange(edge, len(motion.time) - edge, step)
    kept = kept[~still[kept]]
    if len(kept) < LEAST:
        kept = kept[:0]
    return Reading(motion.time[kept], np.interp(motion.time[kept], time, value))


def _step(time: Floats) -> float:
    return float(time[1] - time[0])


def _low_pass(effort: Floats, cutoff: float, period: float) -> Floats:
    return sosfiltfilt(butter(4, 2 * cutoff * period, output="sos"), effort, axis=0)

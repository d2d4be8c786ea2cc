"""Inverse dynamics: the effort that the measured motion requires, compared with the measured one.

This is for machines in closed loop, where the controller hides a fault from the positions and the
efforts show it. The method is that of identification with the inverse dynamic model (Gautier, Janot
and Vandanjon, IEEE Trans. Control Systems Technology 21(2), 2013): positions are low-pass filtered
with zero phase and differentiated; measured and computed efforts pass the same filters (parallel
filtering); as many samples are kept as are independent after them. Noise of the positions becomes
noise of the computed efforts. Weights make the noise of their difference white, see
`reality_gap.simulation.effort_filter`; its size is found by adding the same noise once more.

Forces of contacts are left out. They follow from how deep geoms are in each other, which measured
positions do not show: an error of the noise, or of rounding where geoms only touch, is a force of
any size. `check` names the bodies that touch.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import mujoco
import numpy as np

from reality_gap.causes.base import Effects, Hook, Record
from reality_gap.causes.support.typical_scales import joint_uses
from reality_gap.errors import StudyError
from reality_gap.simulation.effort_filter import independent_samples, roll_off
from reality_gap.simulation.hypothesis import Plant
from reality_gap.simulation.light_model import light_spec
from reality_gap.simulation.measured_motion import (
    Motion,
    effort_cutoff,
    measured_motions,
    period_of,
)
from reality_gap.simulation.prepared_episode import (
    PreparedEpisode,
    prepared_episodes,
    weighted_episodes,
)
from reality_gap.simulation.replay import Replay
from reality_gap.study.data import Channel, Episode, JointUse, Study
from reality_gap.study.measurements import Measured, channel_noise
from reality_gap.study.system import compile_system
from reality_gap.types import Floats

AT_REST = 0.01
"""Velocity of a joint that rests, at most, over half of its range a second."""
LEAST = 10
"""Number of samples in motion below which an effort is not compared."""
FRICTION_RATE = 1e6
"""Damping of the constraint of dry friction [1/s]; see `_compile`."""


def ensure_prepared(study: Study) -> Study:
    """Prepare a study with efforts unless it is prepared; return any other study as it is."""
    prepared = all(isinstance(episode, PreparedEpisode) for episode in study.episodes)
    return prepare(study) if study.inverse and not prepared else study


def prepare(study: Study) -> Study:
    """Filter the efforts of a study and compute the motion along which they were measured.

    Samples at which the joint stands still are left out, because dry friction then takes any value
    up to its limit.

    Args:
        study: a study with efforts and with the position of each joint.

    Returns:
        The study with its efforts only, filtered and thinned to two samples per period of the
        cutoff, with accordingly reduced noise, with the motion of each episode and with how each
        joint is used. Efforts of joints that stand still are left out.

    Raises:
        StudyError: a joint of the model is not measured, the episodes are too short, or no joint
            moves.
    """
    plant = Plant(light_spec(study.spec(), contacts=False), Effects())
    model = _compile(plant)
    columns = _position_channels(study, model)
    efforts = [c for c, channel in enumerate(study.channels) if channel.kind == "effort"]
    noise = channel_noise(study)
    period = max(period_of(e.readings[c]) for e in study.episodes for c in [*columns, *efforts])
    cutoff = effort_cutoff(study, efforts, columns, noise[columns], period)
    dofs = [_dof(model, study.channels[c]) for c in efforts]
    motions = measured_motions(columns, study.episodes, noise[columns], cutoff, period)
    readings = [
        [
            independent_samples(m, e.readings[c], dof, period)
            for c, dof in zip(efforts, dofs, strict=True)
        ]
        for e, m in zip(study.episodes, motions, strict=True)
    ]
    moving = [k for k in range(len(efforts)) if sum(len(r[k].time) for r in readings) >= LEAST]
    if not moving:
        gaps = any(len(motion.gaps) for motion in motions)
        where = " between the gaps in their readings" if gaps else ""
        raise StudyError(
            f"the joints of all efforts hardly move{where}; their forces can be compared in motion "
            "only"
        )
    efforts, dofs = [efforts[k] for k in moving], [dofs[k] for k in moving]
    effort_noise = np.zeros(model.nv)
    effort_noise[dofs] = noise[efforts]
    shapes = roll_off(model, motions, noise[columns], effort_noise)[:, dofs].T
    own = [[some[k] for k in moving] for some in readings]
    episodes = weighted_episodes(study.episodes, motions, own, shapes, period)
    rng = np.random.default_rng(0)
    noisy = [_noisy(e, columns, noise, rng) for e in study.episodes]
    again = measured_motions(columns, noisy, noise[columns], cutoff, period)
    sizes = _noise(plant, model, episodes, again, dofs, noise[efforts])
    channels = tuple(
        replace(study.channels[c], noise=float(size))
        for c, size in zip(efforts, sizes, strict=True)
    )
    prepared = replace(study, channels=channels, episodes=tuple(episodes), period=period)
    return replace(prepared, uses=_uses(prepared, motions))


def _uses(study: Study, motions: Sequence[Motion]) -> dict[str, JointUse]:
    """Return how each joint is used in a prepared study, whose readings have no positions.

    The velocity of a joint that rests is the noise of its encoder; that of its model is kept.
    """
    system = compile_system(study)
    found = joint_uses(system)
    for joint, use in found.items():
        at = system.model.joint(joint)
        velocity = np.concatenate([m.qvel[m.is_read, int(at.dofadr[0])] for m in motions])
        speed = float(np.sqrt(np.mean(velocity**2)))
        if speed > AT_REST * use.speed:
            travel = max(float(np.ptp(m.qpos[m.is_read, int(at.qposadr[0])])) for m in motions)
            found[joint] = use._replace(speed=speed, travel=travel)
    return found


def _noise(
    plant: Plant,
    model: mujoco.MjModel,
    episodes: Sequence[PreparedEpisode],
    again: Sequence[Motion],
    dofs: Sequence[int],
    effort_noise: Floats,
) -> Floats:
    """Return the noise of the compared samples of each effort.

    Args:
        plant, model: the nominal model.
        episodes: the measured motion and the efforts that are compared.
        again: the same motion with the noise of the positions once more.
        dofs: degrees of freedom of the efforts (c,).
        effort_noise: of one measured sample of each effort (c,).

    Returns:
        Standard deviations, shape (c,).
    """
    changes: list[list[Floats]] = [[] for _ in dofs]
    white = np.zeros(len(dofs))
    for episode, noisy in zip(episodes, again, strict=True):
        difference = (
            _inverse_dynamics(plant, model, noisy, 0.0)[0]
            - _inverse_dynamics(plant, model, episode.motion, 0.0)[0]
        )
        for c, dof in enumerate(dofs):
            changes[c].append(episode.samples(c, difference[:, dof]))
            white[c] += episode.weights[c].white * len(changes[c][-1])
    count = np.array([sum(map(len, some)) for some in changes])
    computed = np.array([float(np.mean(np.concatenate(some) ** 2)) for some in changes])
    return np.asarray(np.sqrt(effort_noise**2 * white / count + computed))


def left_out(study: Study, prepared: Study) -> list[str]:
    """Return the names of the efforts that `prepare` leaves out, because their joints stand still.

    Args:
        study: a study that is not prepared.
        prepared: the same, prepared.
    """
    compared = {channel.name for channel in prepared.channels}
    efforts = [channel.name for channel in study.channels if channel.kind == "effort"]
    return [name for name in efforts if name not in compared]


def inverse_replay(
    plant: Plant,
    study: Study,
    measured: Measured,
    only: Collection[int] | None = None,
    soft: bool = False,
) -> Replay:
    """Compute the efforts that a plant needs for the measured motion.

    Args:
        plant: the model and its effects; forces that its hooks apply reduce the effort.
        study: a prepared study; see `prepare`.
        measured: the readings of that study.
        only: indices of the episodes to compute; by default all.
        soft: whether dry friction changes its sign before the velocity, as in simulations; see
            `_compile`.

    Returns:
        The predicted efforts and the simulated signals.

    Raises:
        StudyError: the study is not prepared.
    """
    model = _compile(plant, soft)
    dofs = [_dof(model, channel) for channel in study.channels]
    prediction = np.full(len(measured.value), np.nan)
    records = []
    start = 0.0
    for e, episode in enumerate(prepared_episodes(study)):
        if only is not None and e not in only:
            start += episode.duration
            continue
        motion = _true_motion(plant, model, episode.motion)
        effort, record = _inverse_dynamics(plant, model, motion, start)
        for effect in plant.effects.efforts:
            effect(model, record.time, effort)
        for c in range(len(study.channels)):
            at = (measured.episode == e) & (measured.channel == c)
            prediction[at] = episode.samples(c, effort[:, dofs[c]])
        records.append(record)
        start += episode.duration
    return Replay(prediction, tuple(records))


def _true_motion(plant: Plant, model: mujoco.MjModel, measured: Motion) -> Motion:
    """Return the motion of a plant, in which sensors may measure another one."""
    if not plant.effects.motions:
        return measured
    qpos, qvel, qacc = measured.qpos.copy(), measured.qvel.copy(), measured.qacc.copy()
    for effect in plant.effects.motions:
        effect(model, qpos, qvel, qacc)
    return replace(measured, qpos=qpos, qvel=qvel, qacc=qacc)


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


def _compile(plant: Plant, soft: bool = False) -> mujoco.MjModel:
    """Compile a plant for inverse dynamics, without contacts.

    Unless friction is ``soft``, it opposes the measured velocity. In MuJoCo it is a soft constraint
    on a + B v, which changes its sign 1/B before the velocity does. By default this is 10 ms, for
    stability of the simulation. Nothing is integrated here, so that B can be large.
    """
    model: mujoco.MjModel = plant.spec.compile()
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    if not soft:
        model.dof_solref[:] = (0.0, -FRICTION_RATE)
        model.tendon_solref_fri[:] = (0.0, -FRICTION_RATE)
    return model


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

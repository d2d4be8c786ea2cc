"""Inverse dynamics: the efforts of a machine that was moved in closed loop."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap.causes.base import Effects
from reality_gap.check import check_study
from reality_gap.errors import StudyError
from reality_gap.simulation.hypothesis import Plant
from reality_gap.simulation.inverse_dynamics import inverse_replay, left_out, prepare
from reality_gap.simulation.measured_motion import measured_motions
from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.study.measurements import measured
from reality_gap.types import Bools, Floats

ARM = """
<mujoco>
  <option timestep="0.001"/>
  <worldbody>
    <body>
      <joint name="shoulder" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="1.5"/>
      <body name="forearm" pos="0.3 0 0">
        <joint name="elbow" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 0.25 0 0" size="0.02" mass="0.8"/>
      </body>
    </body>
  </worldbody>
  <sensor>
    <jointpos name="angle_shoulder" joint="shoulder"/>
    <jointpos name="angle_elbow" joint="elbow"/>
  </sensor>
</mujoco>
"""
CHANNELS = (
    Channel("angle_shoulder", "angle_shoulder", unit="rad"),
    Channel("angle_elbow", "angle_elbow", unit="rad"),
    Channel("torque_shoulder", "shoulder", unit="N m", kind="effort"),
    Channel("torque_elbow", "elbow", unit="N m", kind="effort"),
)


def rub(spec: mujoco.MjSpec) -> None:
    """Add dry and viscous friction to both joints."""
    spec.joint("shoulder").frictionloss = 0.8
    spec.joint("elbow").frictionloss = 0.3
    spec.joint("elbow").damping[0] = 0.4


def move(seconds: float = 10.0) -> tuple[Floats, Floats, Floats]:
    """Simulate the arm with friction in closed loop; return times, angles and torques at 1 kHz."""
    spec = mujoco.MjSpec.from_string(ARM)
    rub(spec)
    spec.option.timestep = 0.00025
    model = spec.compile()
    model.dof_solref[:] = (0.0005, 1.0)
    data = mujoco.MjData(model)
    time_, angle, torque = [], [], []
    for k in range(round(seconds / 0.00025)):
        t = data.time
        wanted = np.array([0.7 * np.sin(3 * t), 0.9 * np.sin(4.3 * t)])
        data.qfrc_applied[:] = 400 * (wanted - data.qpos) - 20 * data.qvel
        if k % 4 == 0:
            time_.append(t)
            angle.append(data.qpos.copy())
            torque.append(data.qfrc_applied.copy())
        mujoco.mj_step(model, data)
    return np.array(time_), np.array(angle), np.array(torque)


@pytest.fixture(scope="module")
def log() -> tuple[Floats, Floats, Floats]:
    """Return one log for all tests."""
    return move()


@pytest.fixture
def study(log: tuple[Floats, Floats, Floats], tmp_path: Path) -> Study:
    """Return the nominal model, without friction, and the log of the arm with friction."""
    path = tmp_path / "arm.xml"
    path.write_text(ARM, encoding="utf-8")
    time_, angle, torque = log
    noise = 1e-5 * np.random.default_rng(0).standard_normal(angle.shape)
    columns = np.column_stack([angle + noise, torque])
    readings = tuple(Reading(time_, columns[:, c]) for c in range(4))
    episode = Episode("swing", time_, np.zeros((len(time_), 0)), readings)
    return Study("arm", path, CHANNELS, (episode,))


def with_noise(study: Study, position: float, effort: float) -> Study:
    """Return the study with a stated noise of positions [rad] and efforts [N m]."""
    sizes = {"sensor": position, "effort": effort}
    return replace(study, channels=tuple(replace(c, noise=sizes[c.kind]) for c in study.channels))


def with_efforts(study: Study, effort: Floats) -> Study:
    """Return the study with the same measured effort (k,) of both joints."""
    episode = study.episodes[0]
    readings = (*episode.readings[:2], *(Reading(episode.time, effort),) * 2)
    return replace(study, episodes=(replace(episode, readings=readings),))


def errors(study: Study, plant: Plant) -> Floats:
    """Return the RMS error of the predicted torque relative to the RMS torque, by joint."""
    prepared = prepare(study)
    values = measured(prepared)
    prediction = inverse_replay(plant, prepared, values).prediction
    return np.array(
        [
            np.linalg.norm((prediction - values.value)[values.channel == c])
            / np.linalg.norm(values.value[values.channel == c])
            for c in range(len(prepared.channels))
        ]
    )


def test_the_actual_machine_explains_its_torques_but_its_model_does_not(
    study: Study,
) -> None:
    spec = study.spec()
    rub(spec)
    assert np.all(errors(study, Plant(spec, Effects())) < 0.02)
    assert np.all(errors(study, Plant(study.spec(), Effects())) > 0.10)


@pytest.mark.parametrize(
    "stand",
    ['type="sphere" size="0.05" pos="0.3 0.05 0"', 'type="plane" size="1 1 1" pos="0 0 -0.1"'],
)
def test_contacts_whose_depth_positions_do_not_show_change_no_torque(
    study: Study, tmp_path: Path, stand: str
) -> None:
    path = tmp_path / "touching.xml"
    path.write_text(ARM.replace("<worldbody>", f"<worldbody><geom {stand}/>"), encoding="utf-8")
    touching, free = replace(study, model=path), Plant(study.spec(), Effects())
    own = errors(touching, Plant(touching.spec(), Effects()))
    np.testing.assert_array_equal(own, errors(study, free))
    assert not [text for text in check_study(study) if "touch" in text]
    sentences = [text for text in check_study(touching) if "touch" in text]
    assert sentences
    for text in sentences:
        assert "of the measured motion" in text
        assert "without the forces of contacts" in text


def test_speeds_and_forces_of_joints_are_those_of_the_log(
    study: Study, log: tuple[Floats, Floats, Floats]
) -> None:
    """The positions are no readings of the prepared study; half a range a second is no speed."""
    time_, angle, torque = log
    speed = np.sqrt(np.mean(np.gradient(angle, time_, axis=0) ** 2, axis=0))
    force = np.sqrt(np.mean(torque**2, axis=0))

    uses = prepare(study).uses

    for k, joint in enumerate(("shoulder", "elbow")):
        assert uses[joint].speed == pytest.approx(speed[k], rel=0.1)
        assert uses[joint].force == pytest.approx(force[k], rel=0.15)
        assert uses[joint].travel == pytest.approx(np.ptp(angle[:, k]), rel=0.1)


def test_the_noise_of_an_encoder_at_rest_is_no_speed(study: Study) -> None:
    episode = study.episodes[0]
    elbow = Reading(episode.time, 1e-5 * np.random.default_rng(1).standard_normal(10_000))
    readings = (episode.readings[0], elbow, *episode.readings[2:])
    still = replace(study, episodes=(replace(episode, readings=readings),))

    use = prepare(still).uses["elbow"]

    assert use.speed == pytest.approx(1.0)  # half of its range a second
    assert use.travel == pytest.approx(1.0)


def test_what_hooks_apply_needs_no_effort(study: Study) -> None:
    def push(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        data.qfrc_applied[0] += 1.5
        data.xfrc_applied[model.body("forearm").id, 2] += 4.0

    prepared = prepare(with_noise(study, 1e-6, 0.05))
    values = measured(prepared)
    free = inverse_replay(Plant(study.spec(), Effects()), prepared, values)
    effects = Effects()
    effects.add_hook(lambda model: push)
    effects.add_hook(lambda model: push, start=1e3)
    pushed = inverse_replay(Plant(study.spec(), effects), prepared, values)
    change = (pushed.prediction - free.prediction)[values.channel == 0]
    at = values.time[values.channel == 0]
    shoulder, elbow = (
        np.interp(at, study.episodes[0].time, study.episodes[0].readings[j].value) for j in range(2)
    )
    # The axis is y, so a force upwards on x > 0 turns against it.
    lever = 0.3 * np.cos(shoulder) + 0.125 * np.cos(shoulder + elbow)
    np.testing.assert_allclose(change, 4.0 * lever - 1.5, atol=0.01)


def test_dry_friction_opposes_the_measured_velocity_even_when_slow(tmp_path: Path) -> None:
    path = tmp_path / "mass.xml"
    path.write_text(
        "<mujoco><option gravity='0 0 0'/><worldbody><body><joint name='x' type='slide'/>"
        "<geom size='0.1' mass='5'/></body></worldbody>"
        "<sensor><jointpos name='p' joint='x'/></sensor></mujoco>",
        encoding="utf-8",
    )
    at = 0.0003 + np.arange(0, 20, 0.002)
    # Slow and much accelerated: at the default of MuJoCo, friction would lead by 10 ms.
    position = 0.002 * np.sin(2 * np.pi * at)
    velocity = 0.002 * 2 * np.pi * np.cos(2 * np.pi * at)
    effort = -5 * (2 * np.pi) ** 2 * position + 3.0 * np.sign(velocity)
    channels = (Channel("p", "p", unit="m"), Channel("f", "x", unit="N", kind="effort"))
    readings = (Reading(at, position), Reading(at, effort))
    study = Study("mass", path, channels, (Episode("e", at, np.zeros((len(at), 0)), readings),))
    spec = study.spec()
    spec.joint("x").frictionloss = 3.0
    assert errors(study, Plant(spec, Effects()))[0] < 0.01


def test_samples_of_a_standing_joint_are_left_out(study: Study) -> None:
    episode = study.episodes[0]
    standing = (episode.readings[1].time > 3.0) & (episode.readings[1].time < 6.0)
    still = np.where(standing, episode.readings[1].value[standing][0], episode.readings[1].value)
    readings = list(episode.readings)
    readings[1] = Reading(episode.readings[1].time, still)
    changed = replace(study, episodes=(replace(episode, readings=tuple(readings)),))
    shoulder, elbow = prepare(changed).episodes[0].readings
    assert np.sum((shoulder.time > 3.2) & (shoulder.time < 5.8)) > 30
    assert np.sum((elbow.time > 3.2) & (elbow.time < 5.8)) == 0


def test_the_effort_of_a_joint_that_rests_is_left_out_with_a_warning(study: Study) -> None:
    episode = study.episodes[0]
    readings = list(episode.readings)
    rest = 1e-5 * np.random.default_rng(1).standard_normal(len(readings[1].time))
    readings[1] = replace(readings[1], value=rest)
    resting = replace(study, episodes=(replace(episode, readings=tuple(readings)),))
    assert left_out(study, prepare(study)) == []
    assert left_out(resting, prepare(resting)) == ["torque_elbow"]
    prepared = prepare(resting)
    assert [channel.name for channel in prepared.channels] == ["torque_shoulder"]
    assert np.isfinite(errors(resting, Plant(study.spec(), Effects()))).all()
    assert "the torque_elbow is not compared" in " ".join(check_study(resting))
    readings[0] = replace(readings[0], value=rest)
    still = replace(study, episodes=(replace(episode, readings=tuple(readings)),))
    with pytest.raises(StudyError, match="joints of all efforts hardly move"):
        prepare(still)


def test_a_joint_whose_encoder_reads_one_value_rests(study: Study) -> None:
    episode = study.episodes[0]
    readings = list(episode.readings)
    readings[1] = replace(readings[1], value=np.full_like(readings[1].value, 0.3))
    resting = replace(study, episodes=(replace(episode, readings=tuple(readings)),))
    assert left_out(resting, prepare(resting)) == ["torque_elbow"]
    assert prepare(resting).episodes[0].motion.still[:, 1].all()


def test_samples_near_a_gap_of_a_reading_are_left_out(study: Study) -> None:
    """The others have the values that they have without the gap."""
    [whole], [episode] = prepare(study).episodes, study.episodes
    cut = list(episode.readings)
    for c in (0, 1, 3):  # the positions, and the torque of the elbow
        seen = (cut[c].time < 4.0) | (cut[c].time > 7.0)
        cut[c] = Reading(cut[c].time[seen], cut[c].value[seen])
    [found] = prepare(replace(study, episodes=(replace(episode, readings=tuple(cut)),))).episodes
    assert found.motion.cutoff == pytest.approx(whole.motion.cutoff, rel=0.2)
    margin = 2.9 / found.motion.cutoff
    for reading in found.readings:
        assert ((reading.time < 4.0 - margin) | (reading.time > 7.0 + margin)).all()
        assert (reading.time < 4.0).sum() > 10
        assert (reading.time > 7.0).sum() > 10
    with_gap = replace(study, episodes=(replace(episode, readings=tuple(cut)),))
    for joint, use in prepare(with_gap).uses.items():
        assert use.travel == pytest.approx(prepare(study).uses[joint].travel, rel=0.1)
    spec = study.spec()
    rub(spec)
    assert np.all(errors(with_gap, Plant(spec, Effects())) < 0.02)


@pytest.mark.parametrize("position_noise", [1e-6, 3e-4])
def test_the_kept_samples_of_noise_are_independent(study: Study, position_noise: float) -> None:
    """Noise of efforts, and that of positions in computed efforts, is white behind the filter."""
    rng, time = np.random.default_rng(1), study.episodes[0].time
    hum = 2 * np.sin(2 * np.pi * 5 * time)
    stated = with_efforts(with_noise(study, position_noise, 0.05), hum)
    angles = [
        replace(r, value=r.value + position_noise * rng.standard_normal(len(time)))
        for r in stated.episodes[0].readings[:2]
    ]
    shaken = replace(stated.episodes[0], readings=(*angles, *stated.episodes[0].readings[2:]))
    clean, other = prepare(stated), prepare(replace(stated, episodes=(shaken,)))
    elsewhere = replace(clean.episodes[0], motion=other.episodes[0].motion)
    moved = replace(clean, episodes=(elsewhere,))
    noisy = prepare(with_efforts(stated, hum + 0.05 * rng.standard_normal(len(time))))
    plant = Plant(study.spec(), Effects())
    before, after = (
        inverse_replay(plant, one, measured(clean)).prediction for one in (clean, moved)
    )
    for c, channel in enumerate(clean.channels):
        kept = clean.episodes[0].readings[c]
        of_effort = noisy.episodes[0].readings[c].value - kept.value
        of_position = (after - before)[measured(clean).channel == c]
        left = of_effort + of_position
        rate = 1.0 / np.median(np.diff(kept.time))
        assert 10.0 < rate < 40.0
        assert len(kept.time) > 0.7 * rate * 10.0
        assert abs(np.corrcoef(left[1:], left[:-1])[0, 1]) < 0.25
        assert channel.noise == pytest.approx(np.std(left), rel=0.2)


def test_noise_of_positions_counts_as_noise_of_efforts(study: Study) -> None:
    few, much = (prepare(with_noise(study, noise, 1e-6)) for noise in (1e-6, 1e-4))
    for less, more in zip(few.channels, much.channels, strict=True):
        assert less.noise is not None
        assert more.noise is not None
        assert more.noise > 3.0 * less.noise


@pytest.mark.parametrize("effort_noise", [0.05, 0.003])
def test_noise_of_positions_hardly_hides_what_is_slow(study: Study, effort_noise: float) -> None:
    """A constant torque is seen about as well as without noise of positions.

    That noise grows with the square of the frequency and is small below 1 Hz.
    """

    def visibility(position_noise: float) -> float:
        prepared = prepare(with_noise(study, position_noise, effort_noise))
        seen = prepared.episodes[0].samples(1, np.ones(len(prepared.episodes[0].motion.time)))
        return float(np.linalg.norm(seen)) / prepared.channels[1].noise

    assert visibility(3e-5) > 0.7 * visibility(1e-7)


def test_a_long_log_is_replayed_in_less_than_a_second(study: Study) -> None:
    prepared = prepare(study)
    values = measured(prepared)
    plant = Plant(study.spec(), Effects())
    begin = time.perf_counter()
    inverse_replay(plant, prepared, values)
    assert time.perf_counter() - begin < 1.0 * 10.0 / 24.0


def test_hooks_know_the_time_of_the_study(study: Study) -> None:
    seen = []
    effects = Effects()
    effects.add_hook(lambda model: lambda model, data: seen.append(data.time), start=15.0, end=16.0)
    twice = prepare(replace(study, episodes=study.episodes * 2))
    replay = inverse_replay(Plant(study.spec(), effects), twice, measured(twice))
    assert len(replay.records) == 2
    assert 15.0 <= min(seen) < 15.1
    assert 15.9 < max(seen) <= 16.0


def test_a_study_that_was_not_prepared_is_refused(study: Study) -> None:
    prepared = prepare(study)
    plain = (replace(study.episodes[0], readings=prepared.episodes[0].readings),)
    raw = replace(prepared, episodes=plain)
    with pytest.raises(StudyError, match="was not prepared"):
        inverse_replay(Plant(study.spec(), Effects()), raw, measured(raw))


def test_a_joint_that_is_not_measured_is_named(study: Study) -> None:
    blind = replace(
        study,
        channels=study.channels[1:],
        episodes=(replace(study.episodes[0], readings=study.episodes[0].readings[1:]),),
    )
    with pytest.raises(StudyError, match="missing: shoulder"):
        prepare(blind)


def test_logs_without_information_are_refused(study: Study) -> None:
    episode = study.episodes[0]
    short = tuple(Reading(r.time[:300], r.value[:300]) for r in episode.readings)
    with pytest.raises(StudyError, match="too short"):
        prepare(replace(study, episodes=(replace(episode, readings=short),)))
    quiet = (*episode.readings[:3], Reading(episode.time, np.full(len(episode.time), 2.0)))
    with pytest.raises(StudyError, match="torque_elbow is constant"):
        prepare(replace(study, episodes=(replace(episode, readings=quiet),)))


def test_short_episodes_are_long_enough_together(study: Study) -> None:
    """Each of 30 lasts 10 periods of the cutoff, of which 6 are left out at its ends."""
    rng, episode, parts = np.random.default_rng(4), study.episodes[0], 30
    noisy = tuple(
        replace(r, value=r.value + 1e-3 * rng.standard_normal(len(r.value)))
        for r in episode.readings[:2]
    )
    episode = replace(episode, readings=(*noisy, *episode.readings[2:]))
    length = np.ptp(episode.time) / parts
    short = replace(study, episodes=tuple(_part(episode, i * length, length) for i in range(parts)))

    with pytest.raises(
        StudyError, match=r"last 0\.16. s together, .*; at least 0\.25 s are needed"
    ):
        measured_motions(range(2), short.episodes[:2], np.full(2, 1e-3), 24.0, 1e-3)
    prepared = prepare(short)
    counts = np.array([[len(r.time) for r in e.readings] for e in prepared.episodes])

    assert counts.shape == (parts, 2)
    assert counts.max() < 10
    assert counts.sum(axis=0).min() > 200
    spec = study.spec()
    rub(spec)
    assert np.all(errors(short, Plant(spec, Effects())) < 0.05)
    assert np.all(errors(short, Plant(study.spec(), Effects())) > 0.10)


@pytest.mark.parametrize("parts", [2, 40, 50])
def test_a_joint_may_stand_still_in_an_episode(study: Study, parts: int) -> None:
    """In 50 short episodes of noisy positions, some have no sample in which a joint moves."""
    rng, episode = np.random.default_rng(4), study.episodes[0]
    shoulder, elbow, *efforts = episode.readings
    still = np.where(episode.time < 5.0, shoulder.value, shoulder.value[4999])
    positions = [replace(shoulder, value=still if parts == 2 else shoulder.value), elbow]
    noisy = [
        replace(r, value=r.value + 1e-3 * rng.standard_normal(len(r.value))) for r in positions
    ]
    episode = replace(episode, readings=(*noisy, *efforts))
    length = np.ptp(episode.time) / parts
    cut = tuple(_part(episode, i * length, length) for i in range(parts))

    prepared = prepare(replace(study, episodes=cut))
    counts = np.array([[len(r.time) for r in e.readings] for e in prepared.episodes])
    prediction = inverse_replay(
        Plant(study.spec(), Effects()), prepared, measured(prepared)
    ).prediction

    assert counts.min() == 0
    assert counts.sum(axis=0).min() > 20
    assert np.isfinite(prediction).all()


def _part(episode: Episode, begin: float, length: float) -> Episode:
    """Return a part of an episode, with its own time."""

    def cut(time: Floats) -> Bools:
        return np.asarray((time >= begin) & (time < begin + length))

    return replace(
        episode,
        name=f"from {begin:g} s",
        time=episode.time[cut(episode.time)] - begin,
        readings=tuple(
            Reading(r.time[cut(r.time)] - begin, r.value[cut(r.time)]) for r in episode.readings
        ),
    )


@pytest.mark.parametrize("every", [1, 5])
def test_noise_of_positions_does_not_make_inertias_too_small(study: Study, every: int) -> None:
    """Accelerations of noise are in the regressor, too: least squares would find too little."""
    rng, episode, sizes = np.random.default_rng(3), study.episodes[0], (3e-4, 0.3)
    noises = np.repeat(sizes, 2)
    readings = [Reading(r.time[::every], r.value[::every]) for r in episode.readings]
    time = readings[0].time
    noisy = tuple(
        replace(r, value=r.value + noise * rng.standard_normal(len(time)))
        for r, noise in zip(readings, noises, strict=True)
    )
    log = Episode(episode.name, time, np.zeros((len(time), 0)), noisy)
    prepared = prepare(with_noise(replace(study, episodes=(log,)), *sizes))
    actual, heavier = study.spec(), study.spec()
    rub(actual)
    rub(heavier)
    inertia = 0.8 * 0.25**2 / 3
    heavier.joint("elbow").armature = inertia
    values = measured(prepared)
    known, changed = (
        inverse_replay(Plant(spec, Effects()), prepared, values).prediction
        for spec in (actual, heavier)
    )
    weight = 1.0 / np.array([c.noise for c in prepared.channels])[values.channel]
    column, residual = weight * (changed - known), weight * (values.value - known)
    found, error = column @ residual / (column @ column), 1.0 / np.linalg.norm(column)
    assert error < 0.1
    assert abs(found) < 3.0 * error + 0.02

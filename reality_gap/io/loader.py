"""Loader: reads STUDY.yaml, its model and its logs, and checks them against one another."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import mujoco
import numpy as np

from reality_gap.errors import StudyError
from reality_gap.io.logs import read_episode
from reality_gap.io.plausibility import wrong_unit
from reality_gap.io.quaternions import continuous
from reality_gap.io.schema import Line, StudyFile, read_study_file
from reality_gap.io.validation import actuator_names, check_against_model, measured_joints
from reality_gap.study.data import Channel, Episode, Initial, Study, load_untrusted_spec
from reality_gap.study.first_readings import with_read_states
from reality_gap.study.restarts import with_restarts

SUFFIXES = {3: ("x", "y", "z"), 4: ("w", "x", "y", "z")}
"""Names of a sensor's components, by their number; for other numbers 0, 1, ..."""

MAX_STEPS = 1e8
"""Largest number of physics steps of one episode: an hour at 40 us."""

_QUATERNION = (int(mujoco.mjtSensor.mjSENS_FRAMEQUAT), int(mujoco.mjtSensor.mjSENS_BALLQUAT))


def load_study(path: Path | str) -> Study:
    """Read a study and convert all numbers to SI units.

    Args:
        path: path of STUDY.yaml.

    Returns:
        The study with its logs.

    Raises:
        StudyError: the study, its model or a log is wrong; one sentence says what is wrong, where,
            and what would be valid.
    """
    file = read_study_file(Path(path))
    model = load_untrusted_spec(file.model, file.path.parent).copy().compile()
    check_against_model(file, model)
    channels = _channels(file)
    episodes = _episodes(file, model)
    initial = Initial(file.joints or {}, file.settle, file.restart)
    study = Study(file.name, file.model, channels, episodes, initial, file.absolute_encoders)
    if file.joints is None:
        study = _start_at_first_readings(file, model, study)
    _check_constant_sensors(file, study, model)
    _check_steps(file, study, model)
    fault = wrong_unit(study)
    if fault:
        raise StudyError(f"{file.path}: {fault}")
    return study


def _lines(file: StudyFile) -> list[tuple[Literal["sensor", "effort"], str, Line]]:
    """Return kind, name and line of all measurements, in the order of the study's channels."""
    return [
        *(("sensor", name, line) for name, line in file.sensors.items()),
        *(("effort", name, line) for name, line in file.efforts.items()),
    ]


def _channels(file: StudyFile) -> tuple[Channel, ...]:
    channels = []
    for kind, name, line in _lines(file):
        label = name if kind == "sensor" else f"effort of {name}"
        count = len(line.columns)
        for i in range(count):
            suffix = "" if count == 1 else f".{SUFFIXES.get(count, range(count))[i]}"
            channels.append(Channel(label + suffix, name, i, line.unit.si, line.noise_in_si, kind))
    return tuple(channels)


def _episodes(file: StudyFile, model: mujoco.MjModel) -> tuple[Episode, ...]:
    actuators = actuator_names(model) if file.actuators else ()
    measured = tuple((f"{kind} {name}", line) for kind, name, line in _lines(file))
    stems = [Path(files.names[0]).stem for files in file.episodes]
    episodes = []
    for files, stem in zip(file.episodes, stems, strict=True):
        name = stem if stems.count(stem) == 1 else files.names[0]
        episode = read_episode(file, files, name, actuators, measured)
        if any(other.log for other in file.episodes) and not files.log:
            episode = replace(episode, log=name)
        if not actuators:
            episode = replace(episode, command=np.zeros((len(episode.time), model.nu)))
        episodes.append(_with_quaternions(file, model, episode))
    return tuple(episodes)


def _with_quaternions(file: StudyFile, model: mujoco.MjModel, episode: Episode) -> Episode:
    readings, first = list(episode.readings), 0
    for name, line in file.sensors.items():
        if int(model.sensor(name).type[0]) in _QUATERNION:
            try:
                readings[first : first + 4] = continuous(name, readings[first : first + 4])
            except StudyError as error:
                raise StudyError(f"{file.path}, episode {episode.name}: {error}") from error
        first += len(line.columns)
    return replace(episode, readings=tuple(readings))


def _start_at_first_readings(file: StudyFile, model: mujoco.MjModel, study: Study) -> Study:
    joints = measured_joints(file, model)
    for episode in study.episodes:
        for channel, reading in zip(study.channels, episode.readings, strict=True):
            if channel.kind != "effort" and channel.sensor in joints and not len(reading.time):
                raise StudyError(
                    f"{file.path}: initial.joints is first_reading, but episode {episode.name} "
                    f"has no reading of {channel.name}"
                )
    study = with_read_states(study, joints)
    return with_restarts(study, model, file.restart or 0.0)


def _check_steps(file: StudyFile, study: Study, model: mujoco.MjModel) -> None:
    """Refuse a replay that would take far too long."""
    longest = study.initial.settle + max(episode.duration for episode in study.episodes)
    if not longest <= MAX_STEPS * model.opt.timestep:
        raise StudyError(
            f"{file.path}: {longest:g} s with settling are more than {MAX_STEPS:g} steps of the "
            f"model's timestep, {model.opt.timestep:g} s; shorten settle, or enlarge timestep"
        )


def _check_constant_sensors(file: StudyFile, study: Study, model: mujoco.MjModel) -> None:
    """Refuse sensors without any reading, and sensors with a constant reading.

    A joint may rest while efforts are measured; their inverse dynamics need its position.
    """
    constants: dict[str, list[bool]] = {}
    resting = [f"sensor {name}" for name in measured_joints(file, model)] if study.inverse else []
    for i, channel in enumerate(study.channels):
        values = np.concatenate([episode.readings[i].value for episode in study.episodes])
        if not len(values):
            raise StudyError(f"{file.path}: {channel.name} has no reading at all; remove it")
        key = f"{channel.kind} {channel.sensor}"
        constants.setdefault(key, []).append(np.ptp(values) == 0.0)
    for what, constant in constants.items():
        if all(constant) and what not in resting:
            raise StudyError(
                f"{file.path}: {what} has the same value in every row of every episode, as a dead "
                "sensor does; remove it from the study"
            )

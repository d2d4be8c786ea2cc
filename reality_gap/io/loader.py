"""Reading a study: STUDY.yaml, its model and its logs, checked against one another."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import mujoco
import numpy as np

from reality_gap.errors import StudyError
from reality_gap.io.logs import read_episode
from reality_gap.io.plausibility import impossible
from reality_gap.io.quaternions import continuous
from reality_gap.io.schema import Line, StudyFile, read_study_file
from reality_gap.io.validation import actuator_names, match, measured_joints
from reality_gap.study.data import Channel, Episode, Initial, Study, load_strange_spec

SUFFIXES = {3: ("x", "y", "z"), 4: ("w", "x", "y", "z")}
"""What the components of a sensor are called, by their number; else 0, 1, ..."""

MAX_STEPS = 1e8
"""Most physics steps of one episode: an hour at 40 us."""

_QUATERNION = (int(mujoco.mjtSensor.mjSENS_FRAMEQUAT), int(mujoco.mjtSensor.mjSENS_BALLQUAT))


def load_study(path: Path | str) -> Study:
    """The study that a STUDY.yaml describes, every number in SI units.

    Raises:
        StudyError: in one sentence, what is wrong, where, and what would be valid.
    """
    file = read_study_file(Path(path))
    model = load_strange_spec(file.model, file.path.parent).copy().compile()
    match(file, model)
    channels = _channels(file)
    episodes = _episodes(file, model)
    if file.joints is None:
        episodes = _begin_at_first_readings(file, model, channels, episodes)
    initial = Initial(file.joints or {}, file.settle)
    study = Study(file.name, file.model, channels, episodes, initial)
    _check_alive(file, study)
    _check_steps(file, study, model)
    fault = impossible(study)
    if fault:
        raise StudyError(f"{file.path}: {fault}")
    return study


def _lines(file: StudyFile) -> list[tuple[Literal["sensor", "effort"], str, Line]]:
    """What was measured, in the order of the study's channels."""
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
        episode = replace(episode, joints=files.joints)
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


def _begin_at_first_readings(
    file: StudyFile,
    model: mujoco.MjModel,
    channels: tuple[Channel, ...],
    episodes: tuple[Episode, ...],
) -> tuple[Episode, ...]:
    joints = measured_joints(file, model)
    begun = []
    for episode in episodes:
        first = {}
        for channel, reading in zip(channels, episode.readings, strict=True):
            if channel.kind == "effort" or channel.sensor not in joints:
                continue
            if not len(reading.time):
                raise StudyError(
                    f"{file.path}: initial.joints is first_reading, but episode {episode.name} "
                    f"has no reading of {channel.name}"
                )
            first[joints[channel.sensor]] = float(reading.value[0])
        begun.append(replace(episode, joints=first | dict(episode.joints)))
    return tuple(begun)


def _check_steps(file: StudyFile, study: Study, model: mujoco.MjModel) -> None:
    """Refuse what nobody could wait for."""
    longest = study.initial.settle + max(episode.duration for episode in study.episodes)
    if not longest <= MAX_STEPS * model.opt.timestep:
        raise StudyError(
            f"{file.path}: {longest:g} s with settling would be more than {MAX_STEPS:g} steps of "
            f"{model.opt.timestep:g} s, the model's timestep; shorten settle, or enlarge timestep"
        )


def _check_alive(file: StudyFile, study: Study) -> None:
    """Refuse sensors that never read anything, or always the same."""
    still: dict[str, list[bool]] = {}
    for i, channel in enumerate(study.channels):
        values = np.concatenate([episode.readings[i].value for episode in study.episodes])
        if not len(values):
            raise StudyError(f"{file.path}: {channel.name} has no reading at all; remove it")
        still.setdefault(f"{channel.kind} {channel.sensor}", []).append(np.ptp(values) == 0.0)
    for what, constant in still.items():
        if all(constant):
            raise StudyError(
                f"{file.path}: {what} reads the same in every row of every episode, as a dead "
                "sensor does; remove it from the study"
            )

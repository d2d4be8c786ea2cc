"""Writes the study of a real machine: logs, the honest drawing, and STUDY.yaml; never the truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hidden_plants.build import build
from hidden_plants.logs import study_text, write_logs
from hidden_plants.loop import SETTLE, Task, Trace, run_task
from hidden_plants.machine import ASSETS, Machine, load
from hidden_plants.motion import EPISODE, PERIOD, episodes
from hidden_plants.nuisance import Mismatch, Nuisance, draw_mismatch
from hidden_plants.readings import clean_readings, noisy_readings, postures
from hidden_plants.robot import Readings
from hidden_plants.secret import Effect, Secret
from hidden_plants.types import Floats

CAMERA_EVERY = 5
"""Rows of the log from one look of the camera to the next, 10 Hz."""
LATE = 0.010
"""How long after a command the sensors are read, half a period: a command makes tensions jump."""


@dataclass(frozen=True)
class EpisodeTruth:
    """One episode as it really was.

    Attributes:
        time: of the commands (n,) [s].
        sensor_time: of the readings of the wires (n,) [s].
        camera_time: of the camera's looks (m,) [s].
        command: target lengths (n, wires) [m].
        clean: readings without noise, by sensor: lengths [m] and tensions [N] (n,),
            marker_position (m, 3) [m], marker_orientation (m, 4).
        noisy: what was written.
        baseline: readings without noise of the same machine without the hidden effects; empty if
            it was not asked for.
        qpos: true joint positions at ``sensor_time`` (n, joints) [rad].
        start: of the episode in log time, episodes end to end [s].
        duration: [s].
    """

    time: Floats
    sensor_time: Floats
    camera_time: Floats
    command: Floats
    clean: Readings
    noisy: Readings
    baseline: Readings
    qpos: Floats
    start: float
    duration: float


@dataclass(frozen=True)
class Truth:
    """What whoever diagnoses must not see.

    Attributes:
        secret: the hidden effects.
        seed: of mismatches, noise and jitter.
        machine: "elbow" or "arm".
        episodes: as they were, in the order of the log.
    """

    secret: Secret
    seed: int
    machine: str
    episodes: tuple[EpisodeTruth, ...]


@dataclass(frozen=True)
class Plant:
    """One real machine: a drawing, effects, and the seed of everything random in it."""

    machine: Machine
    effects: tuple[Effect, ...]
    seed: int
    nuisance: Nuisance
    baseline: bool = True

    @property
    def own_camera_file(self) -> bool:
        """Whether the camera writes a file of its own, with times of its own."""
        return bool(np.random.default_rng([self.seed, 4]).integers(2))


def perform(
    plant: Plant, index: int, initial: Floats, targets: Floats, time: Floats, start: float
) -> EpisodeTruth:
    """Let the plant do one episode: ``targets`` (n, wires) [m] given about at ``time`` (n,) [s]."""
    rng = np.random.default_rng([plant.seed, 2, index])
    nuisance = plant.nuisance
    duration = float(time[-1]) + PERIOD
    late = rng.uniform(-nuisance.jitter, nuisance.jitter, len(time))
    true_time = np.maximum.accumulate(np.where(time > 0.0, time + late, 0.0))
    sensor_time = time + LATE + rng.uniform(-nuisance.jitter, nuisance.jitter, len(time))
    camera_time = sensor_time[::CAMERA_EVERY]
    if plant.own_camera_file:
        looks = np.arange(0.013, duration - 0.02, CAMERA_EVERY * PERIOD)
        camera_time = looks + rng.uniform(-nuisance.jitter, nuisance.jitter, len(looks))
    slip = draw_mismatch(plant.machine, nuisance, np.random.default_rng([plant.seed, 1]))
    task = Task(true_time, targets, initial, duration, start)
    clean, trace = _do(plant.machine, slip, plant.effects, task, sensor_time, camera_time)
    baseline = clean
    if plant.effects and not plant.baseline:
        baseline = {}
    elif plant.effects:
        baseline = _do(plant.machine, slip, (), task, sensor_time, camera_time)[0]
    noise = np.random.default_rng([plant.seed, 3, index])
    return EpisodeTruth(
        time=true_time,
        sensor_time=sensor_time,
        camera_time=camera_time,
        command=targets,
        clean=clean,
        noisy=noisy_readings(clean, nuisance, noise),
        baseline=baseline,
        qpos=postures(trace, sensor_time),
        start=start,
        duration=duration,
    )


def _do(
    machine: Machine,
    slip: Mismatch,
    effects: tuple[Effect, ...],
    task: Task,
    sensor_time: Floats,
    camera_time: Floats,
) -> tuple[Readings, Trace]:
    robot = build(machine, slip, effects)
    trace = run_task(robot, task)
    return clean_readings(robot, trace, sensor_time, camera_time), trace


def write_study(
    folder: Path,
    secret: Secret,
    seed: int,
    machine: str = "elbow",
    assets: Path = ASSETS,
    seconds: float = 20.0,
    nuisance: Nuisance | None = None,
    baseline: bool = True,
) -> Truth:
    """Run the machine with the secret in it and write its study into ``folder``.

    Writes model.xml, episode_*.csv (commands), sensors_*.csv, camera_*.csv if the camera has its
    own clock, and STUDY.yaml last. The truth is returned only.

    Args:
        folder: made if it is missing.
        secret: the hidden effects, and the motion of the library that is done.
        seed: of mismatches, noise and jitter; same seed, same bytes.
        machine: "elbow" or "arm".
        assets: the folder of elbow.xml and arm.xml.
        seconds: length of the log [s], rounded to whole episodes.
        nuisance: how far machine and sensors are off; the usual amount if not given.
        baseline: whether the truth holds the same machine without its effects.
    """
    drawing = load(machine, assets)
    plant = Plant(drawing, secret.effects, seed, nuisance or Nuisance(), baseline)
    folder.mkdir(parents=True, exist_ok=True)
    done: list[EpisodeTruth] = []
    plans = episodes(drawing, secret.motion, seconds)
    for k, (initial, targets) in enumerate(plans):
        time = PERIOD * np.arange(len(targets), dtype=np.float64)
        done.append(perform(plant, k, initial, targets, time, k * EPISODE[machine]))
        _write_logs(folder, plant, k, done[-1])
    (folder / "model.xml").write_text(drawing.xml)
    _write_study_file(folder, plant, len(done), plans[0][0])
    return Truth(secret, seed, machine, tuple(done))


def run(
    folder: Path,
    secret: Secret,
    seed: int,
    time: Floats,
    command: Floats,
    machine: str = "elbow",
    assets: Path = ASSETS,
    nuisance: Nuisance | None = None,
) -> EpisodeTruth:
    """The same robot does one more motion, appended to the study in ``folder`` as an episode.

    It starts at the posture where all episodes of the study start; the first command is held until
    it rests.

    Args:
        folder: of a study that `write_study` wrote with the same secret, seed and nuisance.
        secret, seed, machine, assets, nuisance: as for `write_study`.
        time: of the commands (n,) [s], rising from 0.
        command: target lengths (n, wires) [m], in the order of the model's actuators.
    """
    drawing = load(machine, assets)
    plant = Plant(drawing, secret.effects, seed, nuisance or Nuisance(), baseline=False)
    if not (folder / "STUDY.yaml").is_file():
        raise ValueError(f"no study in {folder}; write_study makes one")
    logs = sorted(folder.glob("episode_*.csv"))
    ends = [float(np.loadtxt(log, delimiter=",", skiprows=1, usecols=0)[-1]) for log in logs]
    start = sum(round(end / PERIOD) * PERIOD + PERIOD for end in ends)
    initial = episodes(drawing, secret.motion, EPISODE[machine])[0][0]
    done = perform(plant, len(logs), initial, np.asarray(command), np.asarray(time), start)
    _write_logs(folder, plant, len(logs), done)
    _write_study_file(folder, plant, len(logs) + 1, initial)
    return done


def _write_logs(folder: Path, plant: Plant, index: int, done: EpisodeTruth) -> None:
    write_logs(
        folder,
        index,
        plant.machine,
        done.time,
        done.command,
        done.sensor_time,
        done.camera_time,
        done.noisy,
        plant.own_camera_file,
    )


def _write_study_file(folder: Path, plant: Plant, episodes: int, initial: Floats) -> None:
    text = study_text(
        plant.machine, plant.nuisance, episodes, initial, SETTLE, plant.own_camera_file
    )
    (folder / "STUDY.yaml").write_text(text)

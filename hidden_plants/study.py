"""Writer of studies: logs, nominal model and STUDY.yaml of a robot with hidden effects."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hidden_plants.build import build
from hidden_plants.logs import study_text, write_logs
from hidden_plants.loop import SETTLE, Task, run_task
from hidden_plants.machine import ASSETS, Machine, load
from hidden_plants.motion import EPISODE, PERIOD, episodes
from hidden_plants.nuisance import Nuisance, sample_mismatch
from hidden_plants.readings import clean_readings, noisy_readings, postures
from hidden_plants.robot import Readings
from hidden_plants.secret import Effect, Secret
from hidden_plants.types import Floats

CAMERA_EVERY = 5
"""Rows of the log between two marker observations, so that the camera has 10 Hz."""
SENSOR_DELAY = 0.010
"""Delay of the readings after the commands [s]: half a period, as tensions jump at a command."""


@dataclass(frozen=True)
class EpisodeTruth:
    """True signals of one episode.

    Attributes:
        time: of the commands (n,) [s].
        sensor_time: of the readings of lengths and tensions (n,) [s].
        camera_time: of the marker observations (m,) [s].
        command: target lengths (n, tendons) [m].
        clean: readings without noise, by sensor: lengths [m] and tensions [N] (n,),
            marker_position (m, 3) [m], marker_orientation (m, 4).
        noisy: readings with noise, as written to the logs.
        baseline: readings without noise of the same robot without the hidden effects; empty if
            not requested.
        qpos: joint positions at ``sensor_time`` (n, joints) [rad].
        start: of the episode in log time, episodes end to end [s].
        duration: of the episode [s].
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
    """Truth about a study, which the diagnosis must not get.

    Attributes:
        secret: the hidden effects.
        seed: of mismatches, noise and jitter.
        machine: "elbow" or "arm".
        episodes: true signals, in the order of the log.
    """

    secret: Secret
    seed: int
    machine: str
    episodes: tuple[EpisodeTruth, ...]


@dataclass(frozen=True)
class Plant:
    """One robot: nominal model, hidden effects, and the seed of its mismatch, noise and jitter."""

    machine: Machine
    effects: tuple[Effect, ...]
    seed: int
    nuisance: Nuisance
    baseline: bool = True

    @property
    def own_camera_file(self) -> bool:
        """Whether the camera has a clock and a file of its own."""
        return bool(np.random.default_rng([self.seed, 4]).integers(2))


def perform(
    plant: Plant, index: int, initial: Floats, targets: Floats, time: Floats, start: float
) -> EpisodeTruth:
    """Simulate one episode of the plant.

    Args:
        plant: robot and seed.
        index: of the episode, for the random numbers.
        initial: joint positions at the start of the settling time (joints,) [rad].
        targets: commanded lengths (n, tendons) [m].
        time: nominal instants of the commands (n,) [s]; the true ones have jitter.
        start: of the episode in log time [s].

    Returns:
        The true signals.
    """
    rng = np.random.default_rng([plant.seed, 2, index])
    nuisance = plant.nuisance
    duration = float(time[-1]) + PERIOD
    jitter = rng.uniform(-nuisance.jitter, nuisance.jitter, len(time))
    true_time = np.maximum.accumulate(np.where(time > 0.0, time + jitter, 0.0))
    sensor_time = time + SENSOR_DELAY + rng.uniform(-nuisance.jitter, nuisance.jitter, len(time))
    camera_time = sensor_time[::CAMERA_EVERY]
    if plant.own_camera_file:
        clock = np.arange(0.013, duration - 0.02, CAMERA_EVERY * PERIOD)
        camera_time = clock + rng.uniform(-nuisance.jitter, nuisance.jitter, len(clock))
    mismatch = sample_mismatch(plant.machine, nuisance, np.random.default_rng([plant.seed, 1]))
    task = Task(true_time, targets, initial, duration, start)
    robot = build(plant.machine, mismatch, plant.effects)
    trace = run_task(robot, task)
    clean = clean_readings(robot, trace, sensor_time, camera_time)
    baseline = clean if not plant.effects else {}
    if plant.effects and plant.baseline:
        robot = build(plant.machine, mismatch)
        baseline = clean_readings(robot, run_task(robot, task), sensor_time, camera_time)
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
    """Simulate a robot with hidden effects and write its study.

    Writes episode_*.csv (commands), sensors_*.csv, camera_*.csv if the camera has its own clock,
    model.xml, and STUDY.yaml last.

    Args:
        folder: of the study; created if missing.
        secret: hidden effects, and the motion of the library.
        seed: of mismatches, noise and jitter; the same seed gives the same bytes.
        machine: "elbow" or "arm".
        assets: folder of elbow.xml and arm.xml.
        seconds: length of the log [s], rounded to whole episodes.
        nuisance: sizes of mismatches and noise; the defaults of `Nuisance` if None.
        baseline: whether to simulate the same robot without hidden effects, too.

    Returns:
        The truth, which is not written to the folder.
    """
    nominal = load(machine, assets)
    plant = Plant(nominal, secret.effects, seed, nuisance or Nuisance(), baseline)
    folder.mkdir(parents=True, exist_ok=True)
    done: list[EpisodeTruth] = []
    plans = episodes(nominal, secret.motion, seconds)
    for k, (initial, targets) in enumerate(plans):
        time = PERIOD * np.arange(len(targets), dtype=np.float64)
        done.append(perform(plant, k, initial, targets, time, k * EPISODE[machine]))
        _write_logs(folder, plant, k, done[-1])
    (folder / "model.xml").write_text(nominal.xml)
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
    """Simulate one more motion of the same robot and append it to its study as an episode.

    It starts at the initial posture of the study's episodes; the first command is held during the
    settling time.

    Args:
        folder: of a study that `write_study` wrote with the same secret, seed and nuisance.
        secret, seed, machine, assets, nuisance: as for `write_study`.
        time: of the commands (n,) [s], increasing from 0.
        command: target lengths (n, tendons) [m], in the order of the model's actuators.

    Returns:
        The true signals of the motion.

    Raises:
        ValueError: ``folder`` holds no study.
    """
    nominal = load(machine, assets)
    plant = Plant(nominal, secret.effects, seed, nuisance or Nuisance(), baseline=False)
    if not (folder / "STUDY.yaml").is_file():
        raise ValueError(f"no study in {folder}; write one with write_study")
    logs = sorted(folder.glob("episode_*.csv"))
    ends = [float(np.loadtxt(log, delimiter=",", skiprows=1, usecols=0)[-1]) for log in logs]
    start = sum(round(end / PERIOD) * PERIOD + PERIOD for end in ends)
    initial = episodes(nominal, secret.motion, EPISODE[machine])[0][0]
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

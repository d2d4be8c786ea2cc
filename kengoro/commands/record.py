"""`kengoro record`: a log of a moving robot and its study for `reality_gap`.

The folder then holds ``STUDY.yaml``, the nominal model with its sensors as ``model.xml``, and for
each episode ``log_N.csv`` and, with a camera, ``camera_N.csv``. `reality-gap diagnose STUDY.yaml`
says what the nominal model gets wrong.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import Literal

import numpy as np
from rich.console import Console

from jmm_agent.types import Floats
from kengoro.errors import UsageError
from kengoro.recording import Arm, Recording, Tour, elbow, record_episode, whole_arm
from kengoro.robots import check_seed, shuffled_postures
from kengoro.study_writer import write_study
from kengoro_env.robot.nominal_model import NominalArm

ARMS = {"whole": whole_arm, "elbow": elbow}

NAMES = {"whole": "head and arm", "elbow": "elbow"}


@dataclass(frozen=True)
class Args:
    """Record a moving robot as a study for reality_gap.

    Attributes:
        out: folder of the study.
        robot: seed of the actual robot; the nominal model if left out.
        arm: the whole arm with its camera, or the elbow alone.
        targets: CSV file of postures to visit [deg], one in each row, with the joint names as
            header; sampled postures if left out.
        motion: seed of the sampled postures and of the sensor noise.
        episodes: number of logs; each has postures of its own.
        duration: of each log [s], rounded up to whole visits; not used with targets.
        move: duration of a movement [s].
        hold: how long the arm stays at each posture [s].
    """

    out: Path
    robot: int | None = None
    arm: Literal["whole", "elbow"] = "whole"
    targets: Path | None = None
    motion: int = 0
    episodes: int = 1
    duration: float = 60.0
    move: float = 1.0
    hold: float = 1.0


def main(args: Args) -> None:
    """Record, write the study, and print how much was recorded."""
    path, recordings = _record(args)
    observations = sum(len(recording.observation_time) for recording in recordings)
    rows = sum(len(recording.time) for recording in recordings)
    Console().print(f"{path}: {rows} rows, {observations} marker observations")


def record(
    out: Path | str,
    *,
    robot: int | None = None,
    arm: Literal["whole", "elbow"] = "whole",
    targets: Path | str | None = None,
    motion: int = 0,
    episodes: int = 1,
    duration: float = 60.0,
    move: float = 1.0,
    hold: float = 1.0,
) -> Path:
    """Record a moving robot as a study for `reality_gap`.

    Args:
        out: folder of the study.
        robot: seed of the actual robot; None for the nominal model.
        arm: the whole arm with its camera, or the elbow alone.
        targets: CSV file of postures to visit [deg], one in each row, with the joint names as
            header; sampled postures if left out.
        motion: seed of the sampled postures and of the sensor noise.
        episodes: number of logs; each has postures of its own.
        duration: of each log [s], rounded up to whole visits; not used with targets.
        move: duration of a movement [s].
        hold: how long the arm stays at each posture [s].

    Returns:
        Path of ``STUDY.yaml``, for `reality_gap.load_study`.

    Raises:
        UsageError: an argument is out of its range, or the targets cannot be read.
    """
    path = None if targets is None else Path(targets)
    args = Args(Path(out), robot, arm, path, motion, episodes, duration, move, hold)
    return _record(args)[0]


def _record(args: Args) -> tuple[Path, list[Recording]]:
    _check(args)
    arm = ARMS[args.arm]()
    recordings = [
        record_episode(arm, args.robot, tour, seed=args.motion + number)
        for number, tour in enumerate(_tours(args, arm))
    ]
    return write_study(args.out, NAMES[args.arm], arm.scene, recordings), recordings


def _check(args: Args) -> None:
    if args.arm not in ARMS:
        raise UsageError(f"The arm is {args.arm!r}, but it must be one of: {', '.join(ARMS)}.")
    for name, value in (("move", args.move), ("hold", args.hold), ("duration", args.duration)):
        if not 0.0 < value < np.inf:
            raise UsageError(f"{name} is {value:g} s, but it must be above 0 and finite.")
    if args.episodes < 1:
        raise UsageError(f"Episodes are {args.episodes}, but at least 1 is needed.")
    if args.robot is not None:
        check_seed(args.robot)
    check_seed(args.motion)


def _tours(args: Args, arm: Arm) -> list[Tour]:
    joints = NominalArm(arm.scene)
    if args.targets is not None:
        postures = read_targets(args.targets, joints)
        return [
            Tour(part, args.move, args.hold) for part in np.array_split(postures, args.episodes)
        ]
    visits = 1 + int(np.ceil((args.duration - args.hold) / (args.move + args.hold) - 1e-9))
    postures = _postures(args, max(1, visits) * args.episodes)
    return [Tour(part, args.move, args.hold) for part in np.split(postures, args.episodes)]


def _postures(args: Args, count: int) -> Floats:
    if args.arm == "elbow":
        rng = np.random.default_rng([args.motion, 1])
        return rng.uniform(radians(5.0), radians(100.0), (count, 1))
    postures = shuffled_postures(args.motion)
    return postures[np.arange(count) % len(postures)]


def read_targets(path: Path, arm: NominalArm) -> Floats:
    """Postures from a CSV file in degrees with the joint names as header, shape (K, n) [rad].

    Raises:
        UsageError: the file is missing, has other columns, or holds something else than angles
            within the joint limits.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            header, *rows = [row for row in csv.reader(file) if row]
    except (OSError, ValueError) as error:
        raise UsageError(f"The targets {path} cannot be read: {error}.") from error
    if sorted(header) != sorted(arm.joints):
        raise UsageError(f"The targets {path} need the columns {', '.join(arm.joints)}.")
    try:
        table = np.radians(np.array(rows, dtype=float))[:, [header.index(j) for j in arm.joints]]
    except (ValueError, IndexError) as error:
        raise UsageError(f"The targets {path} need a number in each cell.") from error
    if not np.all((table >= arm.lower) & (table <= arm.upper)):
        row, column = np.argwhere(~((table >= arm.lower) & (table <= arm.upper)))[0]
        low, high = np.degrees([arm.lower[column], arm.upper[column]])
        raise UsageError(
            f"The targets {path} put {arm.joints[column]} at {np.degrees(table[row, column]):g} "
            f"deg in row {row + 1}: it must be within {low:g} and {high:g}."
        )
    return table

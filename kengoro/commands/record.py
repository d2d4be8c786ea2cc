"""Record: a log of a robot that moves, as a study for `reality_gap`.

Written are what the agent commands, feels and sees, and the drawing as a model that reads the same:
``STUDY.yaml``, ``model.xml``, and for each episode ``log_0.csv`` and, with a camera,
``camera_0.csv``, which has times of its own. `python -m reality_gap diagnose STUDY.yaml` then says
what the drawing gets wrong.
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
from kengoro.arm import shuffled_postures
from kengoro.errors import UsageError
from kengoro.recording import Arm, Tour, elbow, record, whole_arm
from kengoro.study_writer import write_study
from kengoro_env.robot.nominal_model import NominalArm

ARMS = {"whole": whole_arm, "elbow": elbow}

NAMES = {"whole": "head and arm", "elbow": "elbow"}


@dataclass(frozen=True)
class Args:
    """What is recorded.

    Attributes:
        out: folder of the study.
        robot: seed of the actual robot; the drawing if left out.
        arm: the whole arm with its camera, or the elbow alone.
        targets: CSV file of postures to visit, one a row, with the joints' names as header [deg];
            postures drawn by chance if left out.
        motion: seed of that chance, and of the sensors' noise.
        episodes: how many logs; each begins where no other did.
        duration: of each log [s], unless there is a file of targets; rounded up to whole visits.
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
    """Record and write the study."""
    _check(args)
    arm = ARMS[args.arm]()
    recordings = [
        record(arm, args.robot, tour, seed=args.motion + number)
        for number, tour in enumerate(_tours(args, arm))
    ]
    write_study(args.out, NAMES[args.arm], arm, recordings)
    observations = sum(len(recording.observation_time) for recording in recordings)
    rows = sum(len(recording.time) for recording in recordings)
    Console().print(f"{args.out}/STUDY.yaml: {rows} rows, {observations} looks at the hand")


def _check(args: Args) -> None:
    for name, value in (("move", args.move), ("hold", args.hold), ("duration", args.duration)):
        if not 0.0 < value < np.inf:
            raise UsageError(f"{name} is {value:g} s, but it must be above 0 and finite.")
    if args.episodes < 1:
        raise UsageError(f"Episodes are {args.episodes}, but at least 1 is needed.")
    if args.robot is not None and args.robot < 0:
        raise UsageError(f"The robot is {args.robot}; seeds of robots are not negative.")


def _tours(args: Args, arm: Arm) -> list[Tour]:
    joints = NominalArm(arm.scene)
    if args.targets is not None:
        postures = read_targets(args.targets, joints)
        return [
            Tour(part, args.move, args.hold) for part in np.array_split(postures, args.episodes)
        ]
    visits = 1 + int(np.ceil((args.duration - args.hold) / (args.move + args.hold) - 1e-9))
    drawn = _postures(args, max(1, visits) * args.episodes)
    return [Tour(part, args.move, args.hold) for part in np.split(drawn, args.episodes)]


def _postures(args: Args, count: int) -> Floats:
    if args.arm == "elbow":
        rng = np.random.default_rng([args.motion, 1])
        return rng.uniform(radians(5.0), radians(100.0), (count, 1))
    postures = shuffled_postures(args.motion)
    return postures[np.arange(count) % len(postures)]


def read_targets(path: Path, arm: NominalArm) -> Floats:
    """Postures (K, n) [rad] from a CSV file in degrees with the joints' names as header.

    Raises:
        UsageError: no such file, other columns, or what is not an angle within the limits.
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

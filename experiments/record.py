"""Record: a log of a robot that moves, as a study for `reality_gap`.

Written are what the agent commands, feels and sees, and the drawing as a model that reads the same:
``STUDY.yaml``, ``model.xml``, and for each episode ``log_0.csv`` and, with a camera,
``camera_0.csv``, which has times of its own. `python -m reality_gap diagnose STUDY.yaml` then says
what the drawing gets wrong.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import Any, Literal

import numpy as np
import yaml
from rich.console import Console
from scipy.spatial.transform import Rotation

from experiments.arm import shuffled_postures
from experiments.common import log_reported, write_text
from experiments.drawing_model import (
    MARKER_ORIENTATION,
    MARKER_POSITION,
    drawing_model,
    length_sensor,
    tension_sensor,
    zero_lengths,
)
from experiments.errors import ExperimentError
from experiments.recording import SETTLE, Arm, Recording, Tour, elbow, record, whole_arm
from jmm_agent.nominal_model import Floats
from kengoro_env.robot.nominal_model import ArmDrawing

ARMS = {"whole": whole_arm, "elbow": elbow}

NAMES = {"whole": "head and arm", "elbow": "elbow"}

LENGTH_NOISE, TENSION_NOISE = 1e-4, 1.0
"""Standard deviation of a reading of encoders [m] and tension sensors [N], as their makers say."""

MARKER_NOISE, TURN_NOISE = 2e-4, 1e-3
"""The same of the marker's position [m], and of each number of its quaternion: see
`python -m benchmarks marker_pose`."""

STILL = 0.002
"""A tension sensor on a wire also feels its motor's viscous drag, 150 N s/m, which the model's
sensor does not: while a wire moves faster than this [m/s] its cell is left empty."""

WINDOW = 5
"""Control periods before and after, over which that speed is taken."""

POSITION = ("marker_x", "marker_y", "marker_z")
TURN = ("marker_qw", "marker_qx", "marker_qy", "marker_qz")


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
    log_reported([] if args.robot is None else [args.robot])
    arm = ARMS[args.arm]()
    recordings = [
        record(arm, args.robot, tour, seed=args.motion + number)
        for number, tour in enumerate(_tours(args, arm))
    ]
    write_study(args.out, NAMES[args.arm], arm, recordings)
    looks = sum(len(recording.look_time) for recording in recordings)
    rows = sum(len(recording.time) for recording in recordings)
    Console().print(f"{args.out}/STUDY.yaml: {rows} rows, {looks} looks at the hand")


def _check(args: Args) -> None:
    for name, value in (("move", args.move), ("hold", args.hold), ("duration", args.duration)):
        if not 0.0 < value < np.inf:
            raise ExperimentError(f"{name} is {value:g} s, but it must be above 0 and finite.")
    if args.episodes < 1:
        raise ExperimentError(f"Episodes are {args.episodes}, but at least 1 is needed.")
    if args.robot is not None and args.robot < 0:
        raise ExperimentError(f"The robot is {args.robot}; seeds of robots are not negative.")


def _tours(args: Args, arm: Arm) -> list[Tour]:
    joints = ArmDrawing(arm.scene)
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


def read_targets(path: Path, arm: ArmDrawing) -> Floats:
    """Postures (K, n) [rad] from a CSV file in degrees with the joints' names as header.

    Raises:
        ExperimentError: no such file, other columns, or what is not an angle within the limits.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            header, *rows = [row for row in csv.reader(file) if row]
    except (OSError, ValueError) as error:
        raise ExperimentError(f"The targets {path} cannot be read: {error}.") from error
    if sorted(header) != sorted(arm.joints):
        raise ExperimentError(f"The targets {path} need the columns {', '.join(arm.joints)}.")
    try:
        table = np.radians(np.array(rows, dtype=float))[:, [header.index(j) for j in arm.joints]]
    except (ValueError, IndexError) as error:
        raise ExperimentError(f"The targets {path} need a number in each cell.") from error
    if not np.all((table >= arm.lower) & (table <= arm.upper)):
        row, column = np.argwhere(~((table >= arm.lower) & (table <= arm.upper)))[0]
        low, high = np.degrees([arm.lower[column], arm.upper[column]])
        raise ExperimentError(
            f"The targets {path} put {arm.joints[column]} at {np.degrees(table[row, column]):g} "
            f"deg in row {row + 1}: it must be within {low:g} and {high:g}."
        )
    return table


def write_study(out: Path, name: str, arm: Arm, recordings: Sequence[Recording]) -> Path:
    """Write model, logs and, last, ``STUDY.yaml`` to a folder; returns the path of the latter."""
    spec, drawing = drawing_model(arm.scene), ArmDrawing(arm.scene)
    write_text(out / "model.xml", spec.to_xml())
    for number, recording in enumerate(recordings):
        write_text(out / f"log_{number}.csv", _log_table(recording, drawing.muscles))
        if len(recording.look_time):
            write_text(out / f"camera_{number}.csv", _camera_table(recording))
    path = out / "STUDY.yaml"
    study = study_content(name, drawing, zero_lengths(spec, drawing.muscles), recordings)
    write_text(path, yaml.safe_dump(study, sort_keys=False, width=120))
    return path


def study_content(
    name: str, arm: ArmDrawing, zero: Floats, recordings: Sequence[Recording]
) -> dict[str, Any]:
    """What ``STUDY.yaml`` holds.

    Args:
        name: for people.
        arm: names of joints and muscles.
        zero: the drawing's wire lengths (m,) [m] where the robot calls them zero.
        recordings: one an episode.
    """
    offset = {muscle: round(float(at), 9) for muscle, at in zip(arm.muscles, zero, strict=True)}
    sensors: dict[str, Any] = {}
    for muscle in arm.muscles:
        sensors[length_sensor(muscle)] = {
            "column": f"length_{muscle}",
            "unit": "m",
            "offset": offset[muscle],
            "noise": LENGTH_NOISE,
        }
    for muscle in arm.muscles:
        sensors[tension_sensor(muscle)] = {
            "column": f"tension_{muscle}",
            "unit": "N",
            "scale": -1,
            "noise": TENSION_NOISE,
        }
    if any(len(recording.look_time) for recording in recordings):
        sensors[MARKER_POSITION] = {"columns": [*POSITION], "unit": "m", "noise": MARKER_NOISE}
        sensors[MARKER_ORIENTATION] = {"columns": [*TURN], "unit": "1", "noise": TURN_NOISE}
    return {
        "name": name,
        "model": "model.xml",
        "episodes": [_episode(number, r, arm.joints) for number, r in enumerate(recordings)],
        "time": {"column": "time", "unit": "s"},
        "actuators": {
            muscle: {"column": f"target_{muscle}", "unit": "m", "offset": offset[muscle]}
            for muscle in arm.muscles
        },
        "sensors": sensors,
        "initial": {"settle": SETTLE},
    }


def _episode(number: int, recording: Recording, joints: Sequence[str]) -> dict[str, Any]:
    start = zip(joints, recording.start, strict=True)
    episode: dict[str, Any] = {"commands": f"log_{number}.csv"}
    if len(recording.look_time):
        episode["readings"] = [f"camera_{number}.csv"]
    return {**episode, "joints": {joint: round(float(angle), 6) for joint, angle in start}}


def _log_table(recording: Recording, muscles: Sequence[str]) -> str:
    header = ["time", *(f"{kind}_{m}" for kind in ("target", "length", "tension") for m in muscles)]
    still = speed(recording.lengths, recording.time) < STILL
    rows = (
        [f"{time:.6f}", *(f"{x:.8f}" for x in (*command, *lengths)),
         *(f"{x:.4f}" if rests else "" for x, rests in zip(tensions, at_rest, strict=True))]
        for time, command, lengths, tensions, at_rest in zip(
            recording.time, recording.command, recording.lengths, recording.tensions, still,
            strict=True,
        )
    )  # fmt: skip
    return _csv(header, rows)


def speed(lengths: Floats, time: Floats) -> Floats:
    """How fast each wire moves (k, m) [m/s], by its lengths (k, m) [m] before and after."""
    index = np.arange(len(time))
    before, after = np.maximum(index - WINDOW, 0), np.minimum(index + WINDOW, len(time) - 1)
    span = np.maximum(time[after] - time[before], 1e-9)
    return np.abs(lengths[after] - lengths[before]) / span[:, None]


def _camera_table(recording: Recording) -> str:
    position, turn = in_model_axes(recording.markers)
    rows = (
        [f"{time:.6f}", *(f"{x:.7f}" for x in (*p, *q))]
        for time, p, q in zip(recording.look_time, position, turn, strict=True)
    )
    return _csv(["time", *POSITION, *TURN], rows)


def in_model_axes(markers: Floats) -> tuple[Floats, Floats]:
    """Positions (c, 3) [m] and quaternions (c, 4), w first, in MuJoCo's camera axes: x right, y
    up, z backwards; from poses (c, 4, 4) in OpenCV's: x right, y down, z forward."""
    flip = np.diag([1.0, -1.0, -1.0])
    position = markers[:, :3, 3] @ flip
    turn = Rotation.from_matrix(flip @ markers[:, :3, :3]).as_quat(scalar_first=True)
    return position, turn


def _csv(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()

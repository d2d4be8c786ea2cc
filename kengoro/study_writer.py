"""Writer of studies for `reality_gap`: ``STUDY.yaml``, ``model.xml`` and logs of recordings.

Each episode has a ``log_N.csv`` and, with a camera, a ``camera_N.csv`` with its own times.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from jmm_agent.types import Floats
from kengoro.errors import UsageError
from kengoro.recording import SETTLE, Recording
from kengoro.study_model import (
    MARKER_ORIENTATION,
    MARKER_POSITION,
    length_sensor,
    study_model,
    tension_sensor,
    zero_lengths,
)
from kengoro_env.robot.nominal_model import NominalArm
from mjcf_sandbox.files import write_text

LENGTH_NOISE, TENSION_NOISE = 1e-4, 1.0
"""Standard deviation of a reading of the encoders [m] and of the tension sensors [N]."""

MARKER_NOISE, TURN_NOISE = 2e-4, 1e-3
"""Standard deviation of the marker's position [m], and of each number of its quaternion
(`python -m benchmarks marker_pose`)."""

STILL = 0.002
"""Speed of a tendon [m/s] above which its tension is left out of the log: the sensor also measures
the viscous drag of the motor, 150 N s/m, which the sensor of the model does not."""

WINDOW = 5
"""Number of control periods before and after a reading over which that speed is taken."""

POSITION = ("marker_x", "marker_y", "marker_z")
TURN = ("marker_qw", "marker_qx", "marker_qy", "marker_qz")


def write_study(
    out: Path | str,
    name: str,
    scene: Path | str,
    recordings: Sequence[Recording],
    folders: Sequence[Path | str] = (),
) -> Path:
    """Write recordings as a study.

    Args:
        out: folder of the study.
        name: of the study, for people.
        scene: MJCF file of the nominal model of the recorded robot.
        recordings: one for each episode.
        folders: further folders whose files the model may include or load.

    Returns:
        Path of ``STUDY.yaml``, which is written last.

    Raises:
        UsageError: there is no recording, or one has arrays of the wrong shape or with numbers that
            are not finite.
        ModelError: the model file cannot be used.
    """
    out, scene = Path(out), Path(scene)
    spec, nominal = study_model(scene, None, folders), NominalArm(scene, folders)
    if not recordings:
        raise UsageError("A study needs at least one recording.")
    for number, recording in enumerate(recordings):
        _check(number, recording, len(nominal.joints), len(nominal.muscles))
    write_text(out / "model.xml", spec.to_xml())
    for number, recording in enumerate(recordings):
        write_text(out / f"log_{number}.csv", _log_table(recording, nominal.muscles))
        if len(recording.observation_time):
            write_text(out / f"camera_{number}.csv", _camera_table(recording))
    path = out / "STUDY.yaml"
    study = study_content(name, nominal, zero_lengths(spec, nominal.muscles), recordings)
    write_text(path, yaml.safe_dump(study, sort_keys=False, width=120))
    return path


def _check(number: int, recording: Recording, joints: int, muscles: int) -> None:
    """Refuse a recording whose arrays do not fit the robot."""
    rows, frames = np.shape(recording.time)[:1], np.shape(recording.observation_time)[:1]
    shapes: dict[str, tuple[int, ...]] = {
        "time": rows or (1,),
        "command": (*rows, muscles),
        "lengths": (*rows, muscles),
        "tensions": (*rows, muscles),
        "start": (joints,),
        "observation_time": frames or (0,),
        "markers": (*frames, 4, 4),
    }
    for field, shape in shapes.items():
        try:
            array = np.asarray(getattr(recording, field), dtype=float)
        except (TypeError, ValueError):
            array = np.array(np.nan)
        if array.shape != shape or not np.isfinite(array).all() or rows == (0,):
            raise UsageError(
                f"Recording {number}: {field} must be finite numbers of shape {shape}, of a robot "
                f"of {joints} joints and {muscles} muscles; got shape {array.shape}."
            )


def study_content(
    name: str, arm: NominalArm, zero: Floats, recordings: Sequence[Recording]
) -> dict[str, Any]:
    """Content of ``STUDY.yaml``.

    Args:
        name: of the study, for people.
        arm: names of joints and muscles.
        zero: tendon lengths of the nominal model where the encoders read zero, shape (m,) [m].
        recordings: one for each episode.
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
    if any(len(recording.observation_time) for recording in recordings):
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
    if len(recording.observation_time):
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
    """Speed of each tendon at each time, shape (k, m) [m/s].

    Args:
        lengths: shape (k, m) [m].
        time: shape (k,) [s].
    """
    index = np.arange(len(time))
    before, after = np.maximum(index - WINDOW, 0), np.minimum(index + WINDOW, len(time) - 1)
    span = np.maximum(time[after] - time[before], 1e-9)
    return np.abs(lengths[after] - lengths[before]) / span[:, None]


def _camera_table(recording: Recording) -> str:
    position, turn = in_model_axes(recording.markers)
    rows = (
        [f"{time:.6f}", *(f"{x:.7f}" for x in (*p, *q))]
        for time, p, q in zip(recording.observation_time, position, turn, strict=True)
    )
    return _csv(["time", *POSITION, *TURN], rows)


def in_model_axes(markers: Floats) -> tuple[Floats, Floats]:
    """Marker poses in MuJoCo's camera axes: x right, y up, z backwards.

    Args:
        markers: poses in OpenCV's axes (x right, y down, z forward), shape (c, 4, 4).

    Returns:
        Positions, shape (c, 3) [m], and quaternions with w first, shape (c, 4).
    """
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

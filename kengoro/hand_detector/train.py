"""Training of a hand detector: examples, two networks, calibration, one file.

Examples are drawn in processes of their own, and networks trained in others: PyTorch and drawing do
not go together in one. All that is done lies in a folder, from which a stopped run goes on.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from jmm_agent.vision.hand_model_file import HandModel, write_hand_model
from kengoro.errors import UsageError
from kengoro.hand_detector.calibration import Calibration, calibrate
from kengoro.hand_detector.examples import CHUNK, FINDER_FOCAL, Source, make_chunk
from mjcf_sandbox.files import write_bytes, write_text

STAGES = ("examples", "finder", "points", "calibration")
LEAST_SHOWN = 0.2
"""Least share of the frames in which the hand must be seen [1]."""
FINDER_SHARE = 0.5
"""Examples of the finder for one of the points network [1]."""

Progress = Callable[[str, float, str], None]
"""Called with stage, share that is done, and a short text."""


@dataclass(frozen=True)
class Effort:
    """How much is done.

    Attributes:
        frames: number of frames that are drawn.
        samples: number of crops from which the points network learns, each several times.
        calibration: number of frames of the calibration.
        jobs: number of processes and threads.
    """

    frames: int = 12_000
    samples: int = 100_000
    calibration: int = 400
    jobs: int = 2


def train_detector(
    source: Source, out: Path, folder: Path, effort: Effort, command: str, progress: Progress
) -> Calibration:
    """Train a detector and write its file.

    Args:
        source: what the frames are made of.
        out: path of the file.
        folder: of the examples and checkpoints.
        effort: how much is done.
        command: that the file names as the one that made it.
        progress: shows how far it is.

    Raises:
        UsageError: PyTorch's exporter is missing, the folder is of another run, or the training
            failed.
    """
    missing = [name for name in ("onnx", "onnxscript") if find_spec(name) is None]
    if missing:
        raise UsageError(
            f"Training a hand detector needs {' and '.join(missing)}: pip install 'kengoro[train]'."
        )
    folder.mkdir(parents=True, exist_ok=True)
    claim(folder, source, effort)
    _make_examples(source, folder, effort, progress)
    for kind, share in (("finder", FINDER_SHARE), ("points", 1.0)):
        _train_network(kind, int(share * effort.samples), source, folder, effort, progress)
    points = tuple(map(tuple, source.maker().points.round(6).tolist()))
    model = HandModel(source.body, points, source.size, FINDER_FOCAL, made_by=command)
    networks = [(folder / f"{kind}.onnx").read_bytes() for kind in ("finder", "points")]
    unfinished = folder / "uncalibrated.zip"
    write_hand_model(unfinished, model, *networks)
    found = calibrate(
        source, unfinished, effort.calibration, lambda share: progress("calibration", share, "")
    )
    write_bytes(out, unfinished.read_bytes())
    return found


def claim(folder: Path, source: Source, effort: Effort) -> None:
    """Note in the folder what it is for; refuse one that is for another run."""
    wanted = {
        **asdict(source), "model": str(source.model), "hidden": list(source.hidden),
        "frames": effort.frames, "samples": effort.samples, "content": _digest(source.model),
    }  # fmt: skip
    path = folder / "run.json"
    if path.exists():
        try:
            stored = json.loads(path.read_text())
        except ValueError as error:
            raise UsageError(f"{path} is damaged; remove {folder}.") from error
        if {"content": wanted["content"], **stored} != wanted:  # older ones do not name it
            raise UsageError(
                f"{folder} is the folder of a training with other options or another state of "
                f"{source.model.name}; name another folder, or remove it."
            )
    write_text(path, json.dumps(wanted, indent=1))


def _digest(path: Path) -> str:
    """Checksum of what a model looks like and how it moves."""
    model = mujoco.MjModel.from_xml_path(str(path))
    names = ("body_parentid", "body_pos", "body_quat", "jnt_type", "jnt_pos", "jnt_axis",
             "jnt_range", "geom_bodyid", "geom_type", "geom_pos", "geom_quat", "geom_size",
             "geom_group", "geom_rgba", "mesh_vert", "cam_pos", "cam_quat", "cam_fovy")  # fmt: skip
    digest = hashlib.sha256()
    for name in names:
        digest.update(np.ascontiguousarray(getattr(model, name)).tobytes())
    return digest.hexdigest()


def _make_examples(source: Source, folder: Path, effort: Effort, progress: Progress) -> None:
    starts = range(0, effort.frames, CHUNK)
    progress("examples", 0.0, "")
    context = multiprocessing.get_context("spawn")
    shown = 0
    with ProcessPoolExecutor(effort.jobs, context) as pool:
        tasks = [
            pool.submit(make_chunk, source, number, folder, min(CHUNK, effort.frames - start))
            for number, start in enumerate(starts)
        ]
        for done, task in enumerate(as_completed(tasks), start=1):
            shown += task.result()
            progress("examples", done / len(starts), f"{done} of {len(starts)} files")
    if shown < LEAST_SHOWN * effort.frames:
        raise UsageError(
            f"The camera {source.camera!r} shows the body {source.body!r} in {shown} of "
            f"{effort.frames} frames only: in random postures it must be in view, 0.12 to 1.5 m "
            "away. Choose another camera or body, or narrow the joints' ranges in the model."
        )


def _train_network(
    kind: str, samples: int, source: Source, folder: Path, effort: Effort, progress: Progress
) -> None:
    job: dict[str, Any] = {
        "folder": str(folder), "kind": kind, "samples": samples, "size": source.size,
        "count": source.count, "seed": source.seed, "threads": effort.jobs,
    }  # fmt: skip
    module = "kengoro.hand_detector.networks.training"
    command = [sys.executable, "-m", module, json.dumps(job)]
    errors = folder / f"{kind}.log"
    progress(kind, 0.0, "")
    with (
        errors.open("w") as log,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True) as process,
    ):
        assert process.stdout is not None
        try:
            for line in process.stdout:
                if line.startswith("{"):
                    progressed = json.loads(line)
                    _, loss, new = progressed["curve"]
                    progress(kind, progressed["share"], f"loss {loss:.2f}, of new {new:.2f}")
        except BaseException:
            process.terminate()
            raise
    if process.returncode:
        last = errors.read_text().strip().splitlines()[-1:] or ["no message"]
        raise UsageError(f"The training of the {kind} network failed: {last[0]} (see {errors}).")

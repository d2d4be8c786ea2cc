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

from jmm_agent.vision.hand_model_file import HandModel, read_hand_model, write_hand_model
from kengoro.errors import UsageError
from kengoro.hand_detector.calibration import Calibration, calibrate
from kengoro.hand_detector.curves import draw_curves
from kengoro.hand_detector.examples import CHUNK, FINDER_FOCAL, Source, make_chunk
from mjcf_sandbox.files import write_bytes, write_text

STAGES = ("examples", "finder", "points", "calibration")
LEAST_SHOWN = 0.2
"""Least share of the frames in which the hand must be seen [1]."""
NETWORKS = ("finder", "points")
FINDER_SHARE = 1.0
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
        batch: number of examples of a step.
        device: that the networks learn on, as PyTorch names it: ``cpu`` or ``cuda``.
        start: file of a detector whose weights are the first ones; None: random ones.
    """

    frames: int = 12_000
    samples: int = 100_000
    calibration: int = 1000
    jobs: int = 2
    batch: int = 64
    device: str = "cpu"
    start: Path | None = None


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
        UsageError: PyTorch's exporter is missing, the folder is of another run, the training
            failed, or the detector finds too few hands for a calibration.
    """
    missing = [name for name in ("onnx", "onnxscript") if find_spec(name) is None]
    if missing:
        raise UsageError(
            f"Training a hand detector needs {' and '.join(missing)}: pip install 'kengoro[train]'."
        )
    if effort.device != "cpu":
        _check_device(effort.device)
    started = None if effort.start is None else read_hand_model(effort.start)
    folder.mkdir(parents=True, exist_ok=True)
    claim(folder, source, effort)
    if started is not None:
        for kind, network in zip(NETWORKS, started[1:], strict=True):
            write_bytes(_start(folder, kind), network)
        command = f"{started[0].made_by}; then {command}"
    make_examples(source, folder, effort, progress)
    curves = {}
    for kind, share in zip(NETWORKS, (FINDER_SHARE, 1.0), strict=True):
        samples = int(share * effort.samples)
        curves[kind] = _train_network(kind, samples, source, folder, effort, progress)
    draw_curves(folder / "curves.png", curves)
    points = tuple(map(tuple, source.maker().points.round(6).tolist()))
    model = HandModel(source.body, points, source.size, FINDER_FOCAL, made_by=command)
    networks = [(folder / f"{kind}.onnx").read_bytes() for kind in NETWORKS]
    unfinished = folder / "uncalibrated.zip"
    write_hand_model(unfinished, model, *networks)
    found = calibrate(
        source, unfinished, effort.calibration, lambda share: progress("calibration", share, "")
    )
    write_bytes(out, unfinished.read_bytes())
    return found


def _check_device(device: str) -> None:
    """Refuse a device that PyTorch cannot compute on; asked in a process that does not draw."""
    question = f"import torch; torch.zeros(1, device={device!r})"
    answer = subprocess.run([sys.executable, "-c", question], capture_output=True, text=True)
    if answer.returncode:
        reason = (answer.stderr.strip().splitlines() or ["no message"])[-1]
        raise UsageError(f"PyTorch cannot compute on the device {device!r}: {reason}")


def claim(folder: Path, source: Source, effort: Effort) -> None:
    """Note in the folder what it is for; refuse one that is for another run."""
    wanted = {
        **asdict(source), "model": str(source.model), "hidden": list(source.hidden),
        "frames": effort.frames, "samples": effort.samples, "batch": effort.batch,
        "device": effort.device, "content": _digest(source.model),
        "start": effort.start and hashlib.sha256(effort.start.read_bytes()).hexdigest(),
    }  # fmt: skip
    path = folder / "run.json"
    if path.exists():
        try:
            stored = json.loads(path.read_text())
        except ValueError as error:
            raise UsageError(f"{path} is damaged; remove {folder}.") from error
        if {**wanted, **stored} != wanted:  # older ones do not name all
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


def make_examples(source: Source, folder: Path, effort: Effort, progress: Progress) -> None:
    """Write the files of examples that are missing in a folder.

    Raises:
        UsageError: too few frames show the hand.
    """
    starts = range(0, effort.frames, CHUNK)
    progress("examples", 0.0, "")
    context = multiprocessing.get_context("spawn")
    shown = 0
    with ProcessPoolExecutor(effort.jobs, context) as pool:
        tasks = [
            pool.submit(
                make_chunk, source, number, folder, min(CHUNK, effort.frames - start), effort.start
            )
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
) -> list[list[float]]:
    """Train a network in a process of its own; its curve, see `draw_curves`."""
    job: dict[str, Any] = {
        "folder": str(folder), "kind": kind, "samples": samples, "size": source.size,
        "count": source.count, "seed": source.seed, "threads": effort.jobs,
        "batch": effort.batch, "device": effort.device,
        "start": str(_start(folder, kind)) if effort.start else "",
    }  # fmt: skip
    module = "kengoro.hand_detector.networks.training"
    command = [sys.executable, "-m", module, json.dumps(job)]
    errors = folder / f"{kind}.log"
    progress(kind, 0.0, "")
    curve: list[list[float]] = []
    with (
        errors.open("w") as log,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True) as process,
    ):
        assert process.stdout is not None
        try:
            for line in process.stdout:
                progressed = json.loads(line) if line.startswith("{") else {}
                if "taken" in progressed:
                    taken, of = progressed["taken"], progressed["of"]
                    progress(kind, 0.0, f"starts from {taken} of {of} trained arrays")
                if "curve" in progressed:
                    curve = progressed["curve"]
                    _, loss, new = curve[-1]
                    progress(kind, progressed["share"], f"loss {loss:.2f}, of new {new:.2f}")
        except BaseException:
            process.terminate()
            raise
    if process.returncode:
        last = errors.read_text().strip().splitlines()[-1:] or ["no message"]
        raise UsageError(f"The training of the {kind} network failed: {last[0]} (see {errors}).")
    return curve


def _start(folder: Path, kind: str) -> Path:
    """Path of the network that a training starts from."""
    return folder / f"start_{kind}.onnx"

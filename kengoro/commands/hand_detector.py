"""`kengoro hand-detector`: trains a detector that finds a robot's hand without a marker."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro
from rich.console import Console

from jmm_agent.vision.hand_model_file import SIZES
from kengoro.errors import UsageError
from kengoro.hand_weights import KENGORO
from kengoro.output_folder import make_folder
from kengoro.stage_progress import progress_of
from kengoro_env.assets import assets_root

RANGES = {
    "frames": (8, 1_000_000),  # 7 to learn from and one to judge by; crops of the most fill 200 GB
    "samples": (1, 1_000_000_000),
    "points": (4, 256),  # a map of the crop for each in the network
    "jobs": (1, 1024),
    "size": SIZES,
    "seed": (0, 2**32 - 1),
    "batch": (2, 4096),
}
"""Least and largest values of the options that are numbers."""


@dataclass(frozen=True)
class Args:
    """Train a detector that finds a robot's hand in camera frames without a marker.

    Attributes:
        action: what is done.
        model: MJCF of the robot in its surroundings.
        out: file that is written, for `jmm_agent.TrainedHandDetector`.
        body: name of the hand's body.
        camera: name of the camera.
        hide: names of geoms that are not drawn, as a marker on the hand.
        folder: of examples and checkpoints, from which a stopped run goes on; by default beside
            the file.
        frames: number of frames that are drawn.
        samples: number of crops that are learned from, each several times.
        size: of the crops [px], a multiple of 32.
        points: number of points of the hand that are located.
        seed: of frames, weights and order.
        jobs: number of processes and threads.
        batch: number of examples of a step.
        device: that the networks learn on; on ``cuda`` not every run gives the same bits.
        start: file of a detector, of any hand, whose weights are the first ones; by default
            that of Kengoro's hand; "none": random ones, which need some ten times more samples.
    """

    action: Annotated[Literal["train"], tyro.conf.Positional]
    model: Annotated[Path, tyro.conf.Positional]
    out: Path
    body: str = "hand"
    camera: str = "eye"
    hide: tuple[str, ...] = ()
    folder: Path | None = None
    frames: int = 12_000
    samples: int = 100_000
    size: int = 128
    points: int = 32
    seed: int = 0
    jobs: int = 2
    batch: int = 64
    device: Literal["cpu", "cuda"] = "cpu"
    start: Literal["kengoro", "none"] | Path = "kengoro"


def main(args: Args) -> None:
    """Train, write the file, and print what the detector does in new frames."""
    from kengoro.hand_detector.examples import Source
    from kengoro.hand_detector.train import STAGES, Effort, train_detector

    _check(args)
    source = Source(
        args.model.resolve(), args.body, args.camera, args.hide, args.size, args.points, args.seed
    )
    effort = Effort(
        args.frames, args.samples, jobs=args.jobs, batch=args.batch, device=args.device,
        start=_start(args),
    )  # fmt: skip
    for folder in (args.out.parent, _folder(args)):
        make_folder(folder)
    with progress_of(STAGES) as progress:
        found = train_detector(source, args.out, _folder(args), effort, _command(args), progress)
    Console().print(
        f"{args.out} ({os.path.getsize(args.out) / 2**20:.1f} MiB): in frames of the same kind "
        f"{found.found:.1%} of the visible hands are found, and {found.claimed:.1%} of the frames "
        f"without one claim one; errors, median (95th percentile): "
        f"{1e3 * found.position[0]:.1f} ({1e3 * found.position[1]:.0f}) mm, "
        f"{np.rad2deg(found.rotation[0]):.1f} ({np.rad2deg(found.rotation[1]):.0f}) deg.",
        highlight=False,
    )


def _start(args: Args) -> Path | None:
    """File of the detector that the training starts from."""
    if args.start == "none":
        return None
    return assets_root() / KENGORO if args.start == "kengoro" else args.start


def _folder(args: Args) -> Path:
    """Folder of the examples and checkpoints."""
    return args.folder or args.out.with_name(args.out.name + ".training")


def _command(args: Args) -> str:
    """The command that trains the same detector."""
    hidden = f" --hide {' '.join(args.hide)}" if args.hide else ""
    return (
        f"kengoro hand-detector train {args.model.name} --out {args.out.name} --body {args.body} "
        f"--camera {args.camera}{hidden} --frames {args.frames} --samples {args.samples} "
        f"--size {args.size} --points {args.points} --seed {args.seed} "
        f"--batch {args.batch} --device {args.device} "
        f"--start {args.start if isinstance(args.start, str) else args.start.name}"
    )


def _check(args: Args) -> None:
    """Refuse what cannot be trained on, in one sentence."""
    from kengoro.hand_detector.trainable import check_model
    from mjcf_sandbox.files import check_folder

    check_model(args.model, args.body, args.camera, args.hide)
    if args.size % 32 or args.size > SIZES[1]:
        raise UsageError(
            f"size is {args.size} px, but it must be a multiple of 32 up to {SIZES[1]} px."
        )
    for name, (least, most) in RANGES.items():
        value = getattr(args, name)
        if value < least:
            raise UsageError(f"{name} is {value}, but it must be at least {least}.")
        if value > most:
            raise UsageError(f"{name} is {value}, but it must be at most {most}.")
    if args.out.is_dir():
        raise UsageError(f"{args.out} is a folder; name a file, such as {args.out / 'hand.zip'}.")
    for folder in (args.out.parent, _folder(args)):
        check_folder(folder)

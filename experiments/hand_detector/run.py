"""The hand without a marker, in frames of laboratories that no detector was trained on."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from experiments.harness.common import (
    ROOT,
    check_jobs,
    files_digest,
    make_summary,
    parse_seeds,
    source_digest,
)
from experiments.harness.errors import ExperimentError
from experiments.harness.experiment import print_results, write_files
from experiments.harness.reported import log_reported, seed_ranges
from experiments.harness.runner import core_seconds, run_tasks
from kengoro.hand_weights import KENGORO
from mjcf_sandbox.files import remove_parts

NAME = "hand-detector"
TITLE = "The hand without a marker"
TUNING, REPORTED = 9000, 10_000
"""First seeds of frames for tuning and of frames for reports."""
FRAMES = 50
"""Number of frames of a task."""
QUICK = 20
"""Number of frames of a quick run."""
LEAST_WIDTH = 120
"""Least width of the printed tables [characters]."""
INTRODUCTION = (
    "Frames of the robot's own camera, with the hand's marker taken away. Postures, surfaces, "
    "lights, objects and faults of the camera follow from the seed of each frame, by a generator "
    "that shares no code with the one that detectors are trained on. The truth is the pose of the "
    "hand in the camera that took the frame; the detector knows the nominal camera, and its lens. "
    "The time is that of all threads of the process on one frame."
)


@dataclass(frozen=True)
class Args:
    """The hand without a marker, in frames of laboratories that it was not trained on.

    Attributes:
        seeds: of the frames, as A-B or A: 9000-9999 are for tuning, those from 10000 on for
            reports, of which 10000-10999 are the full run.
        detector: file of the detector that is judged; the shipped one by default.
        out: folder of the results.
        jobs: number of parallel processes. The results, but for times, do not depend on it.
        cluster: address of a Ray cluster that runs the tasks instead; "auto" is the one that runs
            on this computer.
        quick: only the first 20 frames; their numbers mean nothing.
    """

    seeds: str = "9000-9999"
    detector: Path | None = None
    out: Path = Path("out") / NAME
    jobs: int = 1
    cluster: str | None = None
    quick: bool = False


def main(args: Args) -> dict[str, Any]:
    """Judge a detector; writes summary.json, report.html, figures and the records."""
    begin = time.perf_counter()
    check_jobs(args.jobs)
    seeds, path = frame_seeds(args), detector_path(args.detector)
    log_reported(NAME, [seed for seed in seeds if seed >= REPORTED])
    from experiments.hand_detector.trial import Job, trial

    tasks = {
        f"frames_{own[0]}_{own[-1]}": (Job(tuple(own), path.resolve()),) for own in blocks(seeds)
    }
    folder = args.out / "frames"
    saved = run_tasks(trial, tasks, args.jobs, folder, digest(path), args.cluster)
    records = [record for found in saved.values() for record in found]
    spent = core_seconds(folder, tasks)
    return conclude(args, path, records, time.perf_counter() - begin, spent)


def frame_seeds(args: Args) -> list[int]:
    """Seeds of the frames.

    Raises:
        ExperimentError: they are neither those for tuning nor those for reports.
    """
    seeds = parse_seeds(args.seeds)
    tuning, reported = seeds[0] >= TUNING and seeds[-1] < REPORTED, seeds[0] >= REPORTED
    if not (tuning or reported):
        raise ExperimentError(
            f"Frames are those of seeds {args.seeds}; valid are {TUNING} to {REPORTED - 1} for "
            f"tuning, or seeds from {REPORTED} on for reports. They are not seeds of robots."
        )
    return seeds[:QUICK] if args.quick else seeds


def blocks(seeds: Sequence[int]) -> list[list[int]]:
    """The seeds in blocks that end before multiples of `FRAMES`, so that tasks are the same ones
    in a larger run."""
    found: list[list[int]] = []
    for seed in seeds:
        if not found or seed % FRAMES == 0:
            found.append([])
        found[-1].append(seed)
    return found


def detector_path(path: Path | None) -> Path:
    """File of the detector that is judged.

    Raises:
        ExperimentError: there is no such file, or none is shipped.
    """
    if path is not None:
        if not path.is_file():
            raise ExperimentError(f"There is no detector at {path}: give a file after --detector.")
        return path
    from kengoro_env.assets import assets_root

    shipped = assets_root() / KENGORO
    if not shipped.is_file():
        raise ExperimentError(
            f"No hand detector is shipped ({shipped} does not exist): train one, and give its file "
            "after --detector."
        )
    return shipped


def digest(path: Path) -> str:
    """Digest of a detector and of all code that its records depend on."""
    code = source_digest("experiments/hand_detector")
    return files_digest([path, ROOT / "experiments/harness/runner.py"], code)


def conclude(
    args: Args, path: Path, records: Sequence[Mapping[str, Any]], wall_s: float, core_s: float
) -> dict[str, Any]:
    """Compute criteria, tables and figures, print them and write the results."""
    from experiments.hand_detector.criteria import (
        bad_rows,
        further,
        judged,
        metrics,
        movement_rows,
        pair_rows,
    )
    from experiments.hand_detector.figures import pictures
    from experiments.hand_detector.scores import EXPECTED
    from experiments.hand_detector.tables import tables

    remove_parts(args.out)
    rows, shown, drawings = judged(records), tables(records), pictures(records)
    moves = movement_rows(records)
    others = [*further(records), *bad_rows(records), *pair_rows(records), *moves[1:]]
    summary = make_summary(
        NAME,
        {},
        wall_s,
        core_s=core_s,
        title=TITLE,
        settings={**asdict(args), "out": args.out.name, "detector": path.name},
        detector_bytes=path.stat().st_size,
        metrics=metrics(rows | {"own_hand": moves[0]}),
        metrics_with_expected_pose=metrics(judged(records, EXPECTED)),
        numbers={row.name: row.plain() for row in others},
        tables=[table.plain() for table in shown],
    )
    seeds = sorted({record["seed"] for record in records if record["of"] == "frame"})
    summary["seeds"] = [seed_ranges(seeds)]
    write_files(args.out, TITLE, INTRODUCTION, summary, shown, drawings)
    print_results(args.out, shown[:7])
    return summary

"""Continuous learning for hours: the error of the last hour compared with that of the first.

A robot moves from posture to posture and learns from each, for hours. A run consists of parts of
some minutes, with a checkpoint of the agent after each, from which a stopped run resumes. The
number of observations in the memory is bounded, and so is the cost of an update.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.harness import common
from experiments.harness.common import (
    Summary,
    make_summary,
    parse_seeds,
    source_digest,
)
from experiments.harness.errors import ExperimentError
from experiments.harness.report import Table, metric_table, write_report
from experiments.harness.reported import log_reported
from experiments.harness.runner import core_seconds, progress_bar, read_saved
from experiments.harness.statistics import metric
from experiments.robots.accuracy import MapAccuracy
from experiments.robots.conditions import ACTUAL, make_session
from kengoro.agents import make_agent
from kengoro.robots import shuffled_postures
from kengoro.trained_maps import trained_map
from mjcf_sandbox.files import write_json

POSTURES = 50
"""Number of postures over which the error of the map is evaluated."""

INTRODUCTION = (
    "A robot moves from posture to posture and learns from each, for hours. After each part the "
    "error of the map is evaluated with the muscle lengths of the robot."
)


@dataclass(frozen=True)
class Args(common.Args):
    """Continuous learning for hours on each robot, one after the other.

    Attributes:
        seeds: robots, as A-B or A; seeds below 100 are for tuning.
        out: folder of the results.
        hours: total simulated time [h].
        part: simulated time between checkpoints [min].
        move: duration of a movement [s].
        patience: longest wait for rest and an observation [s].
    """

    seeds: str = "0"
    out: Path = Path("out/endurance")
    hours: float = 3.0
    part: float = 10.0
    move: float = 2.0
    patience: float = 2.5


def main(args: Args) -> Summary:
    """Run the missing parts and write summary and report.

    Raises:
        ExperimentError: a duration is not positive, or jobs or a cluster are given.
    """
    if args.jobs != Args.jobs or args.cluster is not None:
        raise ExperimentError(
            "endurance runs one robot after the other: leave out --jobs and --cluster."
        )
    if min(args.hours, args.part, args.move) <= 0 or args.patience < 0:
        raise ExperimentError("hours, part and move must be positive, and patience not negative.")
    begin, seeds = time.perf_counter(), parse_seeds(args.seeds)
    log_reported("endurance", seeds)
    trained_map(args.cache)
    seconds = 60.0 * (args.part if not args.quick else 0.5)
    count = 2 if args.quick else max(1, round(3600.0 * args.hours / seconds))
    timing = {"seconds": seconds, "move": args.move, "patience": args.patience}
    key = f"{source_digest('experiments/endurance')} {json.dumps(timing)}"
    parts: dict[int, list[dict[str, Any]]] = {}
    with progress_bar("parts", count * len(seeds)) as progress:
        for seed in seeds:
            parts[seed] = []
            for number in range(count):
                parts[seed].append(saved_or_run(args, seed, number, seconds, key))
                progress(f"robot {seed}, {parts[seed][-1]['error_mm']} mm")
    hours = {seed: hourly(found, seconds) for seed, found in parts.items()}
    summary = make_summary(
        "endurance",
        {seed: {"parts": parts[seed], "hours_mm": hours[seed]} for seed in seeds},
        time.perf_counter() - begin,
        core_s=core_seconds(args.out, [part_of(seed, k) for seed in seeds for k in range(count)]),
        options={**timing, "hours": args.hours},
        metrics={"last_to_first": metric([h[-1] / h[0] for h in hours.values()], "", 1.0)},
    )
    tables = [metric_table(summary["metrics"]), hour_table(hours)]
    write_report(args.out / "report.html", "Continuous learning", INTRODUCTION, summary, tables, ())
    write_json(args.out / "summary.json", summary)
    return summary


def saved_or_run(args: Args, seed: int, number: int, seconds: float, key: str) -> dict[str, Any]:
    """Result of a part, from its files or from running it."""
    result, checkpoint = (args.out / f"{part_of(seed, number)}{end}" for end in (".json", ".npz"))
    saved = read_saved(result, key) if checkpoint.is_file() else None
    if saved is not None:
        return dict(saved["result"])
    begin = time.perf_counter()
    before = args.out / f"{part_of(seed, number - 1)}.npz" if number else None
    found = run_part(args, seed, number, seconds, before, checkpoint)
    took = round(time.perf_counter() - begin, 1)
    write_json(result, {"key": key, "seconds": took, "result": found})
    return found


def part_of(seed: int, number: int) -> str:
    """Name of a part's files in the folder of the results, without suffix."""
    return f"robot-{seed:03d}/{number:03d}"


def run_part(
    args: Args, seed: int, number: int, seconds: float, before: Path | None, after: Path
) -> dict[str, Any]:
    """Run a part from the checkpoint before it and save one after it.

    Args:
        args: options of the run.
        seed: of the robot.
        number: of the part.
        seconds: simulated time of the part [s].
        before: file of the checkpoint before; None to start with the nominal map.
        after: file of the checkpoint after.
    """
    agent = make_agent(seed, cache=args.cache)
    if before is not None:
        agent.load(before)
    postures = shuffled_postures(seed)[np.random.default_rng([seed, 10, number]).permutation(100)]
    session = make_session(ACTUAL, seed, agent, postures[0])
    visited = 0
    while session.time < seconds:
        visited += 1
        session.move(postures[visited % len(postures)], args.move, args.patience)
    session.env.close()
    agent.save(after)
    return {
        "error_mm": round(MapAccuracy(seed, POSTURES).error_mm(agent), 3),
        "visited": visited,
        "updates": agent.vision.fired,
        "observations": len(agent.vision.memory.observations),
    }


def hourly(parts: Sequence[Mapping[str, Any]], seconds: float) -> list[float]:
    """Median error of the map in each hour, or in each part of a shorter run [mm]."""
    errors = [float(part["error_mm"]) for part in parts]
    each = max(1, round(3600.0 / seconds)) if len(errors) * seconds > 3600.0 else 1
    return [float(np.median(errors[k : k + each])) for k in range(0, len(errors), each)]


def hour_table(hours: Mapping[int, Sequence[float]]) -> Table:
    """Table of the error of the map by hour, with a row for each robot."""
    longest = max(map(len, hours.values()))
    head = ("robot", *(f"{k}. [mm]" for k in range(1, longest + 1)))
    rows = [(seed, *(f"{error:.2f}" for error in found)) for seed, found in hours.items()]
    return Table("Error of the map by hour, median over its parts", head, rows)

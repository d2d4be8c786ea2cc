"""Hours of continuous learning: does the error in the last hour stay at or below that of the first?

A robot moves from posture to posture and learns from each, for hours. It goes in parts of some
minutes: what the agent knows is kept after each, so that a run that was stopped goes on there. The
number of looks that are remembered is bounded, and with it the cost of each.
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
    log_reported,
    make_summary,
    parse_seeds,
    source_digest,
)
from experiments.harness.errors import ExperimentError
from experiments.harness.report import Table, metric_table, write_report
from experiments.harness.runner import core_seconds, progress_bar, read_kept
from experiments.harness.statistics import metric
from experiments.robots.accuracy import MapAccuracy
from experiments.robots.checkpoint import load_memory, save_memory
from kengoro.arm import ACTUAL, make_session, new_agent, shuffled_postures
from kengoro.trained_maps import trained_map
from mjcf_sandbox.files import write_json

POSTURES = 50
"""Over how many postures the map's error is taken."""

INTRODUCTION = (
    "A robot moves from posture to posture and learns from each, for hours. After each part the "
    "map's error is taken against the robot's own lengths."
)


@dataclass(frozen=True)
class Args(common.Args):
    """Hours of continuous learning on each robot, one after the other.

    Attributes:
        seeds: robots, as A-B or A; seeds below 100 are for tuning.
        out: folder of the results.
        hours: simulated time in all [h].
        part: simulated time after which all is kept [min].
        move: duration of a movement [s].
        patience: longest wait for rest and a look [s].
    """

    seeds: str = "0"
    out: Path = Path("out/endurance")
    hours: float = 3.0
    part: float = 10.0
    move: float = 2.0
    patience: float = 2.5


def main(args: Args) -> Summary:
    """Run what is missing, and write summary and report.

    Raises:
        ExperimentError: durations that are not positive, or more than one process was asked for.
    """
    if args.jobs != Args.jobs or args.cluster is not None:
        raise ExperimentError("endurance runs one robot after the other: leave --jobs out.")
    if min(args.hours, args.part, args.move) <= 0 or args.patience < 0:
        raise ExperimentError("hours, part and move must be positive, and patience not negative.")
    begin, seeds = time.perf_counter(), parse_seeds(args.seeds)
    log_reported(seeds)
    trained_map(args.cache)
    seconds = 60.0 * (args.part if not args.quick else 0.5)
    count = 2 if args.quick else max(1, round(3600.0 * args.hours / seconds))
    timing = {"seconds": seconds, "move": args.move, "patience": args.patience}
    key = f"{source_digest('experiments/endurance', 'experiments/faults')} {json.dumps(timing)}"
    parts: dict[int, list[dict[str, Any]]] = {}
    with progress_bar("parts", count * len(seeds)) as tell:
        for seed in seeds:
            parts[seed] = []
            for number in range(count):
                parts[seed].append(kept_or_lived(args, seed, number, seconds, key))
                tell(f"robot {seed}, {parts[seed][-1]['error_mm']} mm")
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


def kept_or_lived(args: Args, seed: int, number: int, seconds: float, key: str) -> dict[str, Any]:
    """One part: read, if it was there and so were all before, or lived."""
    result, memory = (args.out / f"{part_of(seed, number)}{end}" for end in (".json", ".npz"))
    kept = read_kept(result, key) if memory.is_file() else None
    if kept is not None:
        return dict(kept["result"])
    begin = time.perf_counter()
    before = args.out / f"{part_of(seed, number - 1)}.npz" if number else None
    found = live(args, seed, number, seconds, before, memory)
    took = round(time.perf_counter() - begin, 1)
    write_json(result, {"key": key, "seconds": took, "result": found})
    return found


def part_of(seed: int, number: int) -> str:
    """Name of a part's files in the folder of the results, without their ends."""
    return f"robot-{seed:03d}/{number:03d}"


def live(
    args: Args, seed: int, number: int, seconds: float, before: Path | None, after: Path
) -> dict[str, Any]:
    """Learn for some time [s], from what was known before; what is known then is kept.

    Args:
        args: of the run.
        seed: of the robot.
        number: of this part.
        seconds: how long it is.
        before, after: files of what the agent knows; None: nothing but the drawing.
    """
    agent = new_agent(args.cache, seed)
    if before is not None:
        load_memory(before, agent)
    postures = shuffled_postures(seed)[np.random.default_rng([seed, 10, number]).permutation(100)]
    session = make_session(ACTUAL, seed, agent, postures[0])
    visited = 0
    while session.time < seconds:
        visited += 1
        session.move(postures[visited % len(postures)], args.move, args.patience)
    session.env.close()
    save_memory(after, agent)
    return {
        "error_mm": round(MapAccuracy(seed, POSTURES).error_mm(agent), 3),
        "visited": visited,
        "updates": agent.vision.fired,
        "observations": len(agent.vision.memory.observations),
    }


def hourly(parts: Sequence[Mapping[str, Any]], seconds: float) -> list[float]:
    """Median of the map's error [mm] in each hour; in each part, if they are fewer than that."""
    errors = [float(part["error_mm"]) for part in parts]
    each = max(1, round(3600.0 / seconds)) if len(errors) * seconds > 3600.0 else 1
    return [float(np.median(errors[k : k + each])) for k in range(0, len(errors), each)]


def hour_table(hours: Mapping[int, Sequence[float]]) -> Table:
    """A row for each robot."""
    longest = max(map(len, hours.values()))
    head = ("robot", *(f"{k}. [mm]" for k in range(1, longest + 1)))
    rows = [(seed, *(f"{error:.2f}" for error in found)) for seed, found in hours.items()]
    return Table("The map's error hour by hour, median over its parts", head, rows)

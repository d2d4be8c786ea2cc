"""`python -m experiments all`: runs all experiments of the paper and writes one page of results.

Each runs as a command of its own, which its summary records. Finished tasks are not run again.
"""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from experiments.all.page import write_page
from experiments.harness import common
from experiments.harness.common import check_jobs, parse_seeds
from experiments.harness.errors import ExperimentError

NAMES = (
    "initial-training",
    "muscle-jacobian",
    "antagonism-elbow",
    "vision-update",
    "posture-accuracy",
    "can-grasping",
    "adaptation",
    "ablation",
    "baselines",
)
"""Names in the order of the paper, then experiments beyond it."""


@dataclass(frozen=True)
class Args(common.Args):
    """All experiments of the paper.

    Attributes:
        seeds: robots, as A-B or A; seeds below 100 are for tuning.
        out: folder of the results, with a folder for each experiment.
        only: names of some experiments; all by default.
        page: folder of the page of all results, README.md with figures and summaries; by default
            the folder of the results. Results of earlier runs beside it stay on it.
    """

    seeds: str = "0"
    out: Path = Path("out/all")
    only: tuple[str, ...] = ()
    page: Path | None = None


def main(args: Args) -> list[dict[str, Any]]:
    """Run the experiments and write the page; returns their summaries.

    Raises:
        ExperimentError: a name is unknown, or an experiment failed. The others run nevertheless,
            and the page shows their results.
    """
    parse_seeds(args.seeds)
    check_jobs(args.jobs)
    unknown = [name for name in args.only if name not in NAMES]
    if unknown:
        raise ExperimentError(f"There is no experiment {unknown[0]!r}; there are {NAMES}.")
    console, failed = Console(), []
    names = args.only or NAMES
    for number, name in enumerate(names, start=1):
        console.rule(f"{number} of {len(names)}: {name}")
        command = [sys.executable, "-m", "experiments", name, *options(args, name)]
        if subprocess.run(command, check=False).returncode:
            failed.append(name)
    there = [path for name in NAMES if (path := args.out / name / "summary.json").is_file()]
    if there:
        page = write_page(there, NAMES, args.page or args.out)
        console.print(f"All results on one page: {page}")
    if failed:
        raise ExperimentError(
            f"These experiments failed: {', '.join(failed)}. Run the same command again to resume."
        )
    return [json.loads(path.read_text(encoding="utf-8")) for path in there]


def options(args: Args, name: str) -> list[str]:
    """Command-line options of one experiment."""
    out = args.out / name
    given = shlex.split(f"--seeds {args.seeds} --out {shlex.quote(str(out))} --jobs {args.jobs}")
    if args.cluster is not None:
        given += ["--cluster", args.cluster]
    if args.cache is not None:
        given += ["--cache", str(args.cache)]
    return [*given, "--quick"] if args.quick else given

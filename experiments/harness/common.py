"""What all experiments share: seeds, result files, the agent's drawing and map, parallel tasks."""

from __future__ import annotations

import csv
import hashlib
import re
import shlex
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from experiments.harness.errors import ExperimentError
from kengoro_env.assets import assets_root

FIRST_REPORTED_SEED = 100
ROOT = Path(__file__).resolve().parents[2]

COMMON = ("kengoro", "jmm_agent", "kengoro_env", "experiments/robots")
"""Folders on whose code every result depends."""
SHOWING = ("figures.py", "tables.py", "report.py")
"""Files of experiments that show results and do not change them."""
Summary = dict[str, Any]


@dataclass(frozen=True)
class Args:
    """What every experiment takes.

    Attributes:
        seeds: robots, as A-B or A; seeds below 100 are for tuning.
        out: folder of the results.
        jobs: processes that work at the same time; the result does not depend on it.
        cluster: address of a Ray cluster that does it instead; "auto": the one that runs here.
        cache: folder of trained maps; the user's cache folder if left out.
        quick: do little, to see that it works; the numbers mean nothing then.
        view: watch the robots, one at a time: in MuJoCo's viewer where there is a display, else on
            a page for a browser on this computer. What is kept already runs again.
    """

    seeds: str
    out: Path
    jobs: int = 2
    cluster: str | None = None
    cache: Path | None = None
    quick: bool = False
    view: bool = False


def parse_seeds(text: str) -> list[int]:
    """Seeds of a range "A-B", both included, or of one number "A".

    Raises:
        ExperimentError: it is neither, or B is below A.
    """
    match = re.fullmatch(r"(\d+)(?:-(\d+))?", text)
    if match is None:
        raise ExperimentError(f"Seeds are {text!r}; give one such as 3 or a range such as 0-9.")
    first, last = int(match[1]), int(match[2] or match[1])
    if last < first:
        raise ExperimentError(f"Seeds are {text!r}, but a range ends with its higher number.")
    return list(range(first, last + 1))


def check_jobs(jobs: int) -> None:
    """`ExperimentError` unless there is at least one process."""
    if jobs < 1:
        raise ExperimentError(f"Jobs are {jobs}, but at least 1 is needed.")


def command_line() -> str:
    """The command that started this program, as another user would type it: without the folder of
    trained maps, which is everybody's own."""
    first, *rest = sys.argv
    if "--cache" in rest:
        at = rest.index("--cache")
        del rest[at : at + 2]
    name = Path(first)
    typed = f"-m {name.parent.name}" if name.name == "__main__.py" else name.name
    return shlex.join(["python", *typed.split(), *rest])


def make_summary(
    name: str, per_seed: Mapping[int, object], wall_s: float, **more: object
) -> Summary:
    """What every ``summary.json`` has at least, and more.

    ``wall_s`` is the time since the command was given [s]: less than the whole work where a part
    of it was there already.
    """
    return {
        "name": name,
        "seeds": list(per_seed),
        "command": command_line(),
        "wall_s": round(wall_s, 1),
        **more,
        "per_seed": {str(seed): result for seed, result in per_seed.items()},
    }


def median_and_worst(values: Iterable[float]) -> dict[str, float | None]:
    """Median and largest of some errors, rounded to 1e-3; None where there are none."""
    numbers = np.array(list(values))
    if not numbers.size:
        return {"median": None, "worst": None}
    return {"median": round(float(np.median(numbers)), 3), "worst": round(float(numbers.max()), 3)}


def source_digest(*folders: str) -> str:
    """Digest of the code that results depend on.

    That is robot, agent, assets and what experiments share, and these folders of the checkout.
    Files that only show results (`SHOWING`) do not count.
    """
    digest = hashlib.sha256()
    paths: list[Path] = []
    for folder in (*COMMON, *folders):
        found = sorted((ROOT / folder).rglob("*.py"))
        paths += [path for path in found if path.name not in SHOWING]
    paths += sorted(path for path in assets_root().rglob("*") if path.suffix in (".xml", ".csv"))
    for path in paths:
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:24]


def log_reported(seeds: Sequence[int], root: Path = ROOT) -> None:
    """Append every seed from 100 on to ``experiments/REPORTED.csv`` when run in a checkout.

    Those seeds are for numbers that are reported, so each look at them is on record.
    """
    reported = [seed for seed in seeds if seed >= FIRST_REPORTED_SEED]
    if not reported or not (root / ".git").exists():
        return
    git = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=root, capture_output=True, text=True
    )
    commit = git.stdout.strip() or "none"
    date = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    path = root / "experiments" / "REPORTED.csv"
    new = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        if new:
            writer.writerow(["date", "commit", "command", "seed"])
        writer.writerows([date, commit, command_line(), seed] for seed in reported)

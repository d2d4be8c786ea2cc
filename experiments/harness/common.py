"""Arguments, seeds and summaries that all experiments share."""

from __future__ import annotations

import hashlib
import re
import shlex
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.harness.errors import ExperimentError

ROOT = Path(__file__).resolve().parents[2]

COMMON = ("kengoro", "jmm_agent", "kengoro_env", "experiments/robots")
"""Folders whose code every result depends on."""
SHOWING = ("figures.py", "tables.py", "report.py")
"""Files of experiments that present results without changing them."""
Summary = dict[str, Any]


@dataclass(frozen=True)
class Args:
    """Options of every experiment.

    Attributes:
        seeds: seeds of the robots, as A-B or A; seeds below 100 are for tuning.
        out: folder of the results.
        jobs: number of parallel processes; the results do not depend on it.
        cluster: address of a Ray cluster that runs the tasks instead; "auto" is the one that runs
            on this computer.
        cache: folder of trained maps; by default the user's cache folder.
        quick: run a small version that checks the installation; its numbers mean nothing.
        view: show the robots one at a time: in MuJoCo's viewer where there is a display, otherwise
            on a web page that only this computer can open. Tasks with a saved result run again.
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
        ExperimentError: the text is neither, or B is below A.
    """
    match = re.fullmatch(r"(\d+)(?:-(\d+))?", text)
    if match is None:
        raise ExperimentError(f"Seeds are {text!r}; give one such as 3 or a range such as 0-9.")
    first, last = int(match[1]), int(match[2] or match[1])
    if last < first:
        raise ExperimentError(f"Seeds are {text!r}, but a range must end with its higher number.")
    return list(range(first, last + 1))


def check_jobs(jobs: int) -> None:
    """Raise `ExperimentError` unless ``jobs`` is at least 1."""
    if jobs < 1:
        raise ExperimentError(f"Jobs are {jobs}, but at least 1 is needed.")


def command_line() -> str:
    """The command that started this program, without ``--cache``, which differs between users."""
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
    """Content of a ``summary.json``.

    Args:
        name: of the experiment, as typed.
        per_seed: results by seed, which JSON can hold.
        wall_s: duration of the run [s].
        more: further entries.
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
    """Median and largest of some errors, rounded to 1e-3; None for both without any error."""
    numbers = np.array(list(values))
    if not numbers.size:
        return {"median": None, "worst": None}
    return {"median": round(float(np.median(numbers)), 3), "worst": round(float(numbers.max()), 3)}


def source_digest(*folders: str) -> str:
    """Digest of the code and assets that results depend on.

    Args:
        folders: of the checkout, in addition to `COMMON`. Files that only present results
            (`SHOWING`) are left out.
    """
    from kengoro_env.assets import assets_root  # whose package needs Gymnasium

    paths: list[Path] = []
    for folder in (*COMMON, *folders):
        found = sorted((ROOT / folder).rglob("*.py"))
        paths += [path for path in found if path.name not in SHOWING]
    paths += sorted(path for path in assets_root().rglob("*") if path.suffix in (".xml", ".csv"))
    return files_digest(paths)


def files_digest(paths: Iterable[Path], options: str = "") -> str:
    """Digest of options and of the names and contents of files."""
    digest = hashlib.sha256(options.encode())
    for path in paths:
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:24]

"""Count what becomes of hostile files: python -m tools.fuzz [KIND ...] --minutes M --seed S.

Kinds: mjcf, yaml, csv, parquet, checkpoint, bag; all by default, each its share of the minutes.
Every case is a folder of valid files of which one was made hostile. A worker process gives it to
what users call, and the case is

    fine, refused       the exit code is 0, or 2 with one sentence
    CRASH               any exception that is not one of ours, or a signal
    HANG                it computed for 10 s, or 60 s went by
    READ OUTSIDE        a file was opened that is neither in the folder nor Python's own
    RAN CODE            something was executed that came with the files

The last four are kept in --out, made as small as goes quickly, one folder a fault. With atheris
installed, --guided lets it choose the cases by the lines of our code that they reach.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
import time
from collections import Counter
from dataclasses import asdict
from pathlib import Path

import numpy as np

from tools.fuzz.cases import BAD, CRASH, HANG, OUTCOMES, Outcome, Worker
from tools.fuzz.mutating import mutate
from tools.fuzz.seeds import CHANGED, MAKERS
from tools.fuzz.targets import FENCED

SECRETS = {
    "secret.xml": "<mujoco><geom size='1'/></mujoco>",
    "secret.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
    "secret.csv": "time,target_flexor,length_flexor,angle_elbow\n0,1,2,3\n",
}
"""Files beside a case that are nobody's business."""
TRIES = 60
"""How often a fault is tried to be made smaller."""


class Cases:
    """Folders of one kind, made in a temporary place."""

    def __init__(self, kind: str, place: Path) -> None:
        self._kind, self._place, self._number = kind, place, 0
        self._good = place / "good"
        self._good.mkdir()
        MAKERS[kind](self._good)
        for name, text in SECRETS.items():
            (place / name).write_text(text, encoding="utf-8")

    def good(self, name: str) -> bytes:
        """A valid file."""
        return (self._good / name).read_bytes()

    def make(self, name: str, data: bytes) -> Path:
        """A new folder of valid files, in which one is replaced."""
        self._number += 1
        folder = self._place / f"case_{self._number}"
        shutil.copytree(self._good, folder)
        (folder / name).write_bytes(data)
        return folder


def smaller(cases: Cases, worker: Worker, name: str, data: bytes, outcome: Outcome) -> bytes:
    """The file with parts left out, as long as the same becomes of it."""
    size, tries = max(1, len(data) // 2), 0
    while size and tries < TRIES:
        at = 0
        while at < len(data) and tries < TRIES:
            shorter = data[:at] + data[at + size :]
            folder = cases.make(name, shorter)
            tries += 1
            if worker(folder) == outcome:
                data = shorter
            else:
                at += size
            shutil.rmtree(folder)
        size //= 4
    return data


def fuzz(kind: str, seconds: float, seed: int, out: Path) -> dict[str, object]:
    """Try one kind for a while; counts, and the faults that were kept."""
    random, worker = np.random.default_rng([seed, *kind.encode()]), Worker(kind)
    fenced = Worker(FENCED)
    counts: Counter[str] = Counter()
    faults: dict[Outcome, str] = {}
    with tempfile.TemporaryDirectory(prefix="fuzz-") as name:
        cases, end = Cases(kind, Path(name)), time.monotonic() + seconds
        while time.monotonic() < end:
            changed = CHANGED[kind][random.integers(len(CHANGED[kind]))]
            data = mutate(changed, cases.good(changed), random)
            folder = cases.make(changed, data)
            outcome = worker(folder)
            if kind == "bag" and outcome.what in (CRASH, HANG):
                outcome = fenced(folder)
            counts[outcome.what] += 1
            shutil.rmtree(folder)
            if outcome.what in BAD and outcome not in faults:
                print(f"{kind}: {outcome.what}: {outcome.detail}", flush=True)
                data = smaller(cases, worker, changed, data, outcome)
                kept = out / f"{kind}_{len(faults)}"
                shutil.rmtree(kept, ignore_errors=True)
                shutil.copytree(cases.make(changed, data), kept)
                faults[outcome] = f"{kept}/{changed}"
        worker.stop()
        fenced.stop()
    return {
        "counts": {what: counts[what] for what in OUTCOMES},
        "faults": [{**asdict(outcome), "file": file} for outcome, file in faults.items()],
    }


def main(arguments: list[str]) -> int:
    """Run the kinds that were asked for; 1 if anything bad was found."""
    head, _, rest = (__doc__ or "").partition("\n")
    parser = argparse.ArgumentParser(
        prog="python -m tools.fuzz",
        description=head,
        epilog=rest,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("kinds", nargs="*", metavar="KIND", choices=[*MAKERS, []])
    parser.add_argument("--minutes", type=float, default=6.0, help="in all")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("out/fuzz"))
    parser.add_argument("--guided", action="store_true", help="let atheris choose the cases")
    options = parser.parse_args(arguments)
    kinds = options.kinds or list(MAKERS)
    options.out.mkdir(parents=True, exist_ok=True)
    found = {}
    for kind in kinds:
        found[kind] = fuzz(kind, 60.0 * options.minutes / len(kinds), options.seed, options.out)
        (options.out / "summary.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
        print(f"{kind}: {found[kind]['counts']}", flush=True)
    return int(any(result["faults"] for result in found.values()))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

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
import importlib.util
import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import asdict
from pathlib import Path

import numpy as np

from tools.fuzz.cases import BAD, CRASH, HANG, OUTCOMES, Outcome, Worker
from tools.fuzz.folders import Folders
from tools.fuzz.mutating import mutate
from tools.fuzz.seeds import CHANGED, MAKERS
from tools.fuzz.targets import FENCED

TRIES = 60
"""How often a fault is tried to be made smaller."""


def smaller(folders: Folders, worker: Worker, name: str, data: bytes, outcome: Outcome) -> bytes:
    """The file with parts left out, as long as the same becomes of it."""
    size, tries = max(1, len(data) // 2), 0
    while size and tries < TRIES:
        at = 0
        while at < len(data) and tries < TRIES:
            shorter = data[:at] + data[at + size :]
            folder = folders.make(name, shorter)
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
        folders, end = Folders(kind, Path(name)), time.monotonic() + seconds
        while time.monotonic() < end:
            changed = CHANGED[kind][random.integers(len(CHANGED[kind]))]
            data = mutate(changed, folders.good(changed), random)
            folder = folders.make(changed, data)
            outcome = worker(folder)
            if kind == "bag" and outcome.what in (CRASH, HANG):
                outcome = fenced(folder)
            counts[outcome.what] += 1
            shutil.rmtree(folder)
            if outcome.what in BAD and outcome not in faults:
                print(f"{kind}: {outcome.what}: {outcome.detail}", flush=True)
                data = smaller(folders, worker, changed, data, outcome)
                kept = out / f"{kind}_{len(faults)}"
                shutil.rmtree(kept, ignore_errors=True)
                shutil.copytree(folders.make(changed, data), kept)
                faults[outcome] = f"{kept}/{changed}"
        worker.stop()
        fenced.stop()
    return {
        "counts": {what: counts[what] for what in OUTCOMES},
        "faults": [{**asdict(outcome), "file": file} for outcome, file in faults.items()],
    }


def guided(kind: str, seconds: float, seed: int, out: Path) -> dict[str, object]:
    """The same with atheris, in a process that it may end."""
    with tempfile.TemporaryDirectory(prefix="fuzz-") as location:
        arguments = [kind, str(seconds), str(seed), str(out), location]
        command = [sys.executable, "-m", "tools.fuzz.guided", *arguments]
        done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    found = json.loads((out / f"{kind}_guided.json").read_text(encoding="utf-8"))
    faults = [{"detail": detail, "file": file} for detail, file in found["faults"].items()]
    for path in sorted(out.glob(f"{kind}_guided_*-*")):
        faults.append({"detail": f"libFuzzer, exit code {done.returncode}", "file": str(path)})
    return {"counts": found["counts"], "faults": faults}


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
    if options.guided and importlib.util.find_spec("atheris") is None:
        parser.error("--guided needs atheris: pip install atheris")
    found, run = {}, guided if options.guided else fuzz
    for kind in kinds:
        found[kind] = run(kind, 60.0 * options.minutes / len(kinds), options.seed, options.out)
        (options.out / "summary.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
        print(f"{kind}: {found[kind]['counts']}", flush=True)
    return int(any(result["faults"] for result in found.values()))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

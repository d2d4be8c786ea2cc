"""Fuzz the readers of files: python -m tools.fuzz [KIND ...] --minutes M --seed S.

Kinds: mjcf, yaml, csv, parquet, checkpoint, bag. By default all, which share the minutes equally.
Each case is a folder of valid files, one of which is changed. A worker process passes it to the
commands that users call. Results of a case:

    fine, refused       exit code 0, or exit code 2 with one sentence
    CRASH               an exception that the packages do not define, or a signal
    HANG                10 s of CPU time, or 60 s of wall-clock time
    READ OUTSIDE        a file was opened that is neither in the folder nor part of Python
    RAN CODE            code was executed that came with the files

For each different fault (the last four), a shortened case is kept in a folder in --out. With
--guided, atheris (to be installed) chooses the cases by the lines of Python code that they reach.
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

from tools.fuzz.cases import BAD, CRASH, HANG, RESULTS, Outcome, Worker
from tools.fuzz.folders import Folders
from tools.fuzz.mutating import mutate
from tools.fuzz.seeds import CHANGED, MAKERS
from tools.fuzz.targets import SANDBOXED

TRIES = 60
"""Largest number of attempts to shorten a case."""


def shorten(folders: Folders, worker: Worker, name: str, data: bytes, outcome: Outcome) -> bytes:
    """Remove parts of a file as long as the outcome stays the same.

    Args:
        folders: where the cases are made.
        worker: process that tries them.
        name: path of the file in its folder.
        data: bytes of the file.
        outcome: outcome of the case with ``data``.

    Returns:
        The bytes of the shorter file.
    """
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
    """Fuzz one kind.

    Args:
        kind: a key of `MAKERS`.
        seconds: duration [s].
        seed: of the changes.
        out: folder of the kept cases.

    Returns:
        Entries "counts" (number of cases by result) and "faults" (the different faults).
    """
    random, worker = np.random.default_rng([seed, *kind.encode()]), Worker(kind)
    sandboxed = Worker(SANDBOXED)
    counts: Counter[str] = Counter()
    faults: dict[Outcome, str] = {}
    with tempfile.TemporaryDirectory(prefix="fuzz-") as name:
        folders, end = Folders(kind, Path(name)), time.monotonic() + seconds
        while time.monotonic() < end:
            changed = CHANGED[kind][random.integers(len(CHANGED[kind]))]
            data = mutate(changed, folders.good(changed), random)
            folder = folders.make(changed, data)
            outcome = worker(folder)
            if kind == "bag" and outcome.result in (CRASH, HANG):
                outcome = sandboxed(folder)
            counts[outcome.result] += 1
            shutil.rmtree(folder)
            if outcome.result in BAD and outcome not in faults:
                print(f"{kind}: {outcome.result}: {outcome.detail}", flush=True)
                data = shorten(folders, worker, changed, data, outcome)
                kept = out / f"{kind}_{len(faults)}"
                shutil.rmtree(kept, ignore_errors=True)
                shutil.copytree(folders.make(changed, data), kept)
                faults[outcome] = f"{kept}/{changed}"
        worker.stop()
        sandboxed.stop()
    return {
        "counts": {result: counts[result] for result in RESULTS},
        "faults": [{**asdict(outcome), "file": file} for outcome, file in faults.items()],
    }


def guided(kind: str, seconds: float, seed: int, out: Path) -> dict[str, object]:
    """Fuzz one kind with atheris in a process of its own, which atheris may end; as `fuzz`."""
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
    """Fuzz the requested kinds; returns the exit code, 1 if a fault was found."""
    head, _, rest = (__doc__ or "").partition("\n")
    parser = argparse.ArgumentParser(
        prog="python -m tools.fuzz",
        description=head,
        epilog=rest,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("kinds", nargs="*", metavar="KIND", choices=[*MAKERS, []])
    parser.add_argument("--minutes", type=float, default=6.0, help="duration of all kinds together")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("out/fuzz"))
    parser.add_argument("--guided", action="store_true", help="choose the cases with atheris")
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
    return int(any(entry["faults"] for entry in found.values()))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

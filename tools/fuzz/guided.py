"""Fuzzing guided by atheris, which chooses cases by the lines of Python code that they reach.

``--guided`` starts ``python -m tools.fuzz.guided KIND SECONDS SEED OUT FOLDER``. libFuzzer controls
this process and ends it at a crash or a hang. Counts and faults are in OUT/KIND_guided.json.
"""

from __future__ import annotations

import json
import shutil
import sys
from collections import Counter
from pathlib import Path

import atheris
import numpy as np

from tools.fuzz.cases import BAD, RESULTS, SECONDS, attempt, warm_up
from tools.fuzz.folders import Folders
from tools.fuzz.mutating import mutate
from tools.fuzz.seeds import CHANGED
from tools.fuzz.watching import Watch

INSTRUMENTED = ["reality_gap", "jmm_agent", "kengoro_env", "experiments", "mjcf_sandbox"]


class GuidedFuzzer:
    """Callbacks of atheris for one kind. Its inputs are the path of a file, a zero byte, the file.

    Args:
        kind: a key of `MAKERS`.
        out: folder of the kept cases and the summary.
        folders: where the cases are made.
    """

    def __init__(self, kind: str, out: Path, folders: Folders) -> None:
        self._kind, self._out, self._folders = kind, out, folders
        self._watch = Watch()
        self._counts: Counter[str] = Counter()
        self._faults: dict[str, str] = {}

    def write_summary(self) -> None:
        """Write counts and faults so far."""
        counts = {result: self._counts[result] for result in RESULTS}
        text = json.dumps({"counts": counts, "faults": self._faults})
        (self._out / f"{self._kind}_guided.json").write_text(text, encoding="utf-8")

    def write_corpus(self, folder: Path) -> None:
        """Write the valid files as inputs to an empty folder."""
        for i, name in enumerate(sorted(set(CHANGED[self._kind]))):
            data = name.encode() + b"\0" + self._folders.good(name)
            (folder / str(i)).write_bytes(data)

    def try_input(self, data: bytes) -> None:
        """Try the case of an input."""
        name, _, content = data.partition(b"\0")
        if name.decode("utf-8", "replace") not in CHANGED[self._kind]:
            return
        folder = self._folders.make(name.decode(), content)
        outcome = attempt(self._kind, folder, self._watch)
        self._counts[outcome.result] += 1
        if outcome.result in BAD and outcome.detail not in self._faults:
            kept = self._out / f"{self._kind}_guided_{len(self._faults)}"
            shutil.copytree(folder, kept, dirs_exist_ok=True)
            self._faults[outcome.detail] = f"{outcome.result}: {kept}"
        shutil.rmtree(folder)
        if sum(self._counts.values()) % 10 == 0:
            self.write_summary()

    def mutate_input(self, data: bytes, max_size: int, seed: int) -> bytes:
        """Change the file of an input; the result has at most ``max_size`` bytes."""
        name, _, content = data.partition(b"\0")
        if name.decode("utf-8", "replace") not in CHANGED[self._kind]:
            first = CHANGED[self._kind][0]
            name, content = first.encode(), self._folders.good(first)
        new = mutate(name.decode(), content, np.random.default_rng(seed))
        return (name + b"\0" + new)[:max_size]


def main(kind: str, seconds: str, seed: str, out: str, empty: str) -> None:
    """Fuzz one kind until the time is over or the process ends.

    Args:
        kind: a key of `MAKERS`.
        seconds: duration [s].
        seed: of the changes.
        out: folder of the kept cases and the summary.
        empty: empty folder in which the cases are made.
    """
    with atheris.instrument_imports(include=INSTRUMENTED):
        warm_up(kind)
    location = Path(empty)
    fuzzer = GuidedFuzzer(kind, Path(out), Folders(kind, location))
    corpus = location / "corpus"
    corpus.mkdir()
    fuzzer.write_corpus(corpus)
    flags = [
        f"-max_total_time={round(float(seconds))}",
        f"-seed={int(seed) + 1}",
        f"-timeout={round(6 * SECONDS)}",
        f"-artifact_prefix={out}/{kind}_guided_",
        "-rss_limit_mb=4096",
        "-max_len=200000",
    ]
    fuzzer.write_summary()
    arguments = [sys.argv[0], *flags, str(corpus)]
    atheris.Setup(arguments, fuzzer.try_input, custom_mutator=fuzzer.mutate_input)
    atheris.Fuzz()


if __name__ == "__main__":
    main(*sys.argv[1:])

"""Cases chosen by atheris, by the lines of our Python code that they reach.

``python -m tools.fuzz.guided KIND SECONDS SEED OUT PLACE`` is what ``--guided`` starts: libFuzzer
owns its process, and ends it at a crash or a hang. Counts and faults are in OUT/KIND_guided.json.
"""

from __future__ import annotations

import json
import shutil
import sys
from collections import Counter
from pathlib import Path

import atheris
import numpy as np

from tools.fuzz.cases import BAD, OUTCOMES, SECONDS, attempt, warm_up
from tools.fuzz.folders import Folders
from tools.fuzz.mutating import mutate
from tools.fuzz.seeds import CHANGED
from tools.fuzz.watching import Watch

OURS = ["reality_gap", "jmm_agent", "kengoro_env", "experiments", "mjcf_sandbox"]


def main(kind: str, seconds: str, seed: str, out: str, empty: str) -> None:
    """Fuzz one kind until the time is over, or the process is, in an empty folder."""
    with atheris.instrument_imports(include=OURS):
        warm_up(kind)
    location = Path(empty)
    folders, watch = Folders(kind, location), Watch()
    counts: Counter[str] = Counter()
    faults: dict[str, str] = {}

    def note() -> None:
        text = json.dumps({"counts": {what: counts[what] for what in OUTCOMES}, "faults": faults})
        (Path(out) / f"{kind}_guided.json").write_text(text, encoding="utf-8")

    def use(data: bytes) -> None:
        name, _, content = data.partition(b"\0")
        if name.decode("utf-8", "replace") not in CHANGED[kind]:
            return
        folder = folders.make(name.decode(), content)
        outcome = attempt(kind, folder, watch)
        counts[outcome.what] += 1
        if outcome.what in BAD and outcome.detail not in faults:
            kept = Path(out) / f"{kind}_guided_{len(faults)}"
            shutil.copytree(folder, kept, dirs_exist_ok=True)
            faults[outcome.detail] = f"{outcome.what}: {kept}"
        shutil.rmtree(folder)
        if sum(counts.values()) % 10 == 0:
            note()

    def change(data: bytes, most: int, number: int) -> bytes:
        name, _, content = data.partition(b"\0")
        if name.decode("utf-8", "replace") not in CHANGED[kind]:
            name, content = CHANGED[kind][0].encode(), folders.good(CHANGED[kind][0])
        new = mutate(name.decode(), content, np.random.default_rng(number))
        return (name + b"\0" + new)[:most]

    corpus = location / "corpus"
    corpus.mkdir()
    for i, name in enumerate(sorted(set(CHANGED[kind]))):
        (corpus / str(i)).write_bytes(name.encode() + b"\0" + folders.good(name))
    flags = [
        f"-max_total_time={round(float(seconds))}",
        f"-seed={int(seed) + 1}",
        f"-timeout={round(6 * SECONDS)}",
        f"-artifact_prefix={out}/{kind}_guided_",
        "-rss_limit_mb=4096",
        "-max_len=200000",
    ]
    note()
    atheris.Setup([sys.argv[0], *flags, str(corpus)], use, custom_mutator=change)
    atheris.Fuzz()


if __name__ == "__main__":
    main(*sys.argv[1:])

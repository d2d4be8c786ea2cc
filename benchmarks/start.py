"""Time from the start of a program to its first observation, compared with Gymnasium's Humanoid.

Each run is a new process that imports the packages, makes an environment and resets it; the
environments alternate. Target: at most twice the median of Humanoid, and torch is not imported.
"""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

ROUNDS = 9
"""Timed processes for each environment."""

PROGRAM = """
import json, sys, time
begin = time.perf_counter()
{imports}
imported = time.perf_counter()
env = gymnasium.make({env_id!r}, **{arguments!r})
made = time.perf_counter()
env.reset(seed=0)
end = time.perf_counter()
print(json.dumps([imported - begin, made - imported, end - made, "torch" in sys.modules]))
"""

REFERENCE = "Humanoid-v5"
OURS = "import gymnasium, kengoro_env"
KINDS: dict[str, tuple[str, str, dict[str, bool]]] = {
    REFERENCE: ("import gymnasium", REFERENCE, {}),
    "Elbow": (OURS, "Kengoro/Elbow-v0", {}),
    "Posture, no camera": (OURS, "Kengoro/Posture-v0", {"camera": False}),
    "Posture": (OURS, "Kengoro/Posture-v0", {"camera": True}),
    "CanGrasp": (OURS, "Kengoro/CanGrasp-v0", {"camera": True}),
}


def start(kind: str) -> tuple[list[float], bool]:
    """Times of import, make and reset in a new process [s], and whether it imported torch."""
    imports, env_id, arguments = KINDS[kind]
    program = PROGRAM.format(imports=imports, env_id=env_id, arguments=arguments)
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    *seconds, torch = json.loads(done.stdout.splitlines()[-1])
    return seconds, torch


def main(rounds: int = ROUNDS) -> None:
    """Print the table."""
    times: dict[str, list[list[float]]] = {kind: [] for kind in KINDS}
    imported_torch = dict.fromkeys(KINDS, False)
    for kind in KINDS:
        start(kind)  # not counted: fills the disk cache
    for _ in track(range(rounds), "starting", console=Console(stderr=True)):
        for kind in KINDS:
            seconds, imported_torch[kind] = start(kind)
            times[kind].append(seconds)
    table = Table(title=f"Time to the first observation, medians of {rounds} new processes [s]")
    for column in ("environment", "import", "make", "reset", "total", "ratio to Humanoid", "torch"):
        table.add_column(column, justify="left" if column == "environment" else "right")
    total = {kind: float(np.median(np.sum(seconds, axis=1))) for kind, seconds in times.items()}
    for kind, seconds_of_kind in times.items():
        parts = [f"{part:.2f}" for part in np.median(seconds_of_kind, axis=0)]
        ratio = f"{total[kind] / total[REFERENCE]:.2f}"
        torch = "imported" if imported_torch[kind] else "not imported"
        table.add_row(kind, *parts, f"{total[kind]:.2f}", ratio, torch)
    Console().print(table)


if __name__ == "__main__":
    main()

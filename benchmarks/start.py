"""How long a program waits for its first observation, beside Gymnasium's Humanoid.

Each run is a fresh process that imports, makes an environment and resets it; the kinds take turns.
Target: at most twice Humanoid's median, and no torch among what was imported.
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

PEER = "Humanoid-v5"
OURS = "import gymnasium, kengoro_env"
KINDS: dict[str, tuple[str, str, dict[str, bool]]] = {
    PEER: ("import gymnasium", PEER, {}),
    "Elbow": (OURS, "Kengoro/Elbow-v0", {}),
    "Posture, no camera": (
        "import gymnasium, kengoro_env",
        "Kengoro/Posture-v0",
        {"camera": False},
    ),
    "Posture": (OURS, "Kengoro/Posture-v0", {}),
    "CanGrasp": (OURS, "Kengoro/CanGrasp-v0", {}),
}


def start(kind: str) -> tuple[list[float], bool]:
    """Seconds of import, make and reset in a fresh process, and whether it imported torch."""
    imports, env_id, arguments = KINDS[kind]
    program = PROGRAM.format(imports=imports, env_id=env_id, arguments=arguments)
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    *seconds, torch = json.loads(done.stdout.splitlines()[-1])
    return seconds, torch


def main(rounds: int = ROUNDS) -> None:
    """Print the table."""
    taken: dict[str, list[list[float]]] = {kind: [] for kind in KINDS}
    imported_torch = dict.fromkeys(KINDS, False)
    for kind in KINDS:
        start(kind)  # reads the files once
    for _ in track(range(rounds), "starting", console=Console(stderr=True)):
        for kind in KINDS:
            seconds, imported_torch[kind] = start(kind)
            taken[kind].append(seconds)
    table = Table(title=f"Seconds to the first observation, medians of {rounds} fresh processes")
    for column in ("environment", "import", "make", "reset", "in all", "over Humanoid's", "torch"):
        table.add_column(column, justify="left" if column == "environment" else "right")
    whole = {kind: float(np.median(np.sum(seconds, axis=1))) for kind, seconds in taken.items()}
    for kind, each in taken.items():
        parts = [f"{part:.2f}" for part in np.median(each, axis=0)]
        ratio = f"{whole[kind] / whole[PEER]:.2f}"
        torch = "imported" if imported_torch[kind] else "no"
        table.add_row(kind, *parts, f"{whole[kind]:.2f}", ratio, torch)
    Console().print(table)


if __name__ == "__main__":
    main()

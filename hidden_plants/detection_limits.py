"""Table of detection limits; ``python -m hidden_plants detection-limits`` computes it."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from hidden_plants.machine import Machine
from hidden_plants.mechanisms import MECHANISMS, structures
from hidden_plants.mechanisms.mechanism import Structure
from hidden_plants.motion import MOTIONS
from hidden_plants.oracle import detection_limit_of

TABLE = Path(__file__).with_name("detection_limits.json")


@dataclass(frozen=True)
class Row:
    """Detection limits of one structure, one for each motion; infinite where none is physical."""

    structure: Structure
    detection_limits: tuple[float, ...]


@lru_cache(maxsize=8)
def rows(machine: str, path: Path = TABLE) -> tuple[Row, ...]:
    """Read the rows of a machine."""
    table = json.loads(path.read_text()) if path.is_file() else {}
    return tuple(
        Row(
            Structure(row["id"], tuple(row["elements"]), row["shape"]),
            tuple(float("inf") if limit is None else limit for limit in row["limits"]),
        )
        for row in table.get(machine, [])
    )


def make_table(
    machine: Machine,
    path: Path = TABLE,
    ids: tuple[str, ...] = (),
    progress: Callable[[str], None] = print,
) -> None:
    """Compute the detection limits that the table lacks.

    The table is written after every structure, so that an interrupted run can be resumed.

    Args:
        machine: nominal model.
        path: JSON file of the table.
        ids: effects whose limits are computed again.
        progress: called with one line after every structure.
    """
    table = json.loads(path.read_text()) if path.is_file() else {}
    known = {_key(row): row["limits"] for row in table.get(machine.name, [])}
    wanted = [structure for id in MECHANISMS for structure in structures(machine, id)]
    lines: list[dict[str, Any]] = [
        {"id": s.id, "elements": list(s.elements), "shape": dict(s.shape), "limits": []}
        for s in wanted
    ]
    for line in lines:
        line["limits"] = [] if line["id"] in ids else known.get(_key(line), [])
    table[machine.name] = lines
    for motion in range(MOTIONS[machine.name]):
        for structure, line in zip(wanted, lines, strict=True):
            limits = line["limits"]
            if len(limits) > motion:
                continue
            found = detection_limit_of(machine, structure, motion, limits[-1] if limits else None)
            limits.append(float(f"{found:.4g}") if found < float("inf") else None)
            progress(f"motion {motion} {structure.id} {structure.elements}: {found:.3g}")
            part = path.with_suffix(".part")
            part.write_text(_text(table))
            part.replace(path)
    rows.cache_clear()


def _key(row: dict) -> str:
    return json.dumps([row["id"], row["elements"], row["shape"]], sort_keys=True)


def _text(table: dict[str, list[dict]]) -> str:
    """JSON with one line for each structure."""
    parts = []
    for machine, lines in sorted(table.items()):
        body = ",\n".join("  " + json.dumps(line) for line in lines)
        parts.append(f' "{machine}": [\n{body}\n ]')
    return "{\n" + ",\n".join(parts) + "\n}\n"

"""The table of detection limits, made once by ``python -m hidden_plants detection_limits``."""

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
    """The floors of one structure: by motion, infinite where it cannot be seen."""

    structure: Structure
    detection_limits: tuple[float, ...]


@lru_cache(maxsize=8)
def rows(machine: str, path: Path = TABLE) -> tuple[Row, ...]:
    """The table's rows of a machine."""
    table = json.loads(path.read_text()) if path.is_file() else {}
    return tuple(
        Row(
            Structure(row["id"], tuple(row["elements"]), row["shape"]),
            tuple(float("inf") if floor is None else floor for floor in row["limits"]),
        )
        for row in table.get(machine, [])
    )


def make_table(
    machine: Machine,
    path: Path = TABLE,
    ids: tuple[str, ...] = (),
    tell: Callable[[str], None] = print,
) -> None:
    """Compute the floors that the table lacks, and those of ``ids`` anew.

    The table is written after every structure, so that a run that was cut off goes on.
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
            detection_limits = line["limits"]
            if len(detection_limits) > motion:
                continue
            found = detection_limit_of(
                machine, structure, motion, detection_limits[-1] if detection_limits else None
            )
            detection_limits.append(float(f"{found:.4g}") if found < float("inf") else None)
            tell(f"motion {motion} {structure.id} {structure.elements}: {found:.3g}")
            beside = path.with_suffix(".part")
            beside.write_text(_text(table))
            beside.replace(path)
    rows.cache_clear()


def _key(row: dict) -> str:
    return json.dumps([row["id"], row["elements"], row["shape"]], sort_keys=True)


def _text(table: dict[str, list[dict]]) -> str:
    """JSON with one structure a line."""
    parts = []
    for machine, lines in sorted(table.items()):
        body = ",\n".join("  " + json.dumps(line) for line in lines)
        parts.append(f' "{machine}": [\n{body}\n ]')
    return "{\n" + ",\n".join(parts) + "\n}\n"

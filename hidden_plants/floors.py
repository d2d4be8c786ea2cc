"""The table of detection floors, made once by ``python -m hidden_plants floors``."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from hidden_plants.logs import write_text
from hidden_plants.machine import Machine
from hidden_plants.mechanisms import MECHANISMS, structures
from hidden_plants.mechanisms.mechanism import Structure
from hidden_plants.motion import MOTIONS
from hidden_plants.oracle import floor_of

TABLE = Path(__file__).with_name("floors.json")


@dataclass(frozen=True)
class Row:
    """The floors of one structure: by motion, infinite where it cannot be seen."""

    structure: Structure
    floors: tuple[float, ...]


@lru_cache(maxsize=8)
def rows(machine: str, path: Path = TABLE) -> tuple[Row, ...]:
    """The table's rows of a machine."""
    table = json.loads(path.read_text()) if path.is_file() else {}
    return tuple(
        Row(
            Structure(row["id"], tuple(row["elements"]), row["shape"]),
            tuple(float("inf") if floor is None else floor for floor in row["floors"]),
        )
        for row in table.get(machine, [])
    )


def make_table(
    machine: Machine,
    path: Path = TABLE,
    ids: tuple[str, ...] = tuple(MECHANISMS),
    tell: Callable[[str], None] = print,
) -> None:
    """Compute the floors of every structure of ``ids``; rows of other ids and machines stay."""
    table = json.loads(path.read_text()) if path.is_file() else {}
    made: dict[int, list[float]] = {}
    wanted = [structure for id in ids for structure in structures(machine, id)]
    for motion in range(MOTIONS[machine.name]):
        for k, structure in enumerate(wanted):
            known = [floor for floor in made.get(k, []) if floor < float("inf")]
            floor = floor_of(machine, structure, motion, known[-1] if known else None)
            made.setdefault(k, []).append(floor)
            tell(f"motion {motion} {structure.id} {structure.elements}: {floor:.3g}")
    kept = [row for row in table.get(machine.name, []) if row["id"] not in ids]
    table[machine.name] = kept + [
        {
            "id": structure.id,
            "elements": list(structure.elements),
            "shape": dict(structure.shape),
            "floors": [
                float(f"{floor:.4g}") if floor < float("inf") else None for floor in made[k]
            ],
        }
        for k, structure in enumerate(wanted)
    ]
    write_text(path, _text(table))
    rows.cache_clear()


def _text(table: dict[str, list[dict]]) -> str:
    """JSON with one structure a line."""
    parts = []
    for machine, lines in sorted(table.items()):
        body = ",\n".join("  " + json.dumps(line) for line in lines)
        parts.append(f' "{machine}": [\n{body}\n ]')
    return "{\n" + ",\n".join(parts) + "\n}\n"

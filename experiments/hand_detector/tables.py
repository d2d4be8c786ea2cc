"""Tables of the hand detector: criteria, groups of frames, and the weakest of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from experiments.hand_detector.criteria import (
    bad_rows,
    further,
    high,
    judged,
    movement_rows,
    pair_rows,
)
from experiments.hand_detector.frames import HIDDEN, SEEN
from experiments.hand_detector.movements import MOVEMENTS
from experiments.hand_detector.scores import (
    EXPECTED,
    Record,
    claims,
    covered,
    found,
    frames_of,
    seen,
)
from experiments.harness.criteria import criteria_table
from experiments.harness.report import Table

DISTANCES = (0.3, 0.4, 0.5, 0.6)
"""Edges of groups of distances [m]."""
VISIBILITIES = (0.25, 0.5, 0.75, 0.9)
"""Edges of groups of visible shares of the hand [1]."""
KINDS = (
    "skin", "table", "light", "camera", "rendered", "contrast", "posture", "can", "before the hand"
)  # fmt: skip
"""Kinds of appearance families."""
FEWEST = 10
"""Fewest frames of a family that may be called the weakest."""
HEAD = ("", "frames", "found [%]", "position, median [mm]", "95th [mm]", "rotation, median [deg]",
        "95th [deg]", "within the region [%]")  # fmt: skip
MOTION = (
    "One frame does not show which hand is the own one: the must is that of the next table. The "
    "other hand has the same shape and skin, with its forearm, at another pose. The expected pose "
    "is that of the own hand, 100 mm and 10 deg off."
)
MOVED_NOTE = (
    f"Scenes of {MOVEMENTS + 1} frames, from each to the next of which the own hand moves, and the "
    "head with the camera may. The second hand stays where it is in the world, or moves by itself. "
    "The agent chooses by the movements that the joints expect, with an expected pose that is 100 "
    "mm and 10 deg off, the same in all frames of a scene. The own one is chosen if a pose is "
    "claimed within 100 mm of it, and nearer to it than to the other. The detector finds what it "
    "is sure of."
)
EXPECTED_NOTE = (
    "The expected pose is 100 mm and 10 deg off, in random directions. The musts are for answers "
    "without one."
)
BAD_NOTE = (
    "Sure: standard deviations of at most 25 mm and 6 deg in any direction. Far outside: the claim "
    "excludes the truth by more than 99.9 %. Frozen: an old frame, while the hand, and with it the "
    "expected pose, has moved on; a single frame does not show it, so the agent's clock of frames "
    "has to. Photograph: of the hand on a flat board, while the hand is elsewhere."
)


def tables(records: Sequence[Record]) -> list[Table]:
    """All tables of the report."""
    more = criteria_table(further(records))
    expected = criteria_table(list(judged(records, EXPECTED).values()))
    bad, pairs = criteria_table(bad_rows(records)), criteria_table(pair_rows(records))
    moved = criteria_table(movement_rows(records))
    return [
        criteria_table(list(judged(records).values())),
        weakest(records),
        more._replace(title="Further numbers"),
        expected._replace(title="With a pose that the joints expect", note=EXPECTED_NOTE),
        bad._replace(title="Bad input", note=BAD_NOTE),
        pairs._replace(title="A second hand", note=MOTION),
        moved._replace(title="A second hand, and the own one moves", note=MOVED_NOTE),
        grouped("By distance", seen(records), by_edges("distance", DISTANCES, "m")),
        grouped(
            "By visible share of the hand",
            frames_of(records, SEEN, HIDDEN),
            by_edges("share", VISIBILITIES, ""),
        ),
        *(grouped(f"By {kind}", seen(records), by_family(kind)) for kind in KINDS),
    ]


def by_edges(key: str, edges: Sequence[float], unit: str) -> Callable[[Record], str]:
    """Name of a record's group between edges."""
    names = [f"below {edges[0]:g} {unit}"]
    names += [f"{a:g} to {b:g} {unit}" for a, b in pairwise(edges)]
    names.append(f"from {edges[-1]:g} {unit}")
    return lambda record: names[int(np.searchsorted(edges, record[key], side="right"))].strip()


def by_family(kind: str) -> Callable[[Record], str]:
    """Name of a record's family of a kind of appearance."""
    return lambda record: str(record["families"].get(kind, "unknown"))


def group_row(name: str, records: Sequence[Record]) -> tuple[object, ...]:
    """Row of a group of frames."""
    own = [r["without"] for r in records if claims(r)]
    cells: list[object] = []
    for key in ("position_mm", "rotation_deg"):
        errors = np.array([each[key] for each in own], dtype=float)
        cells += [f"{np.median(errors):.1f}", f"{high(errors):.1f}"] if len(own) else ["", ""]
    inside = [bool(covered(r)) for r in records if claims(r)]
    cells.append(f"{100 * np.mean(inside):.1f}" if inside else "")
    return (name, len(records), f"{100 * np.mean([found(r) for r in records]):.1f}", *cells)


def grouped(title: str, records: Sequence[Record], group: Callable[[Record], str]) -> Table:
    """Table of groups of frames."""
    names = sorted({group(record) for record in records})
    rows = [group_row(name, [r for r in records if group(r) == name]) for name in names]
    return Table(title, HEAD, rows, "Frames with at least half of the hand visible, if not named "
                 "otherwise.")  # fmt: skip


def weakest(records: Sequence[Record]) -> Table:
    """The weakest family of each kind: the one with the fewest found, then the largest errors."""
    rows = []
    for kind in KINDS:
        group, shown = by_family(kind), seen(records)
        families: dict[str, list[Record]] = {}
        for record in shown:
            families.setdefault(group(record), []).append(record)
        enough = {name: own for name, own in families.items() if len(own) >= FEWEST}
        if enough:
            worst = min(enough, key=lambda name: _strength(enough[name]))
            rows.append(group_row(f"{kind}: {worst}", enough[worst]))
    note = f"Of each kind the family with the fewest found, among those with {FEWEST} frames."
    return Table("Weakest families", HEAD, rows, note)


def _strength(records: Sequence[Record]) -> tuple[float, float]:
    errors = [r["without"]["position_mm"] for r in records if claims(r)]
    return float(np.mean([found(r) for r in records])), -float(high(np.array(errors or [np.inf])))

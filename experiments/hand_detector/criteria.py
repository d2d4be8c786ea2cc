"""Criteria of the hand detector, with their thresholds and intervals."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from experiments.hand_detector.bad_input import BAD, BLURRED, FROZEN, SECOND
from experiments.hand_detector.frames import HIDDEN
from experiments.hand_detector.movements import MOVEMENTS, MOVES, STILL
from experiments.hand_detector.scores import (
    EXPECTED,
    MOVED,
    OWN,
    WITHOUT,
    Record,
    claims,
    covered,
    elsewhere,
    empty,
    error,
    found,
    frames_of,
    other_chosen,
    own_chosen,
    seen,
    sure,
    sure_and_wrong,
    with_hand,
)
from experiments.harness.criteria import Row, middle, share
from experiments.harness.statistics import bootstrap_interval
from jmm_agent.types import Floats

RESAMPLES = 2000
"""Number of bootstrap samples of a percentile."""
TWICE = "TWICE"
"""Reason of an answer that more than one hand is in the frame."""
MUST: dict[str, dict[str, float]] = {
    "found": {"least": 98.0},
    "position_mm": {"most": 5.0},
    "rotation_deg": {"most": 1.5},
    "position_95_mm": {"most": 25.0},
    "rotation_95_deg": {"most": 6.0},
    "covered": {"least": 90.0, "most": 98.0},
    "false_claims": {"most": 1.0},
    "time_ms": {"most": 60.0},
}
"""Thresholds by the name of the metric."""
OWN_CHOSEN = 95.0
"""Least share of scenes with two hands in which the own one is chosen at the end [%]."""


def high(values: Floats, axis: int = -1) -> Floats:
    """The 95th percentile."""
    return np.asarray(np.percentile(values, 95.0, axis=axis))


def percentile(name: str, values: Iterable[float | None], unit: str, **must: float) -> Row:
    """95th percentile of some numbers with its bootstrap interval."""
    known = np.array([value for value in values if value is not None], dtype=float)
    if not len(known):
        return Row(name, 0, None, None, None, unit, **must)
    ends = bootstrap_interval(high, known, resamples=RESAMPLES)
    return Row(name, len(known), float(high(known)), *ends, unit, **must)


def judged(records: Sequence[Record], key: str = WITHOUT) -> dict[str, Row]:
    """The criteria of the answers without or with an expected pose; thresholds are for without."""
    usual = key == WITHOUT
    must = MUST if usual else {name: {} for name in MUST}
    shown, hands, nothing = seen(records), with_hand(records), empty(records)
    rows = {
        "found": share(
            "at least half visible: found", (found(r, key) for r in shown), **must["found"]
        ),
        "covered": share(
            "errors within the claimed 95 % region",
            (covered(r, key) for r in hands),
            **must["covered"],
        ),
        "false_claims": share(
            "no hand: claims one", (claims(r, key) for r in nothing), **must["false_claims"]
        ),
    }
    for name, unit in (("position_mm", "mm"), ("rotation_deg", "deg")):
        kind = name.split("_")[0]
        errors = [error(r, name, key) for r in shown]
        rows[name] = middle(f"{kind} error, median", errors, unit, **must[name])
        tail = f"{kind}_95_{unit}"
        rows[tail] = percentile(f"{kind} error, 95th percentile", errors, unit, **must[tail])
    if usual:
        times = (r["cpu_ms"] for r in shown)
        rows["time_ms"] = middle("time on one core, median", times, "ms", **must["time_ms"])
    return {name: rows[name] for name in MUST if name in rows}


def further(records: Sequence[Record]) -> list[Row]:
    """Numbers without a threshold."""
    shown, part = seen(records), frames_of(records, HIDDEN)
    rows = [
        share("claims in the air: farther than 100 mm from the hand", map(elsewhere, shown)),
        share("half visible: errors within the region", map(covered, shown)),
        share("less visible: found", map(found, part)),
        share("less visible: errors within the region", map(covered, part)),
        middle("less visible: position error, median", (error(r, "position_mm") for r in part),
               "mm"),
        share("sure, and far outside of the own region", map(sure_and_wrong, with_hand(records))),
        percentile("time on one core, 95th percentile", (r["cpu_ms"] for r in shown), "ms"),
        middle("time by the clock, median", (r["wall_ms"] for r in shown), "ms"),
    ]  # fmt: skip
    return rows


def bad_rows(records: Sequence[Record]) -> list[Row]:
    """Shares of bad frames that a pose is claimed for, and how sure it is."""
    rows = []
    for name in BAD:
        bad = [r for r in records if r["of"] == name]
        rows.append(share(f"{name}: claims a pose", map(claims, bad)))
        rows.append(share(f"{name}: claims one, and is sure", map(sure, bad)))
        if name in (FROZEN, BLURRED):  # the hand is in the frame, so that a claim may be right
            rows.append(share(f"{name}: is sure, and far outside", map(sure_and_wrong, bad)))
    return rows


def pair_rows(records: Sequence[Record]) -> list[Row]:
    """Shares of frames with two hands of which the own one is claimed."""
    two, rows = [r for r in records if r["of"] == SECOND], []
    for key, title in ((WITHOUT, "two hands"), (EXPECTED, "pose expected")):
        right = (own_chosen(r, key) or r[key]["reason"] == TWICE for r in two)
        rows.append(share(f"{title}: the own one is claimed", (own_chosen(r, key) for r in two)))
        rows.append(share(f"{title}: the own one, or 'there are two'", right))
        rows.append(share(f"{title}: another is claimed", (other_chosen(r, key) for r in two)))
    return rows


def movement_rows(records: Sequence[Record]) -> list[Row]:
    """Shares of scenes and frames with two hands in which the own one is chosen by movements; the
    first has the must."""
    scenes = [r for r in records if r["of"] == MOVED]
    frames = [frame for scene in scenes for frame in scene["frames"]]
    ends = {kind: [r["frames"][-1] for r in scenes if r["kind"] == kind] for kind in (STILL, MOVES)}
    last = [frame for own in ends.values() for frame in own]
    shown, end = [frame for frame in last if frame["finds"]], f"after {MOVEMENTS} movements"
    return [
        share(f"{end}: the own one is chosen", (own_chosen(f, OWN) for f in last),
              least=OWN_CHOSEN),
        *(share(f"{end}: the same, the second hand {kind}", (own_chosen(f, OWN) for f in own))
          for kind, own in ends.items()),
        share(f"{end}: the same, where the detector finds it", (own_chosen(f, OWN) for f in shown)),
        share(f"{end}: another is chosen", (other_chosen(f, OWN) for f in last)),
        share("all frames: another is chosen", (other_chosen(f, OWN) for f in frames)),
        share("all frames: the detector finds the own one", (f["finds"] for f in frames)),
        share("all frames: it finds both", (f["finds"] and f["finds_other"] for f in frames)),
    ]  # fmt: skip


def metrics(rows: dict[str, Row]) -> dict[str, dict[str, object]]:
    """Metrics of the summary: threshold, value with its interval, and whether it is reached."""
    return {
        key: {
            "must": row.must,
            "value": row.value,
            "interval": [row.low, row.high],
            "cases": row.cases,
            "unit": row.unit,
            "reached": row.reached,
        }
        for key, row in rows.items()
    }

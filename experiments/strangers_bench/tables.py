"""Tables of the strangers' bench: what went wrong, by effect and by kind of machine."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence

from experiments.harness.criteria import Row, criteria_table
from experiments.harness.report import Table
from experiments.strangers_bench.criteria import of_kind
from experiments.strangers_bench.scores import (
    Trial,
    exact_set,
    false_alarm,
    false_names,
    first_name,
    rejected,
    right_first,
    sure_and_wrong,
)

SIZES = (0.15, 0.5, 1.0)
"""Bounds of the reach between the rows of the table of machines [m]."""


def tables(rows: Sequence[Row], trials: Sequence[Trial]) -> list[Table]:
    """All tables of the report."""
    return [
        criteria_table(rows),
        effects_table(trials),
        machines_table(trials),
        wrong_table(trials),
    ]


def effects_table(trials: Sequence[Trial]) -> Table:
    """Table of the first names of each single effect, and of effects outside the catalogue."""
    found = []
    for kind in ("single", "outside"):
        own = of_kind(trials, kind)
        for id in sorted({t["truth"][0]["effect"] for t in own}):
            some = [t for t in own if t["truth"][0]["effect"] == id]
            right, exact = (right_first, exact_set) if kind == "single" else (rejected, rejected)
            names = Counter(first_name(t) for t in some).most_common()
            text = ", ".join(f"{n} {name}" for name, n in names)
            found.append((id, kind, len(some), _of(right, some), _of(exact, some), text))
    head = ("effect", "", "n", "right first", "exact", "named first")
    return Table("What was named, by hidden effect", head, found)


def machines_table(trials: Sequence[Trial]) -> Table:
    """Table of the scores by kind of machine, by size, and by what was measured."""
    groups: dict[str, Callable[[Trial], str]] = {
        "kind": lambda t: str(t["machine"]["kind"]),
        "reach": lambda t: _size(t["machine"]["reach"]),
        "resolution": lambda t: "up to 12 bits" if t["machine"]["position_bits"] <= 12 else "finer",
        "noise": lambda t: "stated" if t["machine"]["noise_stated"] else "estimated",
        "defaults": lambda t: "of all elements" if t["machine"]["tricky_defaults"] else "none",
        "joints": lambda t: "1 to 3" if t["machine"]["joints"] <= 3 else "4 to 7",
    }
    rows = []
    for title, group in groups.items():
        for value in sorted({group(t) for t in trials}):
            own = [t for t in trials if group(t) == value]
            single, null = of_kind(own, "single"), of_kind(own, "null")
            rows.append(
                (
                    f"{title}: {value}",
                    len(own),
                    _of(right_first, single),
                    _of(exact_set, single),
                    _of(false_alarm, null),
                    _of(rejected, of_kind(own, "outside")),
                    _of(sure_and_wrong, own),
                )
            )
    head = ("machines", "n", "right first", "exact", "false alarms", "outside", "sure and wrong")
    return Table("Scores by machine", head, rows)


def _size(reach: float) -> str:
    for i, bound in enumerate(SIZES):
        if reach < bound:
            return f"{(0.0, *SIZES)[i]:g} to {bound:g} m"
    return f"above {SIZES[-1]:g} m"


def wrong_table(trials: Sequence[Trial]) -> Table:
    """Table of all trials with a wrong answer."""
    rows = []
    for t in trials:
        if is_right(t):
            continue
        m = t["machine"]
        kind = f"{m['kind']}, {m['joints']} joints, {m['reach']:.2g} m, {m['rate']:g} Hz"
        hidden = "; ".join(_effect(e) for e in t["truth"]) or "nothing"
        false = [c["cause"] for c in false_names(t)]
        named = "; ".join(
            f"{'FALSE ' if c['cause'] in false else ''}{c['cause']} at {', '.join(c['elements'])} "
            f"({c['confidence'] or 0:.2f})"
            for c in t["causes"]
        )
        rms = " -> ".join("" if x is None else f"{x:.3g}" for x in t["rms"][:2])
        answer = named or t["reason"][:80]
        rows.append((t["case"]["seed"], kind, hidden, t["verdict"], answer, rms))
    head = ("seed", "machine", "hidden", "verdict", "named (confidence)", "RMS [noises]")
    return Table("Wrong answers", head, rows)


def _effect(effect: dict[str, object]) -> str:
    multiple = effect["multiple"]
    size = "" if multiple is None else f" ({multiple:.3g} floors)"
    elements = effect["elements"]
    assert isinstance(elements, list)
    return f"{effect['effect']} at {', '.join(elements[:3])}{size}"


def is_right(trial: Trial) -> bool:
    """Whether the answer to a trial is right."""
    kind = trial["case"]["kind"]
    if kind == "null":
        return trial["verdict"] == "nothing_wrong"
    return rejected(trial) if kind == "outside" else exact_set(trial)


def _of(test: Callable[[Trial], bool], trials: Iterable[Trial]) -> str:
    known = [test(t) for t in trials]
    return f"{sum(known)} of {len(known)}" if known else ""

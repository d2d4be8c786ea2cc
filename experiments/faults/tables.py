"""Tables of the faults: detection, its delay, and effects on map and tensions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from experiments.faults.frames import OF_HAND
from experiments.harness.report import Table
from experiments.harness.statistics import median_cell, metric
from jmm_agent.guard import faults
from jmm_agent.guard.faults import KINDS

NO_FAULT = "no_fault"
"""Trial of the same duration without a fault."""

IN_TIME = 2.0
"""Time within which a fault must be named [s]."""

KEPT = 1.2
"""Threshold of the ratio of the map's error after and before a fault."""

LINGERS = 3.0
"""Time after the end of a fault in which naming it is no error [s]."""


def seed_entry(result: Mapping[str, Any]) -> dict[str, Any]:
    """Entry of one robot in the summary: its learning, and each fault."""
    learning = result["learning"]
    return {
        "learning": {
            "false_namings": [f"{kind} {where}" for kind, where, _ in learning["named"]],
            "largest_demand_N": round(learning["largest_demand_N"], 3),
            "not_finite": learning["not_finite"],
        },
        **{kind: _trial_entry(trial) for kind, trial in result["trials"].items()},
    }


def _trial_entry(trial: Mapping[str, Any]) -> dict[str, Any]:
    gone = trial["gone"]
    shown = np.inf if trial["shown"] is None else trial["shown"]
    right = [
        time - shown
        for kind, where, times in trial["named"]
        if where == trial["where"] and kind in _right_names(trial["kind"])
        for time in times
        if time >= shown
    ]
    healed = gone + LINGERS if trial["kind"] != faults.MUSCLE_SNAPPED else np.inf
    during, later = [], []
    for kind, where, times in trial["named"]:
        same = (kind, where) == (trial["kind"], trial["where"])
        for time in times:
            if time > healed or trial["kind"] == NO_FAULT:
                later.append(f"{kind} {where}")
            elif not same or time < shown:
                during.append(f"{kind} {where}")
    return {
        "where": trial["where"],
        "shown_after_s": round(shown - trial["begin"], 2) if np.isfinite(shown) else None,
        "noticed_after_s": round(min(right), 2) if right else None,
        "also_named": sorted(set(during)),
        "false_namings": later,
        "still_named": trial["still_named"],
        "before_mm": round(trial["before_mm"], 3),
        "after_mm": round(trial["after_mm"], 3),
        "ratio": round(trial["after_mm"] / trial["before_mm"], 3),
        "largest_demand_N": round(trial["largest_demand_N"], 3),
        "largest_tension_N": round(trial["largest_tension_N"], 1),
        "not_finite": trial["not_finite"],
        "taken_back": trial["taken_back"],
    }


def _right_names(kind: str) -> tuple[str, ...]:
    """Names of a fault. Which one of a hand without a marker is named depends on what its detector
    takes the frame for: it may see no hand in a mirrored one."""
    return OF_HAND if kind in OF_HAND else (kind,)


def metrics(per_seed: Mapping[int, Mapping[str, Any]]) -> dict[str, Any]:
    """Metrics of the guard."""
    entries = list(per_seed.values())
    trials = _shown(entry[kind] for entry in entries for kind in KINDS if kind in entry)
    whole = [part for entry in entries for part in entry.values()]
    found: dict[str, Any] = {}
    for kind in (NO_FAULT, *KINDS):
        mine = [entry[kind] for entry in entries if kind in entry]
        if not mine:
            continue
        if shown := _shown(mine):
            found[f"{kind}_in_time"] = _share_in_time(shown)
        if kind != faults.MUSCLE_SNAPPED:
            found[f"{kind}_ratio"] = metric([trial["ratio"] for trial in mine], "", KEPT)
    if trials:
        found["noticed_in_time"] = _share_in_time(trials)
    demands = [part["largest_demand_N"] for part in whole]
    found["largest_demand"] = metric([max(demands)], "N")
    found["not_finite"] = metric([float(sum(part["not_finite"] for part in whole))], "", 0.0)
    return found


def _shown(trials: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Trials in which the fault had an effect; faults of marker or hand have none out of view."""
    return [trial for trial in trials if trial["shown_after_s"] is not None]


def _share_in_time(trials: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    share = 100.0 * sum(map(_in_time, trials)) / len(trials)
    return metric([share], "%", 100.0, good="high")


def _in_time(trial: Mapping[str, Any]) -> bool:
    after = trial["noticed_after_s"]
    return after is not None and after <= IN_TIME


def tables(per_seed: Mapping[int, Mapping[str, Any]]) -> list[Table]:
    """Table with a row for each fault, and table of wrong names."""
    entries = list(per_seed.values())
    rows = [
        _row(kind, [entry[kind] for entry in entries if kind in entry])
        for kind in (NO_FAULT, *KINDS)
        if any(kind in entry for entry in entries)
    ]
    head = (
        "fault", f"named within {IN_TIME:g} s", "after [s]", "also named",
        "map's error after / before", "robots above 1.2", "largest demand [N]",
        "largest tension [N]", "not finite",
    )  # fmt: skip
    note = (
        f"{len(entries)} robots. Times and ratios: median (worst robot). Times start at the first "
        "effect of the fault; a fault of marker or hand has none while it is out of view. For one "
        "of a hand without a marker any of them counts: the detector may see none in a mirrored "
        "frame. Also named: number of robots on which something else was named during the fault. "
        "Demand: "
        "largest tension demanded by a command at the lengths that the agent measured; tension: "
        "largest true tension."
    )
    return [Table("Faults during learning", head, rows, note), _false_table(entries)]


def _row(kind: str, trials: list[Mapping[str, Any]]) -> list[object]:
    after = [t["noticed_after_s"] for t in trials if t["noticed_after_s"] is not None]
    ratios = [trial["ratio"] for trial in trials]
    healed, shown = kind != faults.MUSCLE_SNAPPED, _shown(trials)
    return [
        kind,
        f"{sum(map(_in_time, shown))} of {len(shown)}" if shown else "-",
        median_cell(after, 2) if after else "-",
        sum(bool(trial["also_named"]) for trial in trials),
        median_cell(ratios, 2) if healed else "does not heal",
        sum(ratio > KEPT for ratio in ratios) if healed else "-",
        f"{max(trial['largest_demand_N'] for trial in trials):.1f}",
        f"{max(trial['largest_tension_N'] for trial in trials):.1f}",
        sum(trial["not_finite"] for trial in trials),
    ]


def _false_table(entries: list[Mapping[str, Any]]) -> Table:
    """Table of wrong names: without a fault, or of another fault."""
    rows = []
    for name, key in (
        ("learning before the first fault", "learning"),
        ("same duration without a fault", NO_FAULT),
    ):
        parts = [entry[key]["false_namings"] for entry in entries if key in entry]
        rows.append((name, *_counted(parts)))
    for kind in KINDS:
        trials = [entry[kind] for entry in entries if kind in entry]
        for label, key in ((f"{kind}: during", "also_named"), (f"{kind}: later", "false_namings")):
            parts = [trial[key] for trial in trials]
            if any(parts):
                rows.append((label, *_counted(parts)))
    return Table("Wrong names", ("when", "robots", "names"), rows)


def _counted(parts: list[list[str]]) -> tuple[str, str]:
    names = sorted({name for part in parts for name in part})
    return f"{sum(map(bool, parts))} of {len(parts)}", ", ".join(names) or "nothing"

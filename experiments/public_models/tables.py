"""Tables and metrics of the public models."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from experiments.harness.report import Table
from experiments.public_models.trial import KINDS, NULL, PAYLOAD

Trial = Mapping[str, Any]

RIGHT, LEAST, SURE = 0.95, 20, 0.9
"""Least share of right answers, least number of models, and confidence from which one is sure."""
SAME = ("payload", "link_mass")
"""Causes that are a mass at the end of the machine."""


def is_right(trial: Trial) -> bool:
    """Whether the answer is right.

    Without a payload, nothing must be wrong. With one, a cause must be named, and each named cause
    must be a payload or a link's mass at that link, or be declared equivalent to one.
    """
    if trial["kind"] == NULL:
        return bool(trial["verdict"] == "nothing_wrong")
    return bool(trial["causes"]) and not false_names(trial)


def false_names(trial: Trial) -> list[Mapping[str, Any]]:
    """Named causes that are not, nor are declared equivalent to, what is there."""
    return [c for c in trial["causes"] if trial["kind"] == NULL or not _is_payload(trial, c)]


def _is_payload(trial: Trial, cause: Mapping[str, Any]) -> bool:
    if set(SAME) & set(cause["equivalent"]):
        return True
    locations = [cause["elements"], *(location["elements"] for location in cause["elsewhere"])]
    links = set(trial["end_link"])
    return cause["cause"] in SAME and any(links & set(elements) for elements in locations)


def sure_and_wrong(trial: Trial) -> bool:
    """Whether a false name has a confidence of at least `SURE`."""
    return any((cause["confidence"] or 0.0) >= SURE for cause in false_names(trial))


def metrics(trials: Sequence[Trial]) -> dict[str, dict[str, object]]:
    """Metrics of the summary."""
    used = [t for t in trials if not t["unusable"]]
    models = len({t["model"] for t in used})
    share = sum(map(is_right, used)) / len(used)
    wrong = sum(map(sure_and_wrong, used))
    return {
        "models": _metric(f"at least {LEAST}", models, "1", models >= LEAST),
        "right": _metric(f"at least {RIGHT:g}", share, "of logs", share >= RIGHT),
        "sure_and_wrong": _metric("at most 0", wrong, "logs", wrong == 0),
    }


def _metric(must: str, value: float, unit: str, reached: bool) -> dict[str, object]:
    return {"must": must, "value": value, "unit": unit, "reached": reached}


def tables(trials: Sequence[Trial], skipped: Mapping[str, str]) -> list[Table]:
    """All tables of the report."""
    found = [models_table(trials), wrong_table(trials), changes_table(trials)]
    left_out = list(skipped.items())
    left_out += [(f"{t['model']}, {t['kind']}", t["unusable"]) for t in trials if t["unusable"]]
    if left_out:
        found.append(Table("Left out", ("model", "reason"), left_out))
    return found


def models_table(trials: Sequence[Trial]) -> Table:
    """Table of the answers by model."""
    by_name: dict[str, dict[str, Trial]] = {}
    for trial in trials:
        if not trial["unusable"]:
            by_name.setdefault(trial["model"], {})[trial["kind"]] = trial
    rows = []
    for name, pair in by_name.items():
        one = next(iter(pair.values()))
        rows.append(
            (
                name,
                one["group"],
                one["joints"],
                one["actuators"],
                one["log"],
                *(_answer(pair[kind]) if kind in pair else "" for kind in KINDS),
                f"{pair[PAYLOAD]['effect']:.0f}" if PAYLOAD in pair else "",
                f"{max(t['core_seconds'] for t in pair.values()):.0f}",
                f"{max(t['memory'] for t in pair.values()):.0f}",
            )
        )
    traits = ("model", "kind", "joints", "actuators", "log")
    head = (*traits, *KINDS, "effect [noises]", "core time [s]", "memory [MB]")
    note = "Time and memory are those of the longer and of the larger of both diagnoses."
    return Table("Public models", head, rows, note)


def _answer(trial: Trial) -> str:
    """The verdict, and whether it is right."""
    judged = "right" if is_right(trial) else "SURE AND WRONG" if sure_and_wrong(trial) else "wrong"
    return f"{str(trial['verdict']).replace('_', ' ')}: {judged}"


def wrong_table(trials: Sequence[Trial]) -> Table:
    """Table of the answers that are not right."""
    rows = []
    for trial in trials:
        if trial["unusable"] or is_right(trial):
            continue
        names = "; ".join(
            f"{c['cause']} at {', '.join(c['elements'])} ({c['confidence'] or 0.0:.2f})"
            for c in trial["causes"]
        )
        errors = (trial["rms_before"], trial["rms_after"])
        rms = " -> ".join("" if x is None else f"{x:.3g}" for x in errors)
        hidden = "" if trial["kind"] == NULL else f"{trial['mass']:.3g} kg at {trial['end']}"
        named = names or trial["sentence"][:120]
        rows.append((trial["model"], hidden or "nothing", trial["verdict"], named, rms))
    head = ("model", "hidden", "verdict", "named (confidence)", "RMS [noises]")
    return Table("Wrong answers", head, rows)


def changes_table(trials: Sequence[Trial]) -> Table:
    """Table of what was changed in the models."""
    notes = {t["model"]: " ".join(t["notes"]) for t in trials if not t["unusable"]}
    return Table("Changes of the models", ("model", "changes"), list(notes.items()))

"""Log text: values of causes in each log, and what a log cannot show, as sentences and rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from reality_gap.causes.base import Location
from reality_gap.diagnosis import Diagnosis, NamedCause
from reality_gap.log_findings import Estimate, FlatDirection, LogComparison, Remedy
from reality_gap.report.formatting import (
    capital,
    human,
    joined,
    number,
    probability,
    rounded,
    shown,
    with_interval,
)

MANY = 6
"""Number of elements above which only some are listed."""
NOT_TRIED = "not computed: commands of another motion cannot be simulated from this log"
NONE = "none of the motions that were tried, within the range of this log"


def agreement(compared: LogComparison) -> str:
    """Return whether a cause is the same in all logs, as a sentence."""
    if compared.chance is None:
        shown_in = [value.log for value in compared.values if value.parameters]
        where = f"in {shown_in[0]} only" if shown_in else "in none of the logs alone"
        return f"Between the logs: unknown, because it shows {where}."
    chance = probability(compared.chance)
    if compared.agreement == "changed":
        return f"Between the logs: changed (such differences have a probability of {chance})."
    if compared.agreement == "same":
        return f"Between the logs: the same (such differences have a probability of {chance})."
    return "Between the logs: unknown, because the values of single logs are too uncertain."


def log_rows(cause: NamedCause) -> list[tuple[str, str, str, str]]:
    """Return rows of log, parameter, value and 95 % interval; empty if there is one log."""
    rows = []
    for value in cause.logs.values if cause.logs else ():
        names = [name for name in cause.foremost() if name in value.parameters]
        if not names:
            rows.append((value.log, "", "does not show", ""))
        for name in names:
            size, interval = _written(cause, name, value.parameters[name])
            rows.append((value.log, human(name), size, interval))
    return rows


def log_lines(diagnosis: Diagnosis) -> list[str]:
    """Return a line for each cause: its values in all logs, and whether they agree.

    A cause that acts in all logs, and more in one of them, has one line.
    """
    found = dict[tuple[str, Location], str]()
    for cause in diagnosis.causes:
        if cause.logs is None:
            continue
        values = [
            f"{log} {size} ({interval})" if interval else f"{log} {size}"
            for log, _, size, interval in _first_rows(cause)
        ]
        everywhere = replace(cause.candidate.location, log="")
        title = capital(f"{cause.candidate.cause.title} at {everywhere}")
        line = f"{title}: {', '.join(values)}. {agreement(cause.logs)}"
        found.setdefault((cause.candidate.cause.id, everywhere), line)
    return list(found.values())


def _first_rows(cause: NamedCause) -> list[tuple[str, str, str, str]]:
    """Return the first row of each log."""
    rows = {row[0]: row for row in reversed(log_rows(cause))}
    return [rows[value.log] for value in (cause.logs.values if cause.logs else ())]


def _written(cause: NamedCause, name: str, estimate: Estimate) -> tuple[str, str]:
    factor, unit = shown(estimate.unit, estimate.value)
    ends = with_interval(rounded(cause, name, estimate), factor)
    return f"{ends[0]} {unit}".strip(), f"{ends[1]} to {ends[2]} {unit}".strip()


def flat_rows(flat: Sequence[FlatDirection], separable: bool) -> list[tuple[str, str, str]]:
    """Return rows of causes with locations, size of the effect, and what would show them.

    Args:
        flat: what the log cannot show.
        separable: whether to return the causes that do not show, or else those of which it cannot
            be told which one it is.
    """
    return [
        (_names(one), f"{number(one.change, 2)} noises", _remedy(one))
        for one in flat
        if one.separable is separable
    ]


def flat_line(diagnosis: Diagnosis) -> str:
    """Return how much a log cannot show, as one line; empty if nothing is known of that."""
    hidden = [one for one in diagnosis.flat if one.separable]
    together = [one for one in diagnosis.flat if not one.separable]
    found = []
    if hidden:
        names = joined([human(one.candidates[0].cause.id) for one in hidden])
        found.append(f"whether these are there, at some locations or at all: {names}")
    if together:
        count = "one group" if len(together) == 1 else f"{len(together)} groups"
        found.append(f"which one it is within {count} of causes with the same effect")
    if not found:
        return ""
    remedies = [one.remedy for one in diagnosis.flat if one.remedy is not None]
    best = max(remedies, key=lambda r: sum(_same(r, other) for other in remedies), default=None)
    advice = f"; {_action(best)} would show most of it" if best else ""
    return f"This log cannot show {', nor '.join(found)}{advice}; the report lists all."


def _same(one: Remedy, other: Remedy) -> bool:
    return (one.motion, one.mass, one.body) == (other.motion, other.mass, other.body)


def _names(one: FlatDirection) -> str:
    """Return the candidates, those of one cause together."""
    causes: dict[str, list[str]] = {}
    for candidate in one.candidates:
        causes.setdefault(human(candidate.cause.id), []).append(str(candidate.location))
    parts = []
    for cause, locations in causes.items():
        more = f" and {len(locations) - MANY} more" if len(locations) > MANY else ""
        parts.append(f"{cause} at {', '.join(locations[:MANY])}{more}")
    return "; ".join(parts) if one.separable else " or ".join(parts)


def _remedy(one: FlatDirection) -> str:
    if one.remedy is None:
        return NONE if one.tried else NOT_TRIED
    return f"{_action(one.remedy)} ({number(one.remedy.change, 2)} noises)"


def _action(remedy: Remedy) -> str:
    mass = ""
    if remedy.mass:
        factor, unit = shown("kg", remedy.mass)
        mass = f" with {number(factor * remedy.mass, 2)} {unit} added at {remedy.body}"
    return f"{remedy.seconds:.0f} s of {remedy.motion}{mass}"

"""Dates: times in ISO 8601 and in other usual forms as seconds."""

from __future__ import annotations

import re
from datetime import UTC, datetime

_ISO = re.compile(r"\d{4}-\d{2}-\d{2}[T ]\d{2}:\d{2}")
_ZONE = re.compile(r"\s*(UTC|GMT)$")
_DATE = re.compile(r"(\d{1,4})([./-])(\d{1,2})\2(\d{1,4})[T,\s]\s*(.+)")
_CLOCK = re.compile(r"(\d{1,2}):(\d{2}):(\d{2})([.,:]\d+)?\s*([AaPp][Mm])?")


def is_iso(text: str) -> bool:
    """Return whether a text begins like a time in ISO 8601."""
    return bool(_ISO.match(text.strip()))


def iso_seconds(text: str) -> float:
    """Return the seconds since 1970 of a time in ISO 8601, which is UTC if it has no zone.

    Raises:
        ValueError: it is no such time.
    """
    time = datetime.fromisoformat(_ZONE.sub("+00:00", text.strip()))
    return (time if time.tzinfo else time.replace(tzinfo=UTC)).timestamp()


def seconds_of(text: str) -> float | None:
    """Return a date and time as seconds since 1970, or a time of day as seconds since midnight.

    Dates may be in ISO 8601, or as in 27.10.2024, 10/27/2024, 27/10/2024 or 2024/10/27; where both
    are possible, the month comes first before slashes and the day before points.

    Args:
        text: a cell.

    Returns:
        The time [s]; None if the cell holds neither.
    """
    text = text.strip()
    if is_iso(text):
        try:
            return iso_seconds(text)
        except ValueError:
            return None
    found = _DATE.fullmatch(text)
    clock = _clock(found[5] if found else text)
    if clock is None or found is None:
        return clock
    one, two, three = int(found[1]), int(found[3]), int(found[4])
    if one > 31:
        year, month, day = one, two, three
    elif (found[2] == "/" and two > 12) or (found[2] == "/" and one <= 12):
        month, day, year = one, two, three
    else:
        day, month, year = one, two, three
    try:
        return datetime(year, month, day, tzinfo=UTC).timestamp() + clock
    except ValueError:
        return None


def _clock(text: str) -> float | None:
    """Return a time of day as seconds since midnight; None if it is none."""
    found = _CLOCK.fullmatch(text.strip())
    if found is None:
        return None
    hours = int(found[1])
    if found[5]:
        hours = hours % 12 + 12 * (found[5].lower() == "pm")
    fraction = float(f"0.{found[4][1:]}") if found[4] else 0.0
    return 3600.0 * hours + 60.0 * int(found[2]) + int(found[3]) + fraction

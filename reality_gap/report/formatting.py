"""Numbers for people: mm, deg and ms where the interfaces have m, rad and s."""

from __future__ import annotations

import math

PEOPLE = {
    "m": (1e3, "mm"),
    "m/s": (1e3, "mm/s"),
    "rad": (180.0 / math.pi, "deg"),
    "rad/s": (180.0 / math.pi, "deg/s"),
    "N/m": (1e-3, "N/mm"),
    "N s/m": (1e-3, "N s/mm"),
    "m/N": (1e6, "mm/kN"),
    "kg": (1e3, "g"),
    "1": (1.0, ""),
}
"""Factor and unit by SI unit; all other units are shown as they are."""


def shown(unit: str, size: float = 0.0) -> tuple[float, str]:
    """Factor and unit in which people read a quantity of an SI unit.

    Args:
        unit: SI.
        size: of the quantity: times below 1 s are shown in ms, masses from 1 kg in kg.
    """
    if unit == "s":
        return (1e3, "ms") if 0.0 < abs(size) < 1.0 else (1.0, "s")
    if unit == "kg" and abs(size) >= 1.0:
        return 1.0, "kg"
    return PEOPLE.get(unit, (1.0, unit))


def number(value: float, digits: int = 3) -> str:
    """A number with so many digits that matter, without an exponent if it can be read."""
    if value == 0.0 or not math.isfinite(value):
        return f"{value:g}"
    locations = digits - 1 - math.floor(math.log10(abs(value)))
    if -2 <= locations <= 5:
        return f"{value:.{max(0, locations)}f}"
    if -5 <= locations < -2:
        return f"{round(value, locations):.0f}"
    return f"{value:.{digits - 1}e}"


def percent(fraction: float) -> str:
    """A probability or a share; never a certainty that nobody has."""
    value = 100.0 * fraction
    if 0.0 < value < 1.0:
        return "< 1 %"
    if 99.0 < value < 100.0:
        return "> 99 %"
    return f"{value:.0f} %"


def joined(words: list[str], last: str = "and") -> str:
    """ "a", "a and b", "a, b and c"."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}"


def capital(text: str) -> str:
    """With a capital letter at the beginning, and the rest as it is."""
    return text[:1].upper() + text[1:]


def human(name: str) -> str:
    """An id of the catalogue as words: "coulomb friction"."""
    return name.replace("_", " ")

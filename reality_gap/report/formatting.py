"""Formatting: numbers, units, probabilities and lists as text for people."""

from __future__ import annotations

import math
from dataclasses import replace

from reality_gap.diagnosis import Estimate, NamedCause

READABLE = {
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
"""Factor and unit in which a quantity is shown, by SI unit; other units are shown as they are."""
MOST_DIGITS = 6
"""Largest number of significant digits."""
ROUNDING = 1e-6
"""Share of the scale of a parameter below which a number is a rounding error."""


def shown(unit: str, size: float = 0.0) -> tuple[float, str]:
    """Return the factor and the unit in which a quantity is shown.

    Args:
        unit: SI unit.
        size: size of the quantity; times below 1 s are shown in ms, masses from 1 kg on in kg.
    """
    if unit == "s":
        return (1e3, "ms") if 0.0 < abs(size) < 1.0 else (1.0, "s")
    if unit == "kg" and abs(size) >= 1.0:
        return 1.0, "kg"
    return READABLE.get(unit, (1.0, unit))


def number(value: float, digits: int = 3) -> str:
    """Return a number with some significant digits, without an exponent if it is readable so."""
    if value == 0.0:
        return "0"
    if not math.isfinite(value):
        return f"{value:g}"
    decimals = digits - 1 - math.floor(math.log10(abs(value)))
    if -2 <= decimals <= 5:
        return f"{value:.{max(0, decimals)}f}"
    if -5 <= decimals < -2:
        return f"{round(value, decimals):.0f}"
    return f"{value:.{digits - 1}e}"


def with_interval(estimate: Estimate, factor: float) -> list[str]:
    """Return value and ends of an interval, with enough digits to see how wide it is.

    Args:
        estimate: value and interval in SI units.
        factor: of the unit in which they are shown.
    """
    ends = [factor * x for x in (estimate.value, estimate.low, estimate.high)]
    width, size = abs(ends[2] - ends[1]), max(map(abs, ends))
    digits = 3
    if 0.0 < width < math.inf:
        digits = 2 + math.floor(math.log10(size)) - math.floor(math.log10(width))
    return [number(one, min(max(digits, 3), MOST_DIGITS)) for one in ends]


def rounded(cause: NamedCause, name: str, estimate: Estimate | None = None) -> Estimate:
    """Return an estimate of a parameter, with 0 in place of numbers that are rounding errors.

    Args:
        cause: the cause.
        name: name of the parameter.
        estimate: one of the parameter, such as that of one log; by default that of the cause.
    """
    estimate = estimate or cause.parameters[name]
    least = ROUNDING * abs(cause.candidate.parameter(name).scale)
    value, low, high = (
        0.0 if abs(x) < least else x for x in (estimate.value, estimate.low, estimate.high)
    )
    return replace(estimate, value=value, low=low, high=high)


def percent(share: float) -> str:
    """Return a counted share in percent; only exactly 0 and 1 are shown as 0 % and 100 %."""
    value = 100.0 * share
    if 0.0 < value < 1.0:
        return "< 1 %"
    if 99.0 < value < 100.0:
        return "> 99 %"
    return f"{value:.0f} %"


def probability(value: float) -> str:
    """Return an estimated probability or share in percent, which is never shown as 0 or 100 %."""
    if value < 0.01:
        return "< 1 %"
    return "> 99 %" if value > 0.99 else f"{100.0 * value:.0f} %"


def joined(words: list[str], last: str = "and") -> str:
    """Join words as in "a", "a and b", "a, b and c"."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}"


def capital(text: str) -> str:
    """Return a text whose first letter is a capital."""
    return text[:1].upper() + text[1:]


def human(name: str) -> str:
    """Return an id of the catalogue as words, such as "coulomb friction"."""
    return name.replace("_", " ")

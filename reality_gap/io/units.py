"""Units: symbols that a study may use, and their factors to SI units."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

from reality_gap.errors import UnknownNameError

_DEG = pi / 180.0

_KNOWN: dict[str, tuple[str, float]] = {
    "m": ("m", 1.0),
    "cm": ("m", 1e-2),
    "mm": ("m", 1e-3),
    "um": ("m", 1e-6),
    "rad": ("rad", 1.0),
    "mrad": ("rad", 1e-3),
    "deg": ("rad", _DEG),
    "rev": ("rad", 2.0 * pi),
    "N": ("N", 1.0),
    "mN": ("N", 1e-3),
    "kN": ("N", 1e3),
    "N m": ("N m", 1.0),
    "N cm": ("N m", 1e-2),
    "N mm": ("N m", 1e-3),
    "mN m": ("N m", 1e-3),
    "kN m": ("N m", 1e3),
    "m/s": ("m/s", 1.0),
    "cm/s": ("m/s", 1e-2),
    "mm/s": ("m/s", 1e-3),
    "rad/s": ("rad/s", 1.0),
    "deg/s": ("rad/s", _DEG),
    "rpm": ("rad/s", 2.0 * pi / 60.0),
    "m/s^2": ("m/s^2", 1.0),
    "mm/s^2": ("m/s^2", 1e-3),
    "rad/s^2": ("rad/s^2", 1.0),
    "deg/s^2": ("rad/s^2", _DEG),
    "s": ("s", 1.0),
    "ms": ("s", 1e-3),
    "us": ("s", 1e-6),
    "ns": ("s", 1e-9),
    "kg": ("kg", 1.0),
    "g": ("kg", 1e-3),
    "V": ("V", 1.0),
    "mV": ("V", 1e-3),
    "A": ("A", 1.0),
    "mA": ("A", 1e-3),
    "1": ("1", 1.0),
    "%": ("1", 1e-2),
}

_SPELLINGS = {
    "Nm": "N m",
    "Ncm": "N cm",
    "Nmm": "N mm",
    "mNm": "mN m",
    "kNm": "kN m",
    "m/s2": "m/s^2",
    "mm/s2": "mm/s^2",
    "rad/s2": "rad/s^2",
    "deg/s2": "deg/s^2",
    "µm": "um",
    "µs": "us",
    "sec": "s",
    "secs": "s",
    "seconds": "s",
    "millis": "ms",
    "milliseconds": "ms",
    "msec": "ms",
    "micros": "us",
    "microseconds": "us",
    "usec": "us",
    "nanoseconds": "ns",
    "nsec": "ns",
    "radians": "rad",
    "degrees": "deg",
    "°": "deg",
    "°/s": "deg/s",
}


@dataclass(frozen=True)
class Unit:
    """A unit of measurement.

    Attributes:
        symbol: as written in a study, such as "mm".
        si: symbol of the SI unit of the same dimension, such as "m".
        factor: size of this unit in SI units, such as 0.001.
    """

    symbol: str
    si: str
    factor: float


def parse_unit(text: str) -> Unit:
    """Return the unit that ``text`` names, such as "mm", "N m" or "deg/s".

    Raises:
        UnknownNameError: there is no such unit.
    """
    symbol = " ".join(text.replace("*", " ").replace("·", " ").replace("²", "^2").split())
    symbol = _SPELLINGS.get(symbol, symbol)
    if symbol not in _KNOWN:
        raise UnknownNameError("unit", text, _KNOWN)
    return Unit(symbol, *_KNOWN[symbol])


def symbols_of(si: str) -> tuple[str, ...]:
    """Return all symbols of the same dimension as the SI unit ``si``."""
    return tuple(symbol for symbol, (unit, _) in _KNOWN.items() if unit == si)

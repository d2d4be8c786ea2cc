"""Units: usual spellings and their factors to SI units."""

from __future__ import annotations

import math

import pytest

from reality_gap.errors import UnknownNameError
from reality_gap.io.units import parse_unit, symbols_of


@pytest.mark.parametrize(
    ("text", "si", "factor"),
    [
        ("mm", "m", 1e-3),
        ("deg", "rad", math.pi / 180.0),
        ("°", "rad", math.pi / 180.0),
        ("kN", "N", 1e3),
        ("Nm", "N m", 1.0),
        ("N*mm", "N m", 1e-3),
        ("N·m", "N m", 1.0),
        ("m/s²", "m/s^2", 1.0),
        (" us ", "s", 1e-6),
        ("1", "1", 1.0),
        ("rpm", "rad/s", 2.0 * math.pi / 60.0),
    ],
)
def test_a_unit(text: str, si: str, factor: float) -> None:
    unit = parse_unit(text)
    assert unit.si == si
    assert unit.factor == pytest.approx(factor)


@pytest.mark.parametrize("text", ["", "inch", "MM", "m m"])
def test_an_unknown_unit(text: str) -> None:
    with pytest.raises(UnknownNameError, match="known: m, cm, mm"):
        parse_unit(text)


def test_symbols_of_a_dimension() -> None:
    assert symbols_of("rad") == ("rad", "mrad", "deg", "rev")

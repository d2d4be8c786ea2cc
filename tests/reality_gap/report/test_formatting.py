"""Numbers as people read them."""

from __future__ import annotations

import pytest

from reality_gap.report.formatting import joined, number, percent, shown


@pytest.mark.parametrize(
    ("value", "told"),
    [
        (0.0, "0"),
        (12.345, "12.3"),
        (0.012345, "0.0123"),
        (123456.0, "123000"),
        (-0.5, "-0.500"),
        (9.999e-7, "1.00e-06"),
        (1.0e9, "1.00e+09"),
        (float("-inf"), "-inf"),
    ],
)
def test_numbers_have_the_digits_that_matter(value: float, told: str) -> None:
    assert number(value) == told


@pytest.mark.parametrize(
    ("value", "unit", "told"),
    [
        (0.0025, "m", "2.50 mm"),
        (0.5, "rad", "28.6 deg"),
        (0.012, "s", "12.0 ms"),
        (31.5, "s", "31.5 s"),
        (0.25, "kg", "250 g"),
        (2.5, "kg", "2.50 kg"),
        (100000.0, "N/m", "100 N/mm"),
        (3.0, "N m", "3.00 N m"),
    ],
)
def test_units_are_those_of_a_workshop(value: float, unit: str, told: str) -> None:
    factor, name = shown(unit, value)

    assert f"{number(factor * value)} {name}" == told


def test_nobody_is_told_a_certainty() -> None:
    assert percent(0.9991) == "> 99 %"
    assert percent(0.0004) == "< 1 %"
    assert percent(0.93) == "93 %"


def test_lists_read_as_sentences() -> None:
    assert joined(["a"]) == "a"
    assert joined(["a", "b", "c"], "or") == "a, b or c"

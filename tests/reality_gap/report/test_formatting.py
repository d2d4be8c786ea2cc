"""Formatting: numbers, units and probabilities for people."""

from __future__ import annotations

import math

import pytest

from reality_gap.diagnosis import Estimate
from reality_gap.report.formatting import (
    joined,
    number,
    percent,
    probability,
    shown,
    with_interval,
)


@pytest.mark.parametrize(
    ("value", "text"),
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
def test_numbers_have_the_digits_that_matter(value: float, text: str) -> None:
    assert number(value) == text


@pytest.mark.parametrize(
    ("value", "unit", "text"),
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
def test_quantities_have_readable_units(value: float, unit: str, text: str) -> None:
    factor, name = shown(unit, value)

    assert f"{number(factor * value)} {name}" == text


def test_a_share_is_rounded_to_none_or_all_only_if_it_is() -> None:
    assert percent(0.9991) == "> 99 %"
    assert percent(0.0004) == "< 1 %"
    assert percent(0.93) == "93 %"
    assert percent(1.0) == "100 %"


def test_a_probability_is_never_shown_as_certain() -> None:
    assert probability(1.0) == probability(0.999) == "> 99 %"
    assert probability(0.0) == probability(0.001) == "< 1 %"
    assert probability(0.93) == "93 %"


def test_lists_are_joined_as_in_sentences() -> None:
    assert joined(["a"]) == "a"
    assert joined(["a", "b", "c"], "or") == "a, b or c"


@pytest.mark.parametrize(
    ("ends", "expected"),
    [
        ((0.01066, 0.01026, 0.01073), ["0.01066", "0.01026", "0.01073"]),
        ((0.25, 0.2, 0.31), ["0.250", "0.200", "0.310"]),
        ((-0.6671, -0.6675, -0.6669), ["-0.66710", "-0.66750", "-0.66690"]),
        ((1.0, 1.0, 1.0), ["1.00", "1.00", "1.00"]),
        ((3.0, 3.0 - 1e-12, 3.0 + 1e-12), ["3.00000", "3.00000", "3.00000"]),
        ((0.2, 0.1, math.inf), ["0.200", "0.100", "inf"]),
        ((0.0, 0.0, 0.0), ["0", "0", "0"]),
    ],
)
def test_an_interval_has_the_digits_that_show_its_width(
    ends: tuple[float, float, float], expected: list[str]
) -> None:
    value, low, high = ends
    assert with_interval(Estimate(value, low, high, "1"), 1.0) == expected

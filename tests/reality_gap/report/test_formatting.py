"""Formatting: numbers, units and probabilities for people."""

from __future__ import annotations

import pytest

from reality_gap.report.formatting import joined, number, percent, probability, shown


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

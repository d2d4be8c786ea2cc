"""Catalogue listing: each cause has its parameters with units."""

from __future__ import annotations

from itertools import pairwise

from reality_gap.causes import CATALOGUE
from reality_gap.report.catalogue import describe_catalogue


def test_each_cause_is_listed_with_the_units_of_its_parameters() -> None:
    lines = describe_catalogue()
    heads = [line for line in lines if not line.startswith(" ")]

    assert heads == [f"{cause.id}: {cause.explanation}" for cause in CATALOGUE.values()]
    for line, following in pairwise([*lines, ""]):
        assert line.startswith("  ") or following.startswith("  "), f"{line}: no parameters"
    assert "  actuator or sensor: delay [s]" in lines
    assert lines[lines.index(heads[0]) + 1] == "  tendon: compliance [m/N]"

"""Units that are guessed from the size of values."""

from __future__ import annotations

import numpy as np
import pytest

from reality_gap.io.unit_guesses import guess_unit
from reality_gap.types import Floats

SWING = np.sin(np.linspace(0.0, 20.0, 300))
WHEEL = np.linspace(0.0, 300.0, 300)


@pytest.mark.parametrize(
    ("column", "cells", "endless", "unit"),
    [
        ("q", SWING, False, "rad"),
        ("q", 90.0 * SWING, False, "deg"),
        ("q", 90.0 * SWING, True, "deg"),
        ("q", WHEEL, True, "rad"),
        ("q", WHEEL, False, "deg"),
        ("q_deg", SWING, False, "deg"),
    ],
)
def test_angles(column: str, cells: Floats, endless: bool, unit: str) -> None:
    """A joint without limits that turns on and on has large angles in rad."""
    assert guess_unit(column, ("rad",), cells, endless).unit == unit


def test_ticks_of_an_encoder() -> None:
    found = guess_unit("q", ("rad",), np.round(2048 + 4096 / (2 * np.pi) * SWING))
    assert found.unit == "rad"
    assert "4096 per turn, zero at 2048" in found.reason
    assert f"scale: {2 * np.pi / 4096:.9g}" in found.conversion
    assert "offset: -3.14159265" in found.conversion

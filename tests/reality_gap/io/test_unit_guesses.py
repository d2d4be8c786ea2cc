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


@pytest.mark.parametrize(
    ("si", "size", "largest", "unit"),
    [
        ("rad", 5.0, 0.1, "deg"),
        ("rad", 5.0, 3.0, "rad"),
        ("rad", 60.0, 190.0, "rad"),
        ("rad", 60.0, 1.5, "deg"),
        ("m", 15.0, 0.04, "mm"),
        ("m", 0.02, 0.04, "m"),
        ("m", 22.0, 63.0, "m"),
        ("m", 150.0, 0.3, "mm"),
        ("m", 0.3, 1e-5, "m"),
        ("m", 30.0, 1e-5, "mm"),
    ],
)
def test_positions_have_the_unit_that_fits_what_the_model_allows(
    si: str, size: float, largest: float, unit: str
) -> None:
    """A finger and a gantry move little, a motor before a gear far; nothing fits the last one."""
    assert guess_unit("q", (si,), size * SWING, largest=largest).unit == unit


@pytest.mark.parametrize("largest", [0.0, 3.1, 25.0])
def test_ticks_of_an_encoder(largest: float) -> None:
    cells = np.round(2048 + 4096 / (2 * np.pi) * SWING)
    found = guess_unit("q", ("rad",), cells, largest=largest)
    assert found.unit == "rad"
    assert "4096 per turn, zero at 2048" in found.reason
    assert f"scale: {2 * np.pi / 4096:.9g}" in found.conversion
    assert "offset: -3.14159265" in found.conversion

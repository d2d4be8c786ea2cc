"""The search for markers in parts of a frame, which may be of any size."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.vision.marker_search import MarkerSearch


@pytest.mark.parametrize(
    "shape",
    [(1, 500), (500, 1), (2, 40), (3, 700), (7, 7), (1, 1), (5, 2500), (2500, 3), (4, 1001)],
)
@pytest.mark.parametrize("level", [10.0, 120.0])
def test_narrow_parts_of_a_frame_show_nothing(shape: tuple[int, int], level: float) -> None:
    gray = np.random.default_rng(0).normal(level, 5.0, shape).clip(0, 255).astype(np.uint8)
    search = MarkerSearch("DICT_4X4_50")
    assert search.first(gray) == []
    assert not any(search.further(gray))

"""Confidence of causes beside errors that no cause explains."""

from __future__ import annotations

import numpy as np
import pytest

from reality_gap.inference.confidence import MIMICRY, doubt_beside_unknown


def doubt(gained: list[float], left: list[float]) -> float:
    return doubt_beside_unknown(np.array(gained), np.array(left))


def test_causes_that_leave_the_noise_are_not_in_doubt() -> None:
    assert doubt([30.0, 0.1], [1.0, 0.9]) == 0.0


def test_a_cause_that_is_small_beside_what_is_left_is_in_doubt() -> None:
    assert doubt([0.5], [101.0]) == pytest.approx(MIMICRY, abs=0.01)
    assert doubt([9900.0], [101.0]) == pytest.approx(0.01 * MIMICRY)


def test_errors_of_channels_that_a_cause_does_not_change_raise_no_doubt() -> None:
    assert doubt([50.0, 0.0], [1.0, 1000.0]) == 0.0


def test_a_cause_that_takes_nothing_is_in_doubt() -> None:
    assert doubt([-1.0, 0.0], [5.0, 1.0]) == MIMICRY

"""Roughness: a model that exceeds all its tolerances, and faults that do not make it rough."""

from __future__ import annotations

import numpy as np
import pytest

from reality_gap.inference.roughness import roughness
from reality_gap.study.measurements import Measured
from reality_gap.types import Floats

COUNT, TOLERANCES = 4000, 25
ONES = np.ones(COUNT)


def measured() -> Measured:
    time = 0.01 * np.arange(COUNT)
    zeros = np.zeros(COUNT, dtype=np.int64)
    none = np.zeros((0, 4), dtype=np.int64)
    return Measured(np.zeros(COUNT), np.ones(COUNT), zeros, zeros, time, none)


def columns(rng: np.random.Generator) -> Floats:
    """Smooth effects of 25 tolerances, of 0.05 to 5 noises each."""
    time = np.linspace(0.0, 40.0, COUNT)[:, None]
    shapes = np.sin(time * rng.uniform(0.3, 3.0, TOLERANCES) + rng.uniform(0.0, 6.0, TOLERANCES))
    return np.asarray(shapes * np.geomspace(0.05, 5.0, TOLERANCES))


@pytest.mark.parametrize("true", [0.5, 1.0, 4.0, 16.0])
@pytest.mark.parametrize("seed", range(5))
def test_the_scale_of_all_deviations_is_found(true: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    effects = columns(rng)
    deviations = true * rng.standard_normal(TOLERANCES)
    remainder = effects @ deviations + rng.standard_normal(COUNT)
    found = roughness(measured(), effects, remainder, ONES)
    assert max(1.0, true) / 2.0 <= found <= 2.0 * max(1.0, true)


@pytest.mark.parametrize("sizes", [{18: 5.0}, {18: 20.0}, {2: 25.0, 18: 9.0}])
def test_a_few_numbers_that_are_wrong_by_far_are_no_roughness(sizes: dict[int, float]) -> None:
    rng = np.random.default_rng(0)
    effects = columns(rng)
    deviations = rng.standard_normal(TOLERANCES)
    for which, size in sizes.items():
        deviations[which] = size
    remainder = effects @ deviations + rng.standard_normal(COUNT)
    assert roughness(measured(), effects, remainder, ONES) == 1.0


@pytest.mark.parametrize("seed", range(3))
def test_errors_that_no_tolerance_has_do_not_make_a_model_rough(seed: int) -> None:
    rng = np.random.default_rng(seed)
    effects = columns(rng)
    time = np.linspace(0.0, 40.0, COUNT)
    wrong = 40.0 * np.sin(3.7 * time + 0.4 * np.sin(2.1 * time))
    remainder = wrong + rng.standard_normal(COUNT)
    assert roughness(measured(), effects, remainder, ONES) > 1.0
    inflation = np.full(COUNT, 40.0**2 / 2.0 * 50.0)
    assert roughness(measured(), effects, remainder, inflation) == 1.0

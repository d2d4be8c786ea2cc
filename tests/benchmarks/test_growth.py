"""Benchmark of growth: power laws, robots of other numbers of muscles, and the figure."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.growth import SCENE, Measurement, Muscles, PowerLaw, draw
from kengoro_env.assets import asset_path
from kengoro_env.robot.robot import Robot


def test_an_exact_power_law_is_found() -> None:
    sizes = [1.0, 3.0, 10.0, 40.0]
    law = PowerLaw.fit(sizes, [2.0 * size**1.5 for size in sizes])
    assert law == pytest.approx((2.0, 1.5, 1.5, 1.5))


def test_the_interval_covers_the_exponent_in_95_percent() -> None:
    rng = np.random.default_rng(0)
    sizes = np.array([1.0, 2.0, 4.0, 8.0, 16.0])
    covered = 0
    for _ in range(300):
        law = PowerLaw.fit(sizes, sizes**0.7 * np.exp(0.1 * rng.standard_normal(5)))
        covered += law.low < 0.7 < law.high
    assert 0.91 < covered / 300 < 0.99


@pytest.mark.parametrize("count", [9, 18, 36, 72])
def test_a_robot_has_the_requested_number_of_muscles(count: int) -> None:
    nominal = Robot(asset_path(SCENE))
    robot = Robot(asset_path(SCENE), [Muscles(count)])
    assert len(robot.muscles) == len(set(robot.muscles)) == count
    assert robot.model.ntendon == nominal.model.ntendon - len(nominal.muscles) + count
    assert set(robot.muscles[:36]) <= set(nominal.muscles)
    copied = [name.rpartition("_")[0] for name in robot.muscles[36:]]
    originals = [robot.muscles.index(name) for name in copied]
    np.testing.assert_array_equal(robot.lengths[36:], robot.lengths[originals])
    robot.step(robot.target)


def test_the_figure_has_four_panels(tmp_path: Path) -> None:
    measurement = Measurement("muscles", "1", "a step", (1, 2, 4), (0.1, 0.2, 0.5))
    draw([measurement] * 4, tmp_path / "new" / "growth.png")
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["growth.png"]
    with pytest.raises(ValueError, match="zip"):
        draw([measurement] * 3, tmp_path / "growth.png")
    assert not (tmp_path / "growth.png").exists()

"""The oracle's d is that of a known Gaussian, and a floor is where it is 5."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from hidden_plants import Effect, detection_limit, oracle
from hidden_plants.detection_limits import make_table, rows
from hidden_plants.machine import Machine, load
from hidden_plants.nuisance import size
from hidden_plants.oracle import SPREAD, THRESHOLD

ASSETS = Path(__file__).parents[2] / "assets" / "mjcf" / "kengoro_arm"
OFFSET = Effect("tension_offset", ("biceps",), {"sign": 1.0, "force": 2.0}, 2.0)


@pytest.fixture
def straight(monkeypatch: pytest.MonkeyPatch) -> Iterator[np.ndarray]:
    """A plant whose readings are linear in mismatches and in the amplitude; its directions."""
    rng = np.random.default_rng(0)
    ways = rng.standard_normal((30, 60))

    def readings(
        machine: Machine,
        motion: int,
        unit: np.ndarray,
        effects: tuple[Effect, ...] = (),
        step: float = 1.0,
    ) -> np.ndarray:
        amplitude = sum(effect.amplitude for effect in effects)
        return ways[:, : len(unit)] @ unit + amplitude * ways[:, -1]

    monkeypatch.setattr(oracle, "whitened", readings)
    oracle.background.cache_clear()
    yield ways
    oracle.background.cache_clear()


def test_the_floor_is_where_d_is_five(straight: np.ndarray) -> None:
    machine = load("elbow", ASSETS)
    spread = SPREAD * straight[:, : size(machine)]
    covariance = np.eye(30) + spread @ spread.T
    per_newton = np.sqrt(straight[:, -1] @ np.linalg.solve(covariance, straight[:, -1]))
    factor = detection_limit(OFFSET, 0, "elbow", ASSETS)
    assert factor * OFFSET.amplitude * per_newton == pytest.approx(THRESHOLD, rel=0.05)


def test_what_no_physical_amplitude_shows_has_no_floor(
    straight: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    straight[:, -1] *= 1e-6
    assert detection_limit(OFFSET, 0, "elbow", ASSETS) == float("inf")


def test_a_table_that_was_cut_off_is_completed(straight: np.ndarray, tmp_path: Path) -> None:
    machine, path = load("elbow", ASSETS), tmp_path / "floors.json"
    told: list[str] = []

    def stop_soon(line: str) -> None:
        told.append(line)
        if len(told) == 10:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        make_table(machine, path, tell=stop_soon)
    make_table(machine, path, tell=told.append)
    whole = rows("elbow", path)
    assert all(len(row.detection_limits) == 4 for row in whole)
    assert len(told) == 4 * len(whole) + 1
    told.clear()
    make_table(machine, path, ("slack",), tell=told.append)
    assert len(told) == 12
    assert all("slack" in line for line in told)
    assert rows("elbow", path) == whole


@pytest.mark.slow
def test_the_shipped_table_is_what_the_oracle_says() -> None:
    machine = load("elbow", ASSETS)
    for row in [row for row in rows("elbow") if row.structure.id == "tension_offset"][:2]:
        floor = oracle.detection_limit_of(machine, row.structure, 0)
        assert floor == pytest.approx(row.detection_limits[0], rel=0.1)

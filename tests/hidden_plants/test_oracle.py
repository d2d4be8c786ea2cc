"""The detectability d is that of a known Gaussian, and the detection limit is where d is 5."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from hidden_plants import Effect, detection_limit, oracle
from hidden_plants.detection_limits import make_table, rows
from hidden_plants.machine import Machine, load
from hidden_plants.nuisance import mismatch_size
from hidden_plants.oracle import SPREAD, THRESHOLD

ASSETS = Path(__file__).parents[2] / "assets" / "mjcf" / "kengoro_arm"
OFFSET = Effect("tension_offset", ("biceps",), {"sign": 1.0, "force": 2.0}, 2.0)


@pytest.fixture
def linear(monkeypatch: pytest.MonkeyPatch) -> Iterator[np.ndarray]:
    """Directions of a plant whose readings are linear in mismatches and amplitude."""
    rng = np.random.default_rng(0)
    directions = rng.standard_normal((30, 60))

    def readings(
        machine: Machine,
        motion: int,
        unit: np.ndarray,
        effects: tuple[Effect, ...] = (),
        step: float = 1.0,
    ) -> np.ndarray:
        amplitude = sum(effect.amplitude for effect in effects)
        return directions[:, : len(unit)] @ unit + amplitude * directions[:, -1]

    monkeypatch.setattr(oracle, "whitened", readings)
    oracle.background.cache_clear()
    yield directions
    oracle.background.cache_clear()


def test_d_is_five_at_the_detection_limit(linear: np.ndarray) -> None:
    machine = load("elbow", ASSETS)
    spread = SPREAD * linear[:, : mismatch_size(machine)]
    covariance = np.eye(30) + spread @ spread.T
    per_newton = np.sqrt(linear[:, -1] @ np.linalg.solve(covariance, linear[:, -1]))
    factor = detection_limit(OFFSET, 0, "elbow", ASSETS)
    assert factor * OFFSET.amplitude * per_newton == pytest.approx(THRESHOLD, rel=0.05)


def test_the_limit_is_infinite_if_no_physical_amplitude_is_detectable(
    linear: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    linear[:, -1] *= 1e-6
    assert detection_limit(OFFSET, 0, "elbow", ASSETS) == float("inf")


def test_an_interrupted_table_is_completed(linear: np.ndarray, tmp_path: Path) -> None:
    machine, path = load("elbow", ASSETS), tmp_path / "limits.json"
    lines: list[str] = []

    def interrupt(line: str) -> None:
        lines.append(line)
        if len(lines) == 10:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        make_table(machine, path, progress=interrupt)
    make_table(machine, path, progress=lines.append)
    complete = rows("elbow", path)
    assert all(len(row.detection_limits) == 4 for row in complete)
    assert len(lines) == 4 * len(complete) + 1
    lines.clear()
    make_table(machine, path, ("slack",), progress=lines.append)
    assert len(lines) == 12
    assert all("slack" in line for line in lines)
    assert rows("elbow", path) == complete


@pytest.mark.slow
def test_the_stored_limits_are_reproduced() -> None:
    machine = load("elbow", ASSETS)
    for row in [row for row in rows("elbow") if row.structure.id == "tension_offset"][:2]:
        limit = oracle.detection_limit_of(machine, row.structure, 0)
        assert limit == pytest.approx(row.detection_limits[0], rel=0.1)

"""Recordings: runs of logs, their times in seconds, and what is left out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import reality_gap.io.recordings
from reality_gap.io.recordings import Run, read_runs
from reality_gap.types import Floats
from tests.reality_gap.arm_logs import table

TIME = 0.02 * np.arange(200)
VALUES = np.sin(TIME)


def runs_of(path: Path, header: str, *columns: Floats | list[str]) -> tuple[list[Run], list[str]]:
    """Write a log; return its runs and the notes."""
    notes: list[str] = []
    return read_runs(table(path / "log.csv", header, *columns), notes.append), notes


@pytest.mark.parametrize(
    ("name", "factor", "unit"),
    [("time_ms", 1e3, None), ("stamp", 1e6, "us"), ("t", 1e9, "ns"), ("t", 1.0, "s")],
)
def test_times_are_in_seconds(tmp_path: Path, name: str, factor: float, unit: str | None) -> None:
    [run], notes = runs_of(tmp_path, f"{name},x", TIME * factor, VALUES)
    np.testing.assert_allclose(run.time, TIME, atol=1e-6)
    assert notes == (
        [f"log.csv: the unit of {name} is not stated and taken as {unit}"] * bool(unit)
    )


@pytest.mark.parametrize(("step", "unit"), [(1.0, 1.0), (10.0, 1e-3), (1000.0, 1e-3)])
def test_the_unit_of_a_slow_log_follows_from_its_duration(
    tmp_path: Path, step: float, unit: float
) -> None:
    time = step * np.arange(300.0)
    [run], _ = runs_of(tmp_path, "t,x", time, np.sin(time))
    np.testing.assert_allclose(run.time, unit * time)


def test_a_clock_that_restarts_begins_a_run(tmp_path: Path) -> None:
    found, notes = runs_of(tmp_path, "t,x", np.r_[TIME, TIME], np.r_[VALUES, VALUES])
    assert [run.name for run in found] == ["log_1", "log_2"]
    assert any("2 runs" in note for note in notes)


def test_late_packets_do_not_split_a_run(tmp_path: Path) -> None:
    time = TIME.copy()
    time[[50, 120]] -= 0.05
    [run], notes = runs_of(tmp_path, "t,x", time, VALUES)
    np.testing.assert_allclose(run.time, np.delete(TIME, [50, 120]))
    np.testing.assert_allclose(run.columns["x"], np.delete(VALUES, [50, 120]))
    assert any("2 rows left out" in note for note in notes)


def test_a_short_log_gets_a_note(tmp_path: Path) -> None:
    found, notes = runs_of(tmp_path, "t,x", TIME[:5], VALUES[:5])
    assert found == []
    assert any("5 rows are too few or too short" in note for note in notes)


def test_a_column_that_cannot_be_read_is_left_out_with_its_reason(tmp_path: Path) -> None:
    cells = [*map(str, VALUES[:-1]), "ERR"]
    [run], notes = runs_of(tmp_path, "t,x,y", TIME, VALUES, cells)
    assert list(run.columns) == ["x"]
    assert any("y is left out" in note and "ERR" in note for note in notes)


def test_a_file_is_parsed_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A long log with many columns would else take minutes."""
    read = reality_gap.io.recordings.read_table
    calls: list[tuple[str, ...]] = []
    monkeypatch.setattr(
        reality_gap.io.recordings,
        "read_table",
        lambda path, name, columns: calls.append(columns) or read(path, name, columns),
    )
    runs_of(tmp_path, "t,x,y", TIME, VALUES, VALUES)
    assert calls == [("t", "x", "y")]

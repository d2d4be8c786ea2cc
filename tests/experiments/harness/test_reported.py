"""Runs on reporting seeds are logged, and the log is moved to the record once."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from experiments.harness.common import ROOT
from experiments.harness.errors import ExperimentError
from experiments.harness.reported import (
    COLUMNS,
    LOG,
    RECORD,
    log_reported,
    merge_reported,
    read_runs,
    seed_ranges,
)


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A folder that passes for a checkout."""
    (tmp_path / ".git").mkdir()
    (tmp_path / "experiments").mkdir()
    return tmp_path


@pytest.mark.parametrize(
    ("seeds", "text"),
    [
        ([], ""),
        ([100], "100"),
        ([101, 100, 102], "100-102"),
        ([100, 101, 200], "100-101 200"),
        ([100, 100, 101], "100 100-101"),
    ],
)
def test_seeds_are_written_as_ranges(seeds: list[int], text: str) -> None:
    assert seed_ranges(seeds) == text


def test_reported_seeds_are_logged_in_a_checkout_only(tmp_path: Path) -> None:
    log_reported("faults", [100], tmp_path)
    assert not (tmp_path / LOG).exists()
    (tmp_path / ".git").mkdir()
    log_reported("faults", [99], tmp_path)
    assert not (tmp_path / LOG).exists()
    log_reported("faults", [99, 100, 101, 100], tmp_path)
    log_reported("ablation", [100], tmp_path)
    with (tmp_path / LOG).open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["experiment"], row["seeds"]) for row in rows] == [
        ("faults", "100-101"),
        ("ablation", "100"),
    ]
    assert tuple(rows[0]) == COLUMNS


def test_a_run_does_not_change_the_record(checkout: Path) -> None:
    log_reported("faults", [100], checkout)
    assert not (checkout / RECORD).exists()


def test_the_log_is_moved_to_the_end_of_the_record(checkout: Path) -> None:
    log_reported("faults", [100], checkout)
    assert merge_reported(checkout) == 1
    log_reported("ablation", [100, 101], checkout)
    log_reported("ablation", [100, 101], checkout)
    assert merge_reported(checkout) == 2
    runs = read_runs(checkout / RECORD)
    assert [run[:2] for run in runs] == [("faults", "100"), *2 * [("ablation", "100-101")]]
    assert not (checkout / LOG).exists()
    assert merge_reported(checkout) == 0


def test_a_merge_that_was_stopped_adds_no_run_twice(checkout: Path) -> None:
    log_reported("faults", [100], checkout)
    log = (checkout / LOG).read_bytes()
    merge_reported(checkout)
    record = (checkout / RECORD).read_bytes()
    (checkout / LOG).write_bytes(log)
    assert merge_reported(checkout) == 0
    assert (checkout / RECORD).read_bytes() == record


@pytest.mark.parametrize("damage", ["experiment,seeds\n", ",".join(COLUMNS) + "\nfaults,100\n"])
def test_a_damaged_log_is_refused_and_kept(checkout: Path, damage: str) -> None:
    (checkout / LOG).parent.mkdir()
    (checkout / LOG).write_text(damage)
    with pytest.raises(ExperimentError, match=r"reported_runs\.csv, line \d: .* columns"):
        merge_reported(checkout)
    assert (checkout / LOG).read_text() == damage


def test_the_record_of_the_repository_can_be_read() -> None:
    runs = read_runs(ROOT / RECORD)
    assert len(runs) >= 100
    assert all(run[0] and run[1][0].isdigit() for run in runs)

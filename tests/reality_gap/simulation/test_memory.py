"""Memory: studies are thinned, or refused with a sentence, where a bound does not suffice."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reality_gap.causes import find_cause
from reality_gap.errors import StudyError
from reality_gap.simulation import memory
from reality_gap.simulation.memory import GIGABYTE, fit_memory, thinned
from tests.reality_gap.simulation.test_replayer import carriage


def test_a_study_that_fits_stays_as_it_is(tmp_path: Path) -> None:
    study = carriage(tmp_path, seconds=2.0)
    notes: list[str] = []
    plan = fit_memory(study, 1, 64 * GIGABYTE, notes.append)
    assert plan.study is study
    assert plan.jobs == 1
    assert notes == []
    assert 0.05 * GIGABYTE < plan.needed < 4 * GIGABYTE


def test_fewer_processes_are_used_first_and_then_fewer_readings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = carriage(tmp_path, seconds=2.0)
    monkeypatch.setattr(memory, "model_memory", lambda study: 0.2 * GIGABYTE)
    alone = fit_memory(study, 1, 64 * GIGABYTE)
    notes: list[str] = []
    one = fit_memory(study, 8, alone.needed + 1.0 * GIGABYTE, notes.append)
    assert 1 < one.jobs < 8
    assert one.study is study
    assert "of 8 processes" in notes[0]
    monkeypatch.setattr(memory, "FEWEST", 5)
    data = alone.needed - 0.2 * GIGABYTE - memory.BASE
    half = fit_memory(study, 1, alone.needed - 0.4 * data, notes.append)
    assert "1 of 2 readings" in notes[1]
    assert half.needed <= alone.needed - 0.4 * data
    kept = half.study.episodes[0].readings[0]
    np.testing.assert_array_equal(kept.value, study.episodes[0].readings[0].value[::2])


def test_a_bound_that_does_not_suffice_is_refused_with_what_is_needed(tmp_path: Path) -> None:
    study = carriage(tmp_path, seconds=2.0)
    with pytest.raises(StudyError, match=r"needs about .* GB of memory.*allow more \(--memory\)"):
        fit_memory(study, 2, 0.01 * GIGABYTE)


def test_thinned_readings_keep_their_times(tmp_path: Path) -> None:
    study = carriage(tmp_path, seconds=2.0)
    reading = thinned(study, 3).episodes[0].readings[0]
    np.testing.assert_array_equal(reading.time, study.episodes[0].readings[0].time[::3])


def test_fewer_causes_need_less(tmp_path: Path) -> None:
    study = carriage(tmp_path, seconds=2.0)
    every, one = fit_memory(study, 1, GIGABYTE), find_cause("viscous_friction")
    few = fit_memory(study, 1, GIGABYTE, causes=[one])
    fixed = memory.model_memory(study) + memory.BASE
    assert few.needed - fixed == pytest.approx(memory.PER_NUMBER * 50)  # one parameter, 50 readings
    assert every.needed > few.needed

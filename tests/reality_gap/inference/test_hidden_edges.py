"""Events of efforts that begin and end where no reading is fitted."""

from __future__ import annotations

from pathlib import Path

import pytest

from reality_gap.causes import CATALOGUE
from reality_gap.inference.verdict import Options
from reality_gap.pipeline import diagnose
from reality_gap.study.splits import hidden_block
from tests.reality_gap.causes.machines import pushed_screw


def test_blocks_of_the_report_split_are_hidden() -> None:
    assert hidden_block(0, 0.8) == (0.75, 1.0)
    assert hidden_block(0, 1.1) is None
    assert hidden_block(1, 0.6) == (0.5, 0.75)


@pytest.mark.parametrize(("begin", "end"), [(3.85, 6.93), (4.1, 7.3)])
def test_a_push_is_named_wherever_it_begins_and_ends(
    tmp_path: Path, begin: float, end: float
) -> None:
    study = pushed_screw(tmp_path, begin, end)
    hidden = [hidden_block(0, time) is not None for time in (begin, end)]
    assert len(set(hidden)) == 1

    found = diagnose(study, options=Options(suggest=False))

    assert found.verdict.has_names
    [cause] = found.causes
    assert cause.candidate.cause is CATALOGUE["external_force"]
    values = {name: one.value for name, one in cause.parameters.items()}
    assert values["start"] == pytest.approx(begin, abs=0.03)
    assert values["start"] + values["duration"] == pytest.approx(end, abs=0.03)
    assert values["x"] == pytest.approx(40.0, rel=0.05)

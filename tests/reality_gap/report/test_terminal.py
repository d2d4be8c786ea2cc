"""Progress of a diagnosis where the output is no terminal."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from reality_gap.report.terminal import LINES, shown_progress


def test_progress_is_shown_in_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    with shown_progress(Console(file=io.StringIO())) as progress:
        for k in range(1000):
            progress(k / 1000, "screening")
        progress(1.0, "done")
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "0 % screening"
    assert lines[-1] == "100 % done"
    assert len(lines) == LINES + 1

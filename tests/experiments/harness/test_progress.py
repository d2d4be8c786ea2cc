"""Progress of an experiment where there is no terminal."""

from __future__ import annotations

import pytest

from experiments.harness.runner import progress_bar


@pytest.mark.parametrize(("total", "lines"), [(1, 1), (7, 7), (100, 100), (450, 100), (5000, 100)])
def test_without_a_terminal_steps_are_lines_at_most_a_hundred(
    total: int, lines: int, capsys: pytest.CaptureFixture[str]
) -> None:
    with progress_bar("trials", total) as progress:
        printed = []
        for step in range(total):
            progress(f"trial_{step}")
            printed += capsys.readouterr().out.splitlines()

    assert len(printed) == lines
    assert printed[-1].startswith(f"trials: {total} of {total} after 0.")
    assert printed[-1].endswith(f", trial_{total - 1}")

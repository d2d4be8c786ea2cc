"""Progress of a robot's trial where there is no terminal."""

from __future__ import annotations

import pytest

from kengoro.viewer.progress import stage_bar


def test_without_a_terminal_each_stage_is_a_line_once_and_at_its_beginning(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with stage_bar("Kengoro") as progress:
        progress("", 0.0)
        for step in range(50):
            progress("approach 1", 0.2 * step)
        assert capsys.readouterr().out == "Kengoro approach 1, 0 s simulated\n"
        for step in range(50, 80):
            progress("moves its hand in view", 0.2 * step)
        progress("approach 1", 16.0)
    assert capsys.readouterr().out == "Kengoro moves its hand in view, 10 s simulated\n"

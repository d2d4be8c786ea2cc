"""Figures of reports: ticks of logarithmic axes."""

from __future__ import annotations

import pytest
from matplotlib.figure import Figure

from experiments.harness.report import plain_ticks


@pytest.mark.parametrize(
    ("limits", "labels"),
    [((0.4, 30.0), ["0.5", "1", "2", "5", "10", "20"]), ((0.001, 0.003), ["0.001", "0.002"])],
)
def test_a_logarithmic_axis_has_plain_numbers(
    limits: tuple[float, float], labels: list[str]
) -> None:
    axes = Figure().subplots()
    axes.set(yscale="log", ylim=limits, xscale="log", xlim=limits)
    plain_ticks(axes.yaxis)
    assert [text.get_text() for text in axes.yaxis.get_ticklabels()] == labels
    assert list(axes.yaxis.get_minorticklocs()) == []
    assert axes.get_ylim() == limits
    assert len(axes.xaxis.get_minorticklocs()) > 0

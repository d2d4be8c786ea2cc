"""Experiments on robots without a marker on the hand: sizes, and names of the results."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from experiments.can_grasping import run as can_grasping
from experiments.harness.errors import ExperimentError
from experiments.posture_accuracy import run as posture_accuracy
from experiments.robots import conditions
from experiments.robots.conditions import with_hand
from kengoro.errors import UsageError

RUNS: list[Any] = [can_grasping, posture_accuracy]


@pytest.mark.parametrize("run", RUNS)
def test_with_a_marker_nothing_changes(run: Any) -> None:
    args = run.Args()
    assert args.hand == "marker"
    assert with_hand(run.EXPERIMENT, args, "marker", run.OUT) == (run.EXPERIMENT, args)
    assert run.EXPERIMENT.full_name == run.EXPERIMENT.name


@pytest.mark.parametrize("run", RUNS)
def test_without_a_marker_results_have_names_of_their_own(
    run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(conditions, "trained_hand", lambda *arguments: None)
    experiment, args = with_hand(run.EXPERIMENT, run.Args(hand="seen"), "seen", run.OUT)
    assert args.out == run.OUT.with_name(f"{run.OUT.name}-seen")
    assert experiment.full_name == f"{run.EXPERIMENT.name}-seen"
    assert experiment.folder == run.EXPERIMENT.folder
    for usual, sizes in (
        (run.EXPERIMENT.sizes, experiment.sizes),
        (run.EXPERIMENT.quick, experiment.quick),
    ):
        assert (usual.hand, sizes.hand) == ("marker", "seen")
        assert replace(sizes, hand="marker") == usual
    elsewhere = run.Args(hand="seen", out=Path("elsewhere"))
    assert with_hand(run.EXPERIMENT, elsewhere, "seen", run.OUT)[1].out == Path("elsewhere")


@pytest.mark.parametrize("run", RUNS)
def test_without_a_detector_the_experiment_ends_before_it_begins(
    run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none(*arguments: object) -> None:
        raise UsageError("there is no detector")

    monkeypatch.setattr(conditions, "trained_hand", none)
    with pytest.raises(ExperimentError, match="there is no detector"):
        run.main(run.Args(hand="seen", seeds="1"))

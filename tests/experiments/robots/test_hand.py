"""Experiments on robots without markers on hand and can: sizes, and names of the results."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from experiments.can_grasping import run as can_grasping
from experiments.harness.errors import ExperimentError
from experiments.posture_accuracy import run as posture_accuracy
from experiments.robots import conditions
from experiments.robots.conditions import Seen, with_seen
from kengoro.errors import UsageError

RUNS: list[Any] = [can_grasping, posture_accuracy]


@pytest.mark.parametrize("run", RUNS)
def test_with_a_marker_nothing_changes(run: Any) -> None:
    args = run.Args()
    assert args.hand == "marker"
    assert with_seen(run.EXPERIMENT, args, Seen(), run.OUT) == (run.EXPERIMENT, args)
    assert run.EXPERIMENT.full_name == run.EXPERIMENT.name


@pytest.mark.parametrize("run", RUNS)
def test_without_a_marker_results_have_names_of_their_own(
    run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(conditions, "trained_hand", lambda *arguments: None)
    experiment, args = with_seen(run.EXPERIMENT, run.Args(hand="seen"), Seen("seen"), run.OUT)
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
    assert with_seen(run.EXPERIMENT, elsewhere, Seen("seen"), run.OUT)[1].out == Path("elsewhere")


@pytest.mark.parametrize("run", RUNS)
def test_a_file_sees_the_hand_and_the_results_know_its_content_and_not_its_path(
    run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []
    monkeypatch.setattr(conditions, "trained_hand", lambda *arguments: asked.append(arguments[3]))
    file, runs = tmp_path / "mine.zip", []
    for content in (b"one", b"two", b"one"):
        file.write_bytes(content)
        runs.append(with_seen(run.EXPERIMENT, run.Args(), Seen(detector=file), run.OUT))
    assert asked == [file] * 3
    digests = [experiment.sizes.detector for experiment, _ in runs]
    assert digests[0] == digests[2] != digests[1]
    experiment, args = runs[0]
    assert experiment.sizes.hand == "seen"
    assert args.out == run.OUT.with_name(f"{run.OUT.name}-seen")
    assert str(tmp_path) not in repr(experiment.sizes)
    assert experiment.run.keywords == {"detector": file}


@pytest.mark.parametrize(
    ("seen", "name"),
    [(Seen(can="seen"), "can-seen"), (Seen("seen", None, "seen"), "seen-can-seen")],
)
def test_a_can_that_is_seen_has_results_of_its_own(
    seen: Seen, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(conditions, "trained_hand", lambda *arguments: None)
    given = can_grasping.EXPERIMENT
    experiment, args = with_seen(given, can_grasping.Args(), seen, can_grasping.OUT)
    assert args.out == can_grasping.OUT.with_name(f"can-grasping-{name}")
    assert experiment.full_name == f"can-grasping-{name}"
    assert (experiment.sizes.can, experiment.sizes.hand) == ("seen", seen.hand)
    assert experiment.sizes.detector == ""


@pytest.mark.parametrize("run", RUNS)
def test_without_a_detector_the_experiment_ends_before_it_begins(
    run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none(*arguments: object) -> None:
        raise UsageError("there is no detector")

    monkeypatch.setattr(conditions, "trained_hand", none)
    with pytest.raises(ExperimentError, match="there is no detector"):
        run.main(run.Args(hand="seen", seeds="1"))


@pytest.mark.parametrize("run", RUNS)
def test_a_file_that_is_no_detector_is_named(run: Any, tmp_path: Path) -> None:
    with pytest.raises(ExperimentError, match="There is no hand detector"):
        run.main(run.Args(detector=tmp_path / "none.zip", seeds="1"))

"""Page of all results: made from summaries, and up to date in the repository."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from experiments.all.page import page_of, write_page
from experiments.all.run import NAMES, Args, main, options
from experiments.harness.common import ROOT
from experiments.harness.errors import ExperimentError
from experiments.harness.report import Table
from experiments.harness.statistics import metric


@pytest.fixture
def summary() -> dict[str, Any]:
    return {
        "name": "some-study",
        "title": "A study",
        "figure": "Fig. 7",
        "seeds": [100, 101],
        "command": "python -m experiments some-study --seeds 100-101 --out o",
        "core_s": 90.0,
        "wall_s": 50.0,
        "per_seed": {},
        "table": Table("How it went", ("", "x"), [("a", 1.5)], "A note.").plain(),
        "metrics": {
            "hand_error": metric([10.0, 30.0], "mm", must=25.0, paper=57.5),
            "a|b": metric([1.0, 2.0], ""),
        },
    }


def test_the_page_shows_figure_command_minutes_and_numbers(summary: dict[str, Any]) -> None:
    page = page_of([summary])
    row = next(line for line in page.splitlines() if "[some-study]" in line)
    for part in ("Fig. 7", "hand error", "57.5 mm", "**20.0 mm** (30.0)", "25.0 mm", "yes"):
        assert part in row
    assert "    python -m experiments some-study --seeds 100-101 --out o\n" in page
    assert "1.5 minutes of one core" in page
    assert "| a\\|b |" in page
    assert "| a | 1.5 |" in page
    assert "A note." in page
    assert "figures/some-study.png" in page


def test_a_threshold_that_is_not_reached_is_marked(summary: dict[str, Any]) -> None:
    summary["metrics"]["hand_error"] = metric([30.0], "mm", must=25.0)
    assert "**no**" in page_of([summary])


def run_of(summary: dict[str, Any], folder: Path) -> Path:
    """The summary as a run leaves it, with a picture beside it."""
    folder.mkdir(parents=True)
    (folder / "summary.json").write_text(json.dumps(summary))
    (folder / "figure_1.png").write_bytes(b"png")
    return folder / "summary.json"


def test_the_page_lies_beside_its_sources(summary: dict[str, Any], tmp_path: Path) -> None:
    run = run_of(summary, tmp_path / "out" / "some-study")
    page = write_page([run], ["some-study"], tmp_path / "page")
    assert page.read_text() == page_of([summary])
    assert json.loads((tmp_path / "page/results/some-study.json").read_text()) == summary
    assert (tmp_path / "page/figures/some-study.png").read_bytes() == b"png"


def test_an_experiment_that_runs_again_leaves_the_others_on_the_page(
    summary: dict[str, Any], tmp_path: Path
) -> None:
    names, other = ["other", "some-study"], {**summary, "name": "other"}
    write_page([run_of(summary, tmp_path / "a")], names, tmp_path)
    again = {**summary, "core_s": 30.0}
    write_page([run_of(other, tmp_path / "b")], names, tmp_path)
    page = write_page([run_of(again, tmp_path / "c")], names, tmp_path)
    assert page.read_text() == page_of([other, again])


def test_the_page_of_the_project_is_that_of_its_summaries() -> None:
    folder = ROOT / "experiments"
    paths = [folder / "results" / f"{name}.json" for name in NAMES]
    summaries = [json.loads(path.read_text()) for path in paths]
    assert (folder / "README.md").read_text() == page_of(summaries)
    for summary in summaries:
        assert (folder / "figures" / f"{summary['name']}.png").is_file()
        assert min(summary["seeds"]) >= 100
        assert len(summary["seeds"]) >= 10


def test_options_are_handed_on(tmp_path: Path) -> None:
    args = Args(seeds="3-5", out=tmp_path / "my out", jobs=1, quick=True, cache=tmp_path)
    given = options(args, "ablation")
    assert given[given.index("--out") + 1] == str(tmp_path / "my out" / "ablation")
    assert given[given.index("--seeds") + 1] == "3-5"
    assert given[given.index("--cache") + 1] == str(tmp_path)
    assert "--quick" in given


def test_an_unknown_experiment_is_refused_before_anything_runs(tmp_path: Path) -> None:
    with pytest.raises(ExperimentError, match="no experiment 'fly'"):
        main(Args(out=tmp_path / "all", only=("fly",)))
    assert not (tmp_path / "all").exists()

"""The experiment on commissioning runs."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from experiments.commissioning import run
from experiments.commissioning.robots import FAULTS, KINDS, Fault, sample_fault
from experiments.commissioning.run import Args, conclude, main, score, trial
from experiments.harness.errors import ExperimentError
from jmm_agent.commissioning.findings import KINDS as KNOWN
from jmm_agent.commissioning.findings import Finding


class Result:
    """A result with some findings."""

    muscles = ("a", "b", "c")

    def __init__(self, *found: tuple[str, ...], undecided: tuple[str, ...] = ()) -> None:
        self.findings = tuple(Finding(kind, tuple(names), "") for kind, *names in found)
        self.undecided = (Finding("undecided", undecided, ""),) if undecided else ()


@pytest.fixture(scope="module")
def maps(request: pytest.FixtureRequest) -> Path:
    return Path(request.config.cache.mkdir("maps"))


def test_each_fault_has_a_kind_that_a_run_knows() -> None:
    rng = np.random.default_rng(0)
    for name in FAULTS:
        fault = sample_fault(name, 5, rng)
        assert fault.kind == "" or fault.kind in KNOWN
        assert len(set(fault.channels)) == len(fault.channels)
        assert bool(fault.channels) == (name != "none")
    assert set(KINDS) <= set(FAULTS)


def test_scores_count_right_false_and_undecided_names() -> None:
    fault = Fault("swapped", "swapped", (0, 2))
    right = score(Result(("swapped", "c", "a")), fault)  # type: ignore[arg-type]
    assert (right["right"], right["muscles_right"], right["false"]) == (True, True, False)
    wrong = score(Result(("swapped", "a", "b")), fault)  # type: ignore[arg-type]
    assert (wrong["false"], wrong["right"]) == (True, False)
    open_ = score(Result(undecided=("a", "c")), fault)  # type: ignore[arg-type]
    assert (open_["undecided"], open_["silent"], open_["right"]) == (True, False, False)
    assert score(Result(), fault)["silent"]  # type: ignore[arg-type]
    assert score(Result(), Fault("none", "", ()))["right"]  # type: ignore[arg-type]


def test_an_elbow_without_faults_gets_no_name(maps: Path) -> None:
    result = trial("elbow", "none", 3, False, maps)
    assert result["right"]
    assert result["seconds"] < 30.0
    summary, table = conclude({("elbow", "none"): {3: result}}, [3], time.perf_counter(), 1.0)
    assert summary["metrics"]["named right, elbow"]["median"] == 1.0
    assert table.rows[0][:4] == ("elbow", "none", 1, 1)


def test_names_that_are_unknown_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ExperimentError, match="no 'leg'"):
        main(Args(robots="leg", out=tmp_path))


def test_results_with_held_commands_are_not_those_without(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran = []

    def trial_of(robot: str, fault: str, seed: int, held: bool, cache: Path | None) -> object:
        ran.append(held)
        scores = dict.fromkeys(run.COUNTED, False)
        return {**scores, "seconds": 1.0, "tension": 0.1, "moved_deg": 0.0}

    monkeypatch.setattr(run, "trial", trial_of)
    for held in (False, True, True):
        main(Args(seeds="3", out=tmp_path, jobs=1, robots="elbow", faults="none", held=held))
    assert ran == [False, True]

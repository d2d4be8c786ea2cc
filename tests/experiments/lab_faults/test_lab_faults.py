"""Killed processes and broken lines: who stops the robot, and how soon."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from experiments.harness.errors import ExperimentError
from experiments.lab_faults.run import Args, main, metrics
from experiments.lab_faults.trial import FAULTS, MOST_PERIODS, Lab, passed

PERIOD = 0.06
QUICKLY = ("SIGTERM", "readings lost", "kill -9, line stays open", "hang (SIGSTOP)")
BY_NAME = {fault.name: fault for fault in FAULTS}


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    with Lab(PERIOD, tmp_path_factory.mktemp("lab") / "memory.npz", 0) as lab:
        yield lab


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(fault.name, marks=() if fault.name in QUICKLY else pytest.mark.slow)
        for fault in FAULTS
    ],
)
def test_the_right_side_stops_the_robot_in_time_and_what_was_learned_is_kept(
    lab: Lab, name: str
) -> None:
    trial = lab.run(BY_NAME[name])
    assert trial["stopped"] == BY_NAME[name].stops
    assert trial["periods"] is None or 0 <= trial["periods"] <= MOST_PERIODS
    assert passed(BY_NAME[name], trial)
    lab.restart()
    assert trial["kept"]


def test_what_was_learned_before_a_kill_is_there_after_the_restart(lab: Lab) -> None:
    """Trials until something was learned, and one more."""
    for _ in range(10):
        found = lab.run(BY_NAME["kill -9, line closes"])
        if found["observations"] >= 1:
            lab.restart()
            assert found["kept"]
            return
    pytest.fail("nothing was learned in ten trials")


def test_the_worst_trial_counts() -> None:
    good = {"stopped": "agent", "periods": 0, "ended": "", "kept": True}
    trials = {fault.name: [good | {"stopped": fault.stops, "ended": "why"}] for fault in FAULTS}
    assert all(found["reached"] for found in metrics(trials).values())
    late = {**trials, "SIGTERM": [good, good, good | {"periods": 6}]}
    reached = {name: found["reached"] for name, found in metrics(late).items()}
    assert not reached["most_periods_until_stopped"]
    assert not reached["stopped_by_the_right_side"]
    lost = {**trials, "SIGHUP": [good, good | {"kept": False}]}
    assert not metrics(lost)["learned_is_kept"]["reached"]


@pytest.mark.parametrize("wrong", [{"trials": 0}, {"period": 0.0}, {"jobs": 3}])
def test_options_out_of_range_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ExperimentError):
        main(Args(**wrong))  # type: ignore[arg-type]


@pytest.mark.slow
def test_a_small_run_writes_its_summary(tmp_path: Path) -> None:
    summary = main(Args(out=tmp_path, quick=True))
    assert (tmp_path / "summary.json").is_file()
    assert all(found["reached"] for found in summary["metrics"].values())

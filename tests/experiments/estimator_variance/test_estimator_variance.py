"""Errors over their bound follow from the estimates, and the right candidate is found."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.estimator_variance import run
from experiments.estimator_variance.estimate import Slopes, estimate, screen_known
from experiments.estimator_variance.machine import Known, right_candidate
from experiments.estimator_variance.run import Args, conclude
from experiments.estimator_variance.scores import coverage, machine_table, metrics, score
from experiments.harness.errors import ExperimentError
from experiments.strangers_bench.trial import Hidden
from hidden_plants.strangers import Oracle, Secret, make_stranger
from hidden_plants.strangers.mechanisms import MECHANISMS
from reality_gap.simulation.replayer import Replayer


def made(seed: int, errors: list[float], bound: float = 0.1) -> dict[str, Any]:
    truths = [1.0 + 0.01 * k for k in range(len(errors))]
    found = [t + e for t, e in zip(truths, errors, strict=True)]
    machine = {"kind": "servos", "joints": 2, "rate": 50.0, "position_bits": 12}
    return {
        "seed": seed,
        "machine": machine,
        "effect": "payload",
        "location": "link1",
        "size": 1.0,
        "unit": "kg",
        "bound": bound,
        "bound_of_readings": 0.5 * bound,
        "truths": truths,
        "estimates": found,
        "low": [x - 0.15 for x in found],
        "high": [x + 0.15 for x in found],
    }


def known(id: str, amplitude: float, seed: int = 2, seconds: float = 2.0) -> Known:
    stranger = make_stranger(seed, seconds)
    stranger = replace(stranger, traits=replace(stranger.traits, noise_stated=True))
    structure = MECHANISMS[id].structures(stranger, np.random.default_rng(0))[0]
    secret = Secret("single", (structure.at(amplitude),), (5.0,))
    return Known(Hidden(stranger, secret), Oracle(stranger))


def test_errors_are_measured_in_bounds_and_split_into_bias_and_variance() -> None:
    found = score(made(0, [0.1, 0.3]))
    assert found.error == pytest.approx((1.0 + 9.0) / 2)
    assert found.bias == pytest.approx(2.0)
    assert found.variance == pytest.approx(0.02 / 0.05**2)
    assert found.largest == pytest.approx(3.0)
    assert found.covered == (True, False)


def test_metrics_are_medians_over_machines_with_the_threshold_2() -> None:
    trials = [made(k, [s, -s]) for k, s in enumerate((0.05, 0.1, 0.4))]
    found = metrics(trials)
    error, variance = found["mean_square_error_over_bound"], found["variance_over_bound"]
    assert (error["must"], error["value"], error["reached"]) == (2.0, 1.0, True)
    assert error["worst"] == pytest.approx(16.0)
    assert (variance["must"], variance["value"], variance["reached"]) == (None, 8.0, None)
    assert found["bias_over_bound"]["value"] == pytest.approx(0.0, abs=1e-12)
    assert coverage(trials)["value"] == pytest.approx(100 * 4 / 6)


@pytest.mark.parametrize(
    ("id", "cause", "note", "name"),
    [
        ("servo_kp", "position_gain", "", "excess"),
        ("joint_offset", "joint_offset", "", "offset"),
        ("reading_zero", "joint_offset", "reading only", "offset"),
        ("sensor_delay", "delay", "", "delay"),
    ],
)
def test_the_candidate_is_the_hidden_effect(
    tmp_path: Path, id: str, cause: str, note: str, name: str
) -> None:
    hidden = known(id, 0.01)
    with Replayer(hidden.study(tmp_path, 0)) as replayer:
        found = right_candidate(replayer.system, hidden)
    assert found is not None
    candidate, parameter = found
    assert (candidate.cause.id, candidate.location.note, parameter) == (cause, note, name)
    if id == "sensor_delay":
        assert candidate.location.elements == ("at_j1",)


def test_a_cause_with_several_parameters_is_left_out(tmp_path: Path) -> None:
    hidden = known("gear_friction", 0.1)
    with Replayer(hidden.study(tmp_path, 0)) as replayer:
        assert right_candidate(replayer.system, hidden) is None


@pytest.mark.slow
def test_slopes_of_one_realisation_serve_another_with_other_noise(tmp_path: Path) -> None:
    hidden = known("servo_kp", 0.3)
    with Replayer(hidden.study(tmp_path, 0)) as replayer:
        found = right_candidate(replayer.system, hidden)
        assert found is not None
        slopes = screen_known(replayer, found[0])
        noise = replayer.measured.noise
        twice = slopes.in_noise_of(2.0 * noise)
        assert isinstance(twice, Slopes)
        assert np.allclose(2.0 * twice.columns, slopes.columns)
        assert np.allclose(2.0 * twice.right[0].columns, slopes.right[0].columns, rtol=1e-4)
        assert np.allclose(2.0 * twice.tolerances[0].column, slopes.tolerances[0].column)
    with Replayer(hidden.study(tmp_path, 1)) as replayer:
        one = estimate(replayer, twice, found[1])
        own = estimate(replayer, screen_known(replayer, found[0]), found[1])
    assert one.value == pytest.approx(own.value, rel=1e-3)


def test_what_cannot_be_run_is_refused() -> None:
    for wrong in (
        Args(seeds="4-0"),
        Args(repeats=1),
        Args(jobs=0),
        Args(seconds=0.0),
        Args(seeds="998-1000"),
    ):
        with pytest.raises(ExperimentError):
            run.main(wrong)


def test_the_report_is_written_whole(tmp_path: Path) -> None:
    conclude(Args(out=tmp_path), [made(0, [0.1, -0.1]), made(1, [0.2, 0.1])], 1.0, 2.0)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["name"] == "estimator-variance"
    assert summary["seeds"] == [0, 1]
    for one in summary["metrics"].values():
        assert set(one) >= {"must", "value", "reached"}
    assert "Errors of the estimates" in (tmp_path / "report.html").read_text()


def test_the_table_has_a_row_for_each_machine() -> None:
    [row] = machine_table([made(3, [0.1, -0.1])]).rows
    assert row[0] == 3
    assert row[3:5] == ("1 kg", "10")


@pytest.mark.slow
def test_machines_are_estimated_and_kept(tmp_path: Path) -> None:
    args = Args(seeds="2", jobs=1, quick=True, out=tmp_path)
    first = run.main(args)
    assert len(first["per_seed"]["2"]["estimates"]) == run.QUICK_REPEATS
    assert run.main(args)["per_seed"] == first["per_seed"]

"""Trial of the diagnosis, with true model and baselines."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from experiments.gap_bench.baselines import largest_correlation
from experiments.gap_bench.length_errors import bend, length_error
from experiments.gap_bench.scores import (
    ASSETS,
)
from experiments.gap_bench.trial import Case, Inputs, true_model, write_case
from hidden_plants import Effect, Nuisance, Secret, write_study
from hidden_plants.machine import Machine, load
from hidden_plants.nuisance import Mismatch, mismatch_at, mismatch_size
from reality_gap import load_study
from reality_gap.causes import CATALOGUE
from reality_gap.causes.base import Location
from reality_gap.inference.screening import Sensitivity
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.measurements import Measured


def test_the_largest_correlation_is_found_whatever_its_size() -> None:
    rng = np.random.default_rng(1)
    n = 400
    zeros = np.zeros(n, dtype=np.int64)
    readings = Measured(
        np.zeros(n), np.ones(n), zeros, zeros, np.arange(n) * 0.02, np.zeros((0, 4), dtype=np.int64)
    )
    columns = rng.standard_normal((n, 2))
    found = [
        Sensitivity(
            Candidate(CATALOGUE[id], Location("tendon", (tendon,)), ()),
            ("x",),
            {},
            size * c[:, None],
        )
        for id, tendon, size, c in (
            ("delay", "one", 9.0, columns[:, 0]),
            ("slack", "two", 0.1, columns[:, 1]),
        )
    ]
    named = largest_correlation(readings, -2.0 * columns[:, 1], found)
    assert named is not None
    assert (named.cause, named.elements) == ("slack", ("two",))
    assert named.score == pytest.approx(1.0)


def test_a_null_is_no_effect_and_a_case_is_the_same_again() -> None:
    assert Case("null", 4).secret().effects == ()
    assert Case("single", 4).secret() == Case("single", 4).secret()


def shifted(site: str, *shift: float, prefix: str = "") -> SimpleNamespace:
    """A diagnosis that names a moved site."""
    numbers = {
        f"{prefix}{axis}": SimpleNamespace(value=v) for axis, v in zip("xyz", shift, strict=True)
    }
    candidate = Candidate(CATALOGUE["attachment_shift"], Location("site", (site,)), ())
    return SimpleNamespace(causes=(SimpleNamespace(candidate=candidate, parameters=numbers),))


def test_a_moved_site_is_judged_by_the_lengths_that_it_makes(tmp_path: Path) -> None:
    true = {"x": 0.004, "y": 0.0, "z": 0.0}
    secret = Secret((Effect("attachment_shift", ("biceps_2",), true, 0.004),), kind="single")
    truth = write_study(tmp_path, secret, 1, assets=ASSETS, seconds=4.0, baseline=False)

    def error(found: SimpleNamespace) -> float:
        return length_error(truth, found, ASSETS)

    assert error(shifted("biceps_2", 0.004, 0.0, 0.0)) == pytest.approx(0.0, abs=1e-12)
    assert error(shifted("biceps_2", 0.004, 0.0, 0.0, prefix="biceps_2.")) == pytest.approx(0.0)
    half, none = error(shifted("biceps_2", 0.002, 0.0, 0.0)), error(shifted("biceps_2", 0, 0, 0))
    assert 0.0 < half < none < 0.004
    assert error(shifted("triceps_2", 0.004, 0.0, 0.0)) >= none
    assert error(SimpleNamespace(causes=())) is None


@pytest.mark.parametrize("note", ["capstan", ""])
def test_the_bend_of_a_tendon_is_that_of_the_postures(tmp_path: Path, note: str) -> None:
    truth = write_study(tmp_path, Secret(()), 1, assets=ASSETS, seconds=4.0, baseline=False)
    location = Location("tendon", ("biceps",), note)
    candidate = Candidate(CATALOGUE["load_dependent_friction"], location, ())

    found = bend(truth, SimpleNamespace(causes=(SimpleNamespace(candidate=candidate),)), ASSETS)

    if not note:
        assert found is None
        return
    model, data = _elbow()
    bends = []
    for posture in truth.episodes[0].qpos[::10]:
        data.qpos[:] = posture
        mujoco.mj_forward(model, data)
        tendon = model.tendon("biceps").id
        start, count = data.ten_wrapadr[tendon], data.ten_wrapnum[tendon]
        path = np.diff(data.wrap_xpos.reshape(-1, 3)[start : start + count], axis=0)
        path /= np.linalg.norm(path, axis=1, keepdims=True)
        bends.append(np.sum(np.arccos(np.sum(path[1:] * path[:-1], axis=1))))
    assert found == pytest.approx(np.mean(bends), rel=0.02)


def _elbow() -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = load("elbow", ASSETS).spec().compile()
    return model, mujoco.MjData(model)


def test_the_true_model_leaves_little_and_gains_much(tmp_path: Path) -> None:
    case = Case("single", 2, seconds=4.0, family="viscous_friction")
    truth = write_case(tmp_path, case)
    assert truth.secret.effects[0].id == "viscous_friction"
    with Replayer(load_study(tmp_path / "STUDY.yaml")) as replayer:
        null = replayer.residual([])
    found = true_model(case, Inputs(replayer, null))
    assert found["rms"] < np.sqrt(np.mean(null**2))
    assert 0.2 < found["gain"] <= 1.0


def test_of_the_usual_friction_the_true_model_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the middle of all mismatches a machine is nominal, except for 0.15 N in each tendon."""

    def middle(machine: Machine, nuisance: Nuisance, rng: np.random.Generator) -> Mismatch:
        return mismatch_at(machine, nuisance, np.zeros(mismatch_size(machine)))

    monkeypatch.setattr("hidden_plants.study.sample_mismatch", middle)
    case = Case("single", 2, seconds=4.0, family="viscous_friction")
    write_case(tmp_path, case)

    def left() -> float:
        with Replayer(load_study(tmp_path / "STUDY.yaml")) as replayer:
            return true_model(case, Inputs(replayer, replayer.residual([])))["rms"]

    found = left()
    monkeypatch.setattr("reality_gap.causes.coulomb_friction.USUAL", 0.0)
    assert found < left()  # which knows of no friction

"""Da Vinci experiment: established structure of a simulated or real cable drive."""

from __future__ import annotations

import json
import os
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.davinci import run
from experiments.davinci.fit import Errors, Fitted, errors, fit, intervals
from experiments.davinci.log import CHANNELS, RATE, Runs, read_runs
from experiments.davinci.models import ABLATIONS, LADDER
from experiments.davinci.study import RADIUS, make_study
from experiments.davinci.tables import WHOLE_NAME, Scores, evidence_table, wins
from experiments.harness.errors import ExperimentError
from reality_gap.causes import CATALOGUE
from reality_gap.simulation.hypothesis import Candidate, build
from reality_gap.simulation.replay import replay
from reality_gap.study.measurements import measured
from reality_gap.study.system import compile_system

FREQUENCIES, LOADS = (0.3, 0.5), (10, 40, 70, 100)
COULOMB, GROWS, STIFFNESS, GEAR = 0.035, 0.35, 1.5, 0.92

DATA = os.environ.get("KENGORO_REAL_DATA")
real = pytest.mark.skipif(
    not DATA, reason="set KENGORO_REAL_DATA to the folder of the measured data to run this"
)


def simulate(frequency: float, load: float, seed: int) -> np.ndarray:
    """One run: a spindle with dry friction, an elastic cable with friction by load, and a jaw."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 9.0, 1 / RATE)
    drive = 0.52 + 0.52 * np.cos(2 * np.pi * frequency * time)
    resistance = 1.2e-3 * load * (1 + 0.05 * np.sin(2 * np.pi * frequency * time))
    torque, jaw = np.empty_like(time), np.empty_like(time)
    slid, bearing, before = -drive[0], 0.0, -drive[0]
    for k, closing in enumerate(-drive):
        bearing = float(np.clip(bearing + 12 * (closing - before), -COULOMB, COULOMB))
        before = closing
        pull = STIFFNESS * (closing - slid)
        low, high = (GEAR * resistance[k] * (1 + side * GROWS) for side in (-1, 1))
        held = float(np.clip(pull, low, high))
        slid = closing - held / STIFFNESS
        torque[k] = bearing + held - 0.01 + 0.02 * closing
        jaw[k] = 1.25 + GEAR * slid - 0.5 * resistance[k]
    noise = 1e-4 * rng.standard_normal((len(time), 5))
    return np.column_stack([drive, torque, 1.2 * torque, jaw, -resistance]) + noise


def write(path: Path, runs: list[np.ndarray], index: list[dict[str, float]]) -> Path:
    content: dict[str, Any] = {f"run{k:03d}": run.astype("f4") for k, run in enumerate(runs)}
    np.savez(path, channels=np.array(CHANNELS), index_json=np.array(json.dumps(index)), **content)
    return path


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log of eight runs in the layout of the real one."""
    pairs = [(f, load) for f in FREQUENCIES for load in LOADS]
    index = [
        {"run": k, "header_freq_hz": f, "header_load_percent": load}
        for k, (f, load) in enumerate(pairs)
    ]
    runs = [simulate(f, load, k) for k, (f, load) in enumerate(pairs)]
    return write(tmp_path_factory.mktemp("davinci") / "log.npz", runs, index)


@pytest.fixture(scope="module")
def runs(log: Path) -> Runs:
    return read_runs(log)


def test_the_signs_are_those_of_closing(runs: Runs) -> None:
    assert np.all(runs.resistance > 0)
    middle = runs.use & (np.abs(runs.drive + 0.52) < 0.1)
    closing = np.gradient(runs.drive, runs.time, axis=0) > 0
    assert np.mean(runs.torque[middle & closing]) > np.mean(runs.torque[middle & ~closing]) + 0.05
    assert np.corrcoef(runs.drive.ravel(), runs.jaw.ravel())[0, 1] > 0.9


def test_a_run_is_left_out_from_its_disturbance_on(log: Path, tmp_path: Path) -> None:
    with np.load(log) as content:
        index = json.loads(str(content["index_json"]))
        found = [content[f"run{k:03d}"].copy() for k in range(len(index))]
    found[3][1400:1410, 3] += 0.8
    runs = read_runs(write(tmp_path / "log.npz", found, index))
    assert np.any(runs.use[:, 3])
    assert not np.any(runs.use[runs.time > 6.5, 3])
    assert np.any(runs.use[runs.time > 6.5, 2])


def test_the_structure_that_was_simulated_is_found(runs: Runs) -> None:
    structure = LADDER["jaw"]
    found = fit(structure, runs)
    assert errors(found, runs).torque < 3e-3
    assert errors(found, runs).jaw < 2e-3
    values = dict(zip(structure.parameters, found.values, strict=True))
    assert values["coulomb"] == pytest.approx(COULOMB, rel=0.1)
    assert values["cable_stiffness"] == pytest.approx(STIFFNESS, rel=0.1)
    assert values["kinematic_gear"] == pytest.approx(GEAR, rel=0.01)
    assert values["jaw_compliance"] == pytest.approx(0.5, rel=0.1)
    # Capstan's factor both ways: in proportion, 1 + GROWS and 1 - GROWS.
    assert np.exp(2 * values["capstan"]) == pytest.approx((1 + GROWS) / (1 - GROWS), rel=0.1)
    assert np.all(intervals(found, runs) > 0)


@pytest.fixture(scope="module")
def compared(log: Path) -> dict[str, Scores]:
    """Errors of all structures, in coarse samples to be quick."""
    return run.compare(read_runs(log, 20.0))[0]


def test_what_was_not_simulated_is_not_established(compared: dict[str, Scores]) -> None:
    established = {row[0]: row[-1] for row in evidence_table(compared).rows}
    assert established["friction that grows with the load"] == "yes"
    assert established["an elastic cable"] == "yes"
    assert established["compliance behind the friction"] == "yes"
    assert established["viscous friction"] == "no"
    assert established["a cable that hardens"] == "no"
    assert established["the capstan law instead of proportionality"] == "no"
    assert set(ABLATIONS) <= set(established)
    held = [e.torque for e in compared[WHOLE_NAME].loads.values()]
    assert max(held) < 0.2 * min(e.torque for e in compared["rigid"].loads.values())


def test_a_small_difference_is_no_win() -> None:
    one = {float(k): Errors(0.010, 0.010) for k in range(4)}
    pairs = ((0.020, 0.010), (0.0101, 0.010), (0.0099, 0.010), (0.008, 0.009))
    other = {float(k): Errors(*pair) for k, pair in enumerate(pairs)}
    assert wins(one, other) == (1, 1)


def test_friction_corrects_the_tension_of_the_model_and_elasticity_its_angle(log: Path) -> None:
    study = make_study(read_runs(log, RATE))
    system, readings = compile_system(study), measured(study)

    def misfits(name: str, **values: float) -> list[float]:
        cause = CATALOGUE[name]
        location = next(p for p in cause.locations(system) if p.elements == ("cable",))
        candidate = Candidate(cause, location, cause.parameters(system, location))
        prediction = replay(build(system, [(candidate, values)]), study, readings).prediction
        left = (readings.value - prediction) / readings.noise
        return [float(np.sqrt(np.mean(left[readings.channel == c] ** 2))) for c in range(2)]

    tension, angle = misfits("tendon_elasticity", compliance=0.0)
    assert misfits("load_dependent_friction", coefficient=GROWS)[0] < 0.8 * tension
    assert misfits("coulomb_friction", friction=COULOMB / RADIUS)[0] < 0.8 * tension
    compliance = RADIUS**2 * (1 / STIFFNESS + 0.5)
    assert misfits("tendon_elasticity", compliance=compliance)[1] < 0.7 * angle


def test_the_run_writes_summary_and_report(
    log: Path, compared: dict[str, Scores], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def once(runs: Runs) -> tuple[dict[str, Scores], dict[str, Fitted]]:
        return compared, {name: fit(score.structure, runs) for name, score in compared.items()}

    monkeypatch.setattr(run, "compare", once)
    summary = run.main(run.Args(log, tmp_path / "out", diagnosis=False))
    assert "What is not established" in [table["title"] for table in summary["tables"]]
    written = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert written["tables"] == summary["tables"]
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 5
    assert "share-alike" in page


def test_a_file_that_is_not_the_log_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "log.npz"
    with pytest.raises(ExperimentError, match="cannot be read"):
        read_runs(path)
    path.write_text("no archive", encoding="utf-8")
    with pytest.raises(ExperimentError, match="cannot be read"):
        read_runs(path)
    run = simulate(0.5, 40, 0)
    index = [{"run": 0, "header_freq_hz": 0.5, "header_load_percent": 40}]
    with pytest.raises(ExperimentError, match="two of each are needed"):
        read_runs(write(path, [run], index))
    np.savez(path, channels=np.array(["a"]), index_json=np.array(json.dumps(index)), run000=run)
    with pytest.raises(ExperimentError, match="has the channels a"):
        read_runs(path)


@real
def test_the_real_drive_has_friction_by_load_and_elasticity() -> None:
    log = Path(str(DATA)) / "davinci_cable" / "tool4_L4_freq5_load10.npz"
    runs = read_runs(log)
    names = ("rigid", "elastic", "jaw", WHOLE_NAME)
    fits = {name: fit(LADDER[name], runs) for name in names}
    found = [errors(fits[name], runs) for name in names]
    assert found[0].torque > 0.05
    assert found[-1].torque < 0.007
    assert found[-1].jaw < 0.007
    assert all(a.jaw > b.jaw for a, b in pairwise(found))
    without = fit(ABLATIONS["friction that grows with the load"], runs)
    assert errors(without, runs).torque > 2 * found[-1].torque


@real
@pytest.mark.slow
def test_the_claims_on_the_real_drive_hold() -> None:
    log = Path(str(DATA)) / "davinci_cable" / "tool4_L4_freq5_load10.npz"
    scores, _ = run.compare(read_runs(log))
    established = {row[0]: row[-1] for row in evidence_table(scores).rows}
    assert all(established[claim] == "yes" for claim in ABLATIONS)
    assert established["Coulomb friction"] == "yes"
    assert established["viscous friction"] == "no"
    assert established["the capstan law instead of proportionality"] == "no"

"""EMPS experiment: friction and offset of a simulated or real drive in closed loop."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from experiments.emps import run
from experiments.emps.log import (
    FORCE_PER_VOLT,
    MASS,
    PUBLISHED,
    PUBLISHED_ERROR,
    PUBLISHED_ERROR_BY_DIRECTION,
    Log,
    make_study,
    measured_force,
    period,
    read_log,
    relative_error,
    repeatability,
)
from experiments.emps.regression import force_of, regress
from experiments.harness.errors import ExperimentError
from reality_gap import CATALOGUE

VISCOUS, COULOMB, OFFSET = {1: 170.0, -1: 230.0}, 20.0, -3.0
PERIOD = 4.2

DATA = os.environ.get("KENGORO_REAL_DATA")
real = pytest.mark.skipif(
    not DATA, reason="set KENGORO_REAL_DATA to the folder of the measured data to run this"
)


def simulate(by_direction: bool, seconds: float = 13.0) -> np.ndarray:
    """Rows of a log: a mass with friction on a screw, under the controller of the real drive."""
    rng = np.random.default_rng(0)
    kp, kv, dt, fine = 160.18, 243.45, 1e-3, 4
    speeds = np.array([0.04, 0.12, 0.08, -0.06, -0.12, -0.06])
    rows = []
    position, velocity, reference, wanted = 0.0, 0.0, 0.0, 0.0
    old, filtered_old = 0.0, 0.0
    for k in range(round(seconds / dt)):
        t = k * dt
        goal = speeds[int(t % PERIOD / (PERIOD / len(speeds)))]
        wanted += np.clip(goal - wanted, -1.2 * dt, 1.2 * dt)
        reference += wanted * dt
        read = position + 2e-8 * rng.standard_normal()
        filtered = 0.5 * (read + old)
        volts = kp * kv * (reference - read) - kv * (filtered - filtered_old) / dt
        volts = float(np.clip(volts, -10, 10))
        old, filtered_old = read, filtered
        rows.append((t, reference, read, volts))
        for _ in range(fine):
            direction = 1 if velocity > 0 else -1
            viscous = VISCOUS[direction] if by_direction else 200.0
            dry = COULOMB * np.tanh(velocity / 1e-4)
            force = FORCE_PER_VOLT * volts - viscous * velocity - dry - OFFSET
            velocity += force / MASS * dt / fine
            position += velocity * dt / fine
    return np.array(rows)


def write(path: Path, rows: np.ndarray) -> Path:
    np.savetxt(path, rows, delimiter=",", header="t_s,q_ref_m,q_m,u_V", comments="", fmt="%.9g")
    return path


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Log of a drive whose friction is equal in both directions."""
    return write(tmp_path_factory.mktemp("emps") / "plain.csv", simulate(by_direction=False))


@pytest.fixture(scope="module")
def uneven(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Log of a drive whose friction depends on the direction."""
    return write(tmp_path_factory.mktemp("emps") / "uneven.csv", simulate(by_direction=True))


def test_least_squares_find_what_was_simulated_and_no_spring(plain: Path) -> None:
    fit = regress(make_study(read_log(plain)), (*run.BASE, "spring", "viscous by direction"))
    assert fit.values["mass"] == pytest.approx(MASS, rel=0.01)
    assert fit.values["viscous"] == pytest.approx(200.0, rel=0.03)
    assert fit.values["coulomb"] == pytest.approx(COULOMB, rel=0.03)
    assert fit.values["offset"] == pytest.approx(OFFSET, abs=0.5)
    assert abs(fit.values["spring"]) < 3.0
    assert abs(fit.values["viscous by direction"]) < 5.0


def test_friction_by_direction_is_seen_in_the_error(uneven: Path) -> None:
    study = make_study(read_log(uneven))
    even, by_direction = (
        regress(study, run.BASE),
        regress(study, (*run.BASE, "viscous by direction")),
    )
    assert by_direction.error < 0.7 * even.error
    assert by_direction.values["viscous by direction"] == pytest.approx(-30.0, abs=5.0)


def test_repeatability_is_the_deviation_between_periods() -> None:
    time = np.arange(0.0, 12.0, 1e-3)
    wave = np.sin(2 * np.pi * time / 4.0)
    # Half a period apart after 4 s, so that one is the other's negative.
    chance = 0.5 * np.sin(2 * np.pi * 0.875 * time)
    force = 30 * wave + 5 * np.sin(2 * np.pi * 3 * time) + chance
    log = Log(time, 0.1 * wave, 0.1 * wave, force)
    assert period(log) == pytest.approx(4.0, abs=0.002)
    assert repeatability(log, make_study(log)) == pytest.approx(0.5, rel=0.1)
    alone = Log(time, time**2, 0.1 * wave, force)
    assert period(alone) is None
    assert repeatability(alone, make_study(alone)) is None


@pytest.mark.slow
def test_the_run_writes_both_diagnoses_and_a_report(
    uneven: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, "TEXTBOOK", [CATALOGUE["coulomb_friction"]])
    monkeypatch.setattr(run, "CATALOGUE", {"viscous_friction": CATALOGUE["viscous_friction"]})
    summary = run.main(run.Args(uneven, tmp_path / "out"))
    assert [cause["cause"] for cause in summary["named"]] == [
        "coulomb_friction",
        "viscous_friction",
    ]
    written = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert written["errors"] == summary["errors"]
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 3
    assert "Janot" in page
    for name in ("textbook", "all"):
        assert (tmp_path / "out" / name / "verdict.json").exists()


@pytest.mark.slow
def test_what_was_simulated_is_named(
    uneven: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = ("viscous_friction", "coulomb_friction", "force_offset", "joint_stiffness")
    monkeypatch.setattr(run, "TEXTBOOK", [CATALOGUE[name] for name in names])
    few = {name: CATALOGUE[name] for name in (*names, run.DIRECTION)}
    monkeypatch.setattr(run, "CATALOGUE", few)
    summary = run.main(run.Args(uneven, tmp_path / "out"))
    causes = [cause["cause"] for cause in summary["named"]]
    assert set(names[:3]) <= set(causes)
    assert run.DIRECTION in causes
    assert run.SPRING not in causes
    assert summary["errors"]["all causes"] < summary["errors"]["textbook causes"]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("a,b\n1,2\n", "has the columns a, b"),
        ("t_s,q_ref_m,q_m,u_V\n0,0,0,x\n", "cannot be read"),
        ("", "cannot be read"),
        ("t_s,q_ref_m,q_m,u_V\n" + "0,0,0,0\n" * 1000, "times that do not rise"),
    ],
)
def test_a_file_that_is_not_the_log_is_refused(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ExperimentError, match=sentence):
        read_log(path)


@real
def test_the_real_force_is_explained_as_published() -> None:
    study = make_study(read_log(Path(str(DATA)) / "emps" / "emps_train.csv"))
    fit = regress(study, run.BASE)
    assert fit.error <= PUBLISHED_ERROR
    for name, value in PUBLISHED.items():
        assert abs(fit.values[name] - value) < fit.widths[name]
    spring = regress(study, (*run.BASE, "spring"))
    assert abs(spring.values["spring"]) < spring.widths["spring"]
    uneven = regress(study, (*run.BASE, "viscous by direction"))
    assert uneven.error <= PUBLISHED_ERROR_BY_DIRECTION
    published = relative_error(measured_force(study), force_of(study, {"mass": MASS} | PUBLISHED))
    assert fit.error <= published + 1e-9


@real
@pytest.mark.slow
def test_the_real_drive_is_named_from_a_mass_alone(tmp_path: Path) -> None:
    log = Path(str(DATA)) / "emps" / "emps_train.csv"
    summary = run.main(run.Args(log, tmp_path / "out"))
    found = {cause["cause"]: cause for cause in summary["named"]}
    assert {"viscous_friction", "coulomb_friction", "force_offset"} <= set(found)
    assert run.SPRING not in found
    known = {
        ("viscous_friction", "damping"): PUBLISHED["viscous"],
        ("coulomb_friction", "friction"): PUBLISHED["coulomb"],
        ("force_offset", "force"): -PUBLISHED["offset"],
    }
    for (cause, name), value in known.items():
        estimate = found[cause]["parameters"][name]
        assert estimate["low"] <= value <= estimate["high"]
    uneven = found[run.DIRECTION]["parameters"]
    assert uneven["forward_viscous"]["high"] < uneven["backward_viscous"]["low"]
    assert summary["errors"]["textbook causes"] <= PUBLISHED_ERROR
    assert summary["errors"]["all causes"] <= PUBLISHED_ERROR_BY_DIRECTION

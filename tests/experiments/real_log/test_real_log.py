"""Runner of a measured log, on logs of a machine that departs otherwise than the code assumes."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from experiments.harness.errors import ExperimentError
from experiments.real_log import machine as machine_module
from experiments.real_log import run, trial
from experiments.real_log.baselines import METHODS, corrected
from experiments.real_log.hysteresis import by_direction, play_states, spreads
from experiments.real_log.learning import estimate, learn
from experiments.real_log.log import read_log
from experiments.real_log.machine import (
    LIMITS,
    NAMES,
    PINION,
    TO_UNITS,
    Machine,
    cable_lengths,
    joint_angles,
    make_machine,
    sheet_angles,
)
from experiments.real_log.tables import shares
from jmm_agent.types import Floats

CENTRE = np.array([0.8, 0.0, 0.18, -0.2, 0.1, -0.1])
REACH = np.array([0.4, 0.35, 0.035, 1.5, 0.9, 0.9])
"""Middle and amplitude of the motion of each joint [rad, m]."""
ZERO = np.radians([2.0, -3.0, 0.0, 12.0, -8.0, 10.0])
"""Zeros of the joints that the data sheet does not know [rad]."""


@pytest.fixture(scope="module")
def cache(request: pytest.FixtureRequest) -> Path:
    assert request.config.cache is not None
    return Path(request.config.cache.mkdir("maps"))


@pytest.fixture(scope="module")
def robot(cache: Path) -> Machine:
    return make_machine(cache, quick=True)


def motion(count: int, seed: int) -> tuple[Floats, Floats]:
    """Times (N,) [s] with jitter and a pause, and joint positions (N, 6) asked for [rad, m]."""
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.2, 1.9, count))
    time[count // 3 :] += 40.0
    steps = np.arange(count)[:, None]
    waves = [
        np.sin(steps * rng.uniform(0.02, 0.16, 6) + rng.uniform(0.0, 6.0, 6)) for _ in range(3)
    ]
    return time, CENTRE + REACH * np.mean(waves, axis=0) * 1.5


def eccentric(asked: Floats, seed: int, noise: float = 0.002) -> Floats:
    """Joint positions of a machine with eccentric pulleys, a coupling and unknown zeros."""
    rng = np.random.default_rng(seed)
    true = asked + ZERO + 0.08 * REACH * np.sin(2.0 * asked + 1.0)
    true[:, 5] += 0.12 * asked[:, 4]
    tails = rng.standard_t(3, asked.shape)
    return true + noise * REACH * tails


def dahl(asked: Floats, width: float, stiffness: float) -> Floats:
    """Joint angles (N,) [rad] behind friction by Dahl's model, which has no corner."""
    lag, before, result = 0.0, asked[0], np.empty_like(asked)
    for number, angle in enumerate(asked):
        for part in np.diff(np.linspace(before, angle, 41)):
            lag += stiffness * part * (1.0 - np.sign(part) * lag / width)
        before = angle
        result[number] = angle - lag
    return result


def write(folder: Path, time: Floats, asked: Floats, measured: Floats) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    np.save(folder / "q_des_raw.npy", asked)
    np.save(folder / "q_act_raw.npy", measured)
    np.save(folder / "t_stemp_raw.npy", time)
    return folder


def test_samples_that_the_camera_did_not_see_are_left_out_and_counted(tmp_path: Path) -> None:
    time, asked = motion(160, 1)
    measured = eccentric(asked, 1)
    measured[[3, 40, 41]] = 0.0
    measured[90, 3:] = 0.0
    measured[100, 2] = np.nan
    log = read_log(write(tmp_path, time, asked, measured))
    assert log.lost == 5
    assert len(log.time) == 155
    assert np.all(log.measured != 0.0)
    assert log.commanded[3] == pytest.approx(asked[4])


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda t, a, m: (t[:-1], a, m), "needed"),
        (lambda t, a, m: (t[::-1], a, m), "times must grow"),
        (lambda t, a, m: (t, np.degrees(a), m), "must be in rad"),
        (lambda t, a, m: (t, a * [1, 1, 1000, 1, 1, 1], m), "insertion"),
        (lambda t, a, m: (t, a, 0.0 * m), "0 of 160 samples"),
        (lambda t, a, m: (t, a[:, :5], m), r"\(160, 6\) is needed"),
    ],
)
def test_a_log_that_does_not_fit_is_refused_with_a_reason(
    tmp_path: Path, change: object, sentence: str
) -> None:
    time, asked = motion(160, 2)
    assert callable(change)
    with pytest.raises(ExperimentError, match=sentence):
        read_log(write(tmp_path, *change(time, asked, eccentric(asked, 2))))


def test_missing_and_pickled_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ExperimentError, match="no folder"):
        read_log(tmp_path / "none")
    time, asked = motion(160, 3)
    folder = write(tmp_path / "log", time, asked, asked)
    np.save(folder / "q_act_raw.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(ExperimentError, match="cannot be read"):
        read_log(folder)
    (folder / "q_act_raw.npy").unlink()
    with pytest.raises(ExperimentError, match=r"0 files q_act\*\.npy"):
        read_log(folder)


def test_motor_angles_follow_the_user_guide(tmp_path: Path) -> None:
    time, asked = motion(160, 4)
    log = read_log(write(tmp_path, time, asked, eccentric(asked, 4)))
    motors = cable_lengths(log) / machine_module.WHEEL
    yaw = -0.8306 * motors[:, 4] + 2.0 * 0.6089 * motors[:, 5]
    assert yaw == pytest.approx(asked[:, 5])
    assert motors[:, 3] == pytest.approx(-asked[:, 3] / 1.5632)
    assert motors[:, 2] * PINION == pytest.approx(asked[:, 2])


def test_few_samples_correct_what_the_data_sheet_lacks(robot: Machine, tmp_path: Path) -> None:
    time, asked = motion(500, 5)
    log = read_log(write(tmp_path, time, asked, eccentric(asked, 5)))
    lengths, measured = cable_lengths(log), joint_angles(log.measured)
    found = learn(robot, time[:250], lengths[:250], measured[:250], (1, 5, 27))
    sheet = _error(sheet_angles(lengths[250:]) - measured[250:])
    errors = {
        count: _error(estimate(robot, jmm, time[250:], lengths[250:]).angles - measured[250:])
        for count, jmm in found.maps.items()
    }
    assert np.all(errors[27][4:] < 0.25 * sheet[4:])
    assert errors[27][3] < 0.5 * sheet[3]  # the eccentric pulley bends too fast for the prior
    assert errors[27][3:].mean() < errors[5][3:].mean() < sheet[3:].mean()
    assert found.samples == sorted(found.samples)
    assert len(found.samples) == 27


def test_measured_joint_angles_are_used_at_learned_samples_only(
    robot: Machine, tmp_path: Path
) -> None:
    time, asked = motion(300, 6)
    log = read_log(write(tmp_path, time, asked, eccentric(asked, 6)))
    lengths, measured = cable_lengths(log), joint_angles(log.measured)
    found = learn(robot, time, lengths, measured, (3,))
    others = np.setdiff1d(np.arange(len(time)), found.samples)
    wrong = measured.copy()
    wrong[others] = np.nan
    again = learn(robot, time, lengths, wrong, (3,))
    assert again.samples == found.samples
    assert again.maps[3].lengths(measured[0]) == pytest.approx(found.maps[3].lengths(measured[0]))


def test_the_radius_of_the_wheels_does_not_matter(
    robot: Machine, cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    time, asked = motion(300, 7)
    log = read_log(write(tmp_path, time, asked, eccentric(asked, 7)))
    measured = joint_angles(log.measured)

    def errors(made: Machine) -> Floats:
        lengths = cable_lengths(log)
        found = learn(made, time[:200], lengths[:200], measured[:200], (5,))
        angles = estimate(made, found.maps[5], time[200:], lengths[200:]).angles
        return _error(angles - measured[200:])

    small = errors(robot)
    monkeypatch.setattr(machine_module, "WHEEL", 7.0 * machine_module.WHEEL)
    large = errors(make_machine(cache, quick=True))
    assert large == pytest.approx(small, rel=0.1, abs=0.2)
    assert small[3:].min() > 1.0


def test_baselines_learn_what_they_can_express() -> None:
    rng = np.random.default_rng(8)
    sheet, other = (rng.uniform(*LIMITS.T, (40, 6)) for _ in range(2))
    shifted, bent = (lambda q: q + ZERO), (lambda q: 1.1 * q + ZERO)
    for method in METHODS:
        found = corrected(method, sheet[:1], shifted(sheet[:1]), other) - shifted(other)
        assert (np.abs(found).max() < 1e-9) == (method == "constants"), method
    for method, most in (("linear regression", 1e-9), ("Gaussian process", 0.2)):
        found = corrected(method, sheet, bent(sheet), other) - bent(other)
        assert _error(found)[3:].max() < np.degrees(most), method
    assert corrected("data sheet", sheet, bent(sheet), other) == pytest.approx(other)


def test_hysteresis_that_is_no_play_is_found_where_it_is() -> None:
    _, asked = motion(3000, 9)
    asked = joint_angles(asked)
    width, rng = np.radians(5.0), np.random.default_rng(9)
    true = asked + np.radians(0.3) * rng.standard_normal(asked.shape)
    true[:, 3] += dahl(asked[:, 3], width, 0.8) - asked[:, 3]
    missed = true - asked
    found, spread = by_direction(asked, missed, 1500), spreads(asked, missed)
    for joint, name in enumerate(NAMES):
        one = found[joint]
        if name == "roll":
            assert one.by_plays > 0.9
            assert one.by_plays >= one.by_play - 0.02
            assert one.by_play > one.by_sign > 0.5
            assert 2.0 <= np.degrees(one.play) <= 11.0
            assert -2.0 * width < spread[joint].gap < -width
            assert spread[joint].floor > np.radians(3.0)
            assert spread[joint].repeated < 0.6 * spread[joint].floor
            assert np.degrees(one.left) < 1.2
            assert np.degrees(one.one_side) < 1.2
            assert 0.05 < one.approached < 0.95
        else:
            assert abs(one.by_plays) < 0.05
            assert abs(np.degrees(spread[joint].gap)) < 0.05
            assert spread[joint].floor == pytest.approx(np.radians(0.3), rel=0.1)


def test_play_drags_a_joint_in_both_directions() -> None:
    asked = np.array([0.0, 1.0, 0.5, -2.0, -2.0])[:, None]
    assert play_states(asked, 0.4).ravel() == pytest.approx([0.0, 0.4, -0.1, -0.4, -0.4])


def test_a_quick_run_writes_summary_and_report(cache: Path, tmp_path: Path) -> None:
    time, asked = motion(260, 10)
    measured = eccentric(asked, 10)
    measured[7] = 0.0
    data = write(tmp_path / "log", time, asked, measured)
    args = run.Args(data, tmp_path / "out", cache=cache, quick=True)
    summary = run.main(args)
    assert summary == json.loads((tmp_path / "out" / "summary.json").read_text())
    assert "data:image/png;base64" in (tmp_path / "out" / "report.html").read_text()
    assert summary["log"]["lost"] == 1
    ours = summary["metrics"]["ours: error over the best baseline's, 3"]
    best = min(shares(summary["trials"], method, 3)[0] for method in METHODS)
    assert ours["median"] == pytest.approx(shares(summary["trials"], "ours", 3)[0] / best, rel=1e-3)
    assert ours["reached"] == (ours["median"] <= 1.0)
    once = summary["trials"][0]["learned"][trial.OURS]["samples"]
    assert len(once) == max(run.QUICK_COUNTS)
    assert shares(summary["trials"], "data sheet", 3) == pytest.approx([1.0])
    with pytest.raises(ExperimentError, match="at least 1"):
        run.main(replace(args, starts=0))


def test_each_start_has_a_result_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    time, asked = motion(160, 12)
    data = write(tmp_path / "log", time, asked, eccentric(asked, 12))
    begun: list[float] = []

    def trial_of(folder: Path, start: float, *_: object) -> dict[str, float]:
        begun.append(start)
        return {"start": start}

    def concluded(_: object, trials: list[dict[str, float]], *__: object) -> list[float]:
        return [one["start"] for one in trials]

    monkeypatch.setattr(run, "trial", trial_of)
    monkeypatch.setattr(run, "conclude", concluded)
    for starts in (250, 3, 3):
        args = run.Args(data, tmp_path / "out", starts=starts)
        assert run.main(args) == [number / starts for number in range(starts)]
    assert len(begun) == 253


def test_a_log_that_hardly_moves_is_refused(cache: Path, tmp_path: Path) -> None:
    time, asked = motion(200, 11)
    asked = CENTRE + 0.01 * (asked - CENTRE)
    data = write(tmp_path / "log", time, asked, eccentric(asked, 11))
    with pytest.raises(ExperimentError, match="only 1 samples"):
        trial.trial(data, 0.0, (1, 3), cache, True)


def _error(angles: Floats) -> Floats:
    """RMS of each joint (6,) [deg, mm]."""
    return np.sqrt(np.mean(angles**2, axis=0)) * TO_UNITS

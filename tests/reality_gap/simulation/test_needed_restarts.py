"""Restarts of replays where a motion amplifies errors of its state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reality_gap import CATALOGUE, Diagnosis, Options, Study, Verdict, check_study, diagnose
from reality_gap.report.words import about_restarts
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.measurements import measured
from reality_gap.study.restarts import with_restarts
from tests.reality_gap.simulation.swing import NOISE, swung

SEVERAL = ("coulomb_friction", "viscous_friction", "dead_zone", "force_scale", "link_mass")


def settled(study: Study) -> Study:
    with Replayer(study) as replayer:
        return replayer.system.study


def diagnosed(study: Study, causes: Sequence[str] = tuple(CATALOGUE)) -> Diagnosis:
    chosen = [CATALOGUE[id] for id in causes]
    return diagnose(study, causes=chosen, options=Options(suggest=False))


def test_a_pendulum_that_turns_over_is_replayed_in_parts(tmp_path: Path) -> None:
    study, truth = swung(tmp_path, 0.0)
    [episode] = settled(study).episodes
    parts = np.diff([0.0, *(one.time for one in episode.restarts), episode.duration])
    assert 0.25 <= parts[0] <= 2.25
    assert np.ptp(parts) <= 0.004 + 1e-9

    times = np.arange(len(truth)) * 0.004
    for time, states in episode.restarts:
        state = states["pivot"]
        position, speed = (np.interp(time, times, truth[:, k]) for k in (0, 1))
        assert abs(state.position - position) < 3.0 * state.position_error
        assert abs(state.speed - speed) < 3.0 * state.speed_error
        assert state.position_error < 2.0 * NOISE
        assert state.speed_error < 0.4


def test_a_damped_pendulum_is_replayed_whole(tmp_path: Path) -> None:
    study, _ = swung(tmp_path, 0.0, damping=0.5)
    assert not settled(study).restart
    assert check_study(study) == ()


def test_a_pendulum_that_only_swings_is_replayed_whole(tmp_path: Path) -> None:
    assert not settled(swung(tmp_path, 0.0, torque=0.2)[0]).restart


def test_restarts_are_those_that_the_study_states(tmp_path: Path) -> None:
    study, _ = swung(tmp_path, 0.0, restart=", restart: 0.5")
    times = [one.time for one in study.episodes[0].restarts[:2]]
    assert times == pytest.approx([0.5, 1.0], rel=0.01)
    assert settled(study).episodes == study.episodes
    assert check_study(study) == ()

    (tmp_path / "whole").mkdir()
    whole, _ = swung(tmp_path / "whole", 0.0, restart=", restart: 0")
    assert not settled(whole).restart
    assert (measured(study).block, measured(whole).block) == (pytest.approx(0.5 / 2.9), 0.25)


def test_in_a_gap_of_its_readings_a_joint_goes_on(tmp_path: Path) -> None:
    study, _ = swung(tmp_path, 0.0)
    [episode] = study.episodes
    [reading] = episode.readings
    kept = (reading.time < 0.9) | (reading.time > 1.7)
    less = replace(reading, time=reading.time[kept], value=reading.value[kept])
    study = replace(study, episodes=(replace(episode, readings=(less,)),))

    [found] = with_restarts(study, study.spec().compile(), 0.5).episodes

    begun = {round(time, 1): bool(states) for time, states in found.restarts}
    assert not begun[1.0]
    assert not begun[1.5]
    assert begun[0.5]
    assert begun[2.0]


def test_replays_begin_in_the_states_of_restarts_and_predict_what_follows(tmp_path: Path) -> None:
    study, _ = swung(tmp_path, 0.0, restart=", restart: 0.4")
    with Replayer(study) as replayer:
        residual = replayer.residual([])
        whole = Replayer(swung(tmp_path, 0.0, restart=", restart: 0")[0]).residual([])
    restarts = study.episodes[0].restarts
    for begin, states in restarts:
        after, state = replayer.measured.time - begin, states["pivot"]
        soon = (after >= 0.0) & (after < 0.02)
        error = (state.position_error + 0.02 * state.speed_error) / NOISE
        assert np.abs(residual[soon]).max() < 3.5 + 2.0 * error
    assert np.mean(residual**2) < 1e-3 * np.mean(whole**2)
    first = replayer.measured.time < restarts[0].time
    np.testing.assert_allclose(residual[first], whole[first], atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.05, 0.1, 0.3])
def test_small_and_large_friction_is_found(tmp_path: Path, friction: float) -> None:
    [cause] = diagnosed(swung(tmp_path, friction)[0]).causes
    assert cause.candidate.cause.id == "coulomb_friction"
    found = cause.parameters["friction"]
    assert found.low <= friction <= found.high


def test_a_right_model_of_a_chaotic_motion_is_not_wrong(tmp_path: Path) -> None:
    study, _ = swung(tmp_path, 0.0)
    found = diagnosed(study, SEVERAL)
    assert found.verdict is Verdict.NOTHING_WRONG
    assert "begin again" in about_restarts(found)
    assert any("restart:" in note for note in check_study(study))


def test_friction_of_a_chaotic_motion_is_named(tmp_path: Path) -> None:
    found = diagnosed(swung(tmp_path, 0.2, seconds=5.0)[0], SEVERAL)
    [cause] = found.causes
    assert found.verdict is Verdict.NAMED
    assert cause.candidate.cause.id == "coulomb_friction"
    assert cause.parameters["friction"].value == pytest.approx(0.2, rel=0.05)
    assert found.restart > 0.0

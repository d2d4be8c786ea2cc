"""Errors by rounding that readings of the same position share."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Channel, Episode, Initial, Reading, Study
from reality_gap.study.measurements import measured
from reality_gap.study.rounding import with_shared_rounding
from reality_gap.types import Floats
from tests.reality_gap.study.one_hinge import hinge, study

SERVO = """<mujoco><option timestep="0.004"/><worldbody><body><joint name="j" damping="1"/>
<geom size=".1" mass="1"/></body></worldbody>
<actuator><position name="m" joint="j" kp="20"/></actuator>
<sensor><jointpos name="angle" joint="j"/></sensor></mujoco>"""
STEP, REST = 0.02, slice(300, 700)


@pytest.fixture
def model(tmp_path: Path) -> Path:
    return hinge(tmp_path)


def motion(phase: float) -> Floats:
    """A motion through 20 steps, a rest between two of them, and a motion on [rad]."""
    there, back = np.linspace(-20.0, 0.0, 300), np.linspace(0.0, 25.0, 300)
    return STEP * (np.r_[there, np.zeros(400), back] + phase)


def logged(model: Path, true: Floats, noise: float, seed: int) -> Study:
    """Study of angles with noise that is rounded, both in steps, and stated as one deviation."""
    added = STEP * noise * np.random.default_rng(seed).standard_normal(len(true))
    values = STEP * np.round((true + added) / STEP)
    return study(model, values, STEP * float(np.hypot(noise, 12.0**-0.5)))


@pytest.mark.parametrize("noise", [0.0, 0.05, 0.1, 0.2, 0.3, 0.5])
def test_the_mean_of_a_rest_has_the_error_that_its_noise_claims(model: Path, noise: float) -> None:
    """Over rests at all positions between two steps, with noise in steps."""
    errors, claimed = [], []
    for seed, phase in enumerate(np.linspace(0.0, 1.0, 60, endpoint=False)):
        true = motion(phase)
        log = logged(model, true, noise, seed)
        found = with_shared_rounding(log, measured(log), 1.02 * true + 0.3 * STEP)
        weight = found.noise[REST] ** -2
        errors.append(np.average((found.value - true)[REST], weights=weight))
        claimed.append(1.0 / np.sum(weight))
    assert np.mean(np.square(errors)) == pytest.approx(np.mean(claimed), rel=0.3)


@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_a_motion_through_the_steps_is_measured_by_all_readings(model: Path, noise: float) -> None:
    true = motion(0.4)
    log = logged(model, true, noise, 0)
    found = with_shared_rounding(log, measured(log), true)
    moving = np.r_[30:280, 720:970]
    assert found.noise[moving] == pytest.approx(np.full(500, log.channels[0].noise))


def test_readings_that_move_share_nothing_although_the_model_rests(model: Path) -> None:
    log = logged(model, motion(0.4), 0.0, 0)
    found = with_shared_rounding(log, measured(log), np.zeros(1000))
    assert found.noise[30:270].max() < 8.0 * STEP / np.sqrt(12.0)


def test_readings_without_a_prediction_keep_their_noise(model: Path) -> None:
    log = logged(model, motion(0.4), 0.0, 0)
    before = measured(log)
    found = with_shared_rounding(log, before, np.full(1000, np.nan))
    assert np.array_equal(found.noise, before.noise)


def test_a_replay_of_the_model_shows_which_readings_rest(tmp_path: Path) -> None:
    """Noise of a quarter of a step moves them between two values; samples are not even."""
    path, rng = tmp_path / "servo.xml", np.random.default_rng(5)
    path.write_text(SERVO)
    model = mujoco.MjModel.from_xml_string(SERVO)
    data, rows = mujoco.MjData(model), []
    while data.time < 8.0:
        data.ctrl[0] = 0.509 if data.time > 2.0 else 0.0
        rows.append([data.time, data.ctrl[0], data.qpos[0] + 0.25 * STEP * rng.standard_normal()])
        mujoco.mj_step(model, data, int(rng.integers(2, 5)))
    time, command, angle = np.array(rows).T
    channel = Channel("angle", "angle", unit="rad", noise=STEP * float(np.hypot(0.25, 12.0**-0.5)))
    reading = Reading(time, STEP * np.round(angle / STEP))
    episode = Episode("log", time, command[:, None], (reading,))
    log = Study("servo", path, (channel,), (episode,), Initial(settle=0.0))
    with Replayer(log) as replayer:
        noise = replayer.measured.noise
    assert noise[time > 5.0].min() > 1.5 * channel.noise
    assert np.isclose(noise, channel.noise).any()

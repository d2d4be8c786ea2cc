"""Quick motions: a right model explains their efforts to the noise, whatever the clocks are."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reality_gap import Options, Verdict, diagnose
from reality_gap.simulation.inverse_dynamics import prepare
from reality_gap.simulation.measured_motion import low_pass
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Reading, Study
from reality_gap.types import Floats
from tests.reality_gap.causes.machines import pushed_screw, screw_study

TONES = np.array([6.1, 11.7, 17.3])
"""Angular frequencies of the motion; the quickest is 2.75 Hz [rad/s]."""


def quick_study(folder: Path, rates: tuple[float, float], jitter: float, noise: float) -> Study:
    """Return a log of a carriage of 90 kg; its position and its effort have clocks of their own."""
    study, rng = screw_study(folder, effort=True), np.random.default_rng(3)
    phases = rng.uniform(0.0, 6.0, 3)

    def clock(rate: float) -> Floats:
        time = np.arange(0.0, 12.0, 1.0 / rate)
        return time + rng.uniform(-jitter, jitter, len(time)) / rate

    def derivative(time: Floats, order: int) -> Floats:
        quarter = order * np.pi / 2
        return 0.02 * np.sin(TONES * time[:, None] + phases + quarter) @ TONES**order

    of_position, of_effort = clock(rates[0]), clock(rates[1])
    position = derivative(of_position, 0) + 1e-6 * rng.standard_normal(len(of_position))
    effort = 90.0 * derivative(of_effort, 2) + 200.0 * derivative(of_effort, 1)
    effort += noise * rng.standard_normal(len(of_effort))
    channels = (
        replace(study.channels[0], noise=1e-6),
        replace(study.channels[1], noise=noise),
    )
    readings = (Reading(of_position, position), Reading(of_effort, effort))
    command = np.zeros((len(of_effort), 1))
    episode = replace(study.episodes[0], time=of_effort, command=command, readings=readings)
    return replace(study, channels=channels, episodes=(episode,))


@pytest.mark.parametrize("jitter", [0.0, 0.2])
@pytest.mark.parametrize(
    ("rates", "noise"),
    [
        ((20, 20), 1.0),
        ((30, 30), 0.3),
        ((100, 100), 0.1),
        ((1000, 1000), 0.3),
        ((1000, 100), 0.1),
        ((100, 1000), 0.1),
        ((250, 130), 0.1),
    ],
)
def test_the_right_model_leaves_the_noise(
    tmp_path: Path, rates: tuple[float, float], noise: float, jitter: float
) -> None:
    """Forces have an amplitude of 540 N, of which noise is 0.02 to 0.2 %."""
    with Replayer(prepare(quick_study(tmp_path, rates, jitter, noise))) as replayer:
        residual = replayer.residual([])

    assert 0.8 < np.sqrt(np.mean(residual**2)) < 1.3


def test_what_a_filter_leaves_does_not_depend_on_the_rate() -> None:
    def left(rate: float) -> Floats:
        time = np.arange(0.0, 10.0 + 0.5 / rate, 1.0 / rate)
        tone = np.sin(2 * np.pi * 3.0 * time)
        return low_pass(tone, 4.0, 1.0 / rate)[:: round(rate / 25)]

    np.testing.assert_allclose(left(25.0)[25:-25], left(1000.0)[25:-25], atol=2e-4)


def test_a_log_without_a_push_has_nothing_wrong(tmp_path: Path) -> None:
    found = diagnose(pushed_screw(tmp_path, 0.0, 0.0), options=Options(suggest=False))

    assert found.verdict == Verdict.NOTHING_WRONG
    assert not found.causes


def test_a_short_push_that_no_report_block_shows_is_named(tmp_path: Path) -> None:
    """Its edges are steeper than those of the model, and what motions explain by chance is much."""
    study = pushed_screw(tmp_path, 4.16, 4.72)
    found = diagnose(study, options=Options(suggest=False))

    [push] = found.causes
    assert push.candidate.cause.id == "external_force"
    assert push.parameters["start"].value == pytest.approx(4.16, abs=0.02)
    assert push.parameters["duration"].value == pytest.approx(0.56, abs=0.03)

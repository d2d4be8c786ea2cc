"""Measured efforts with a wrong scale, an offset or a delay."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reality_gap.causes import CATALOGUE
from reality_gap.causes.base import Location
from reality_gap.inference.theta import is_tolerable
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.study.measurements import measured
from reality_gap.study.system import System
from tests.reality_gap.causes.candidates import candidate, with_cause
from tests.reality_gap.causes.carriage import carriage_study
from tests.reality_gap.causes.machines import predict, pushed_screw


def test_measured_efforts_may_have_a_scale_and_an_offset(systems: dict[str, System]) -> None:
    system = systems["arm"]
    at = Location("sensor", ("force_elbow",))
    readings = measured(system.study)
    own, before = readings.channel == 4, predict(system)

    scaled = with_cause(system, "effort_scale", at, scale=0.5)
    shifted = with_cause(system, "effort_offset", at, offset=0.3)

    np.testing.assert_allclose(scaled, np.where(own, 1.5 * before, before), atol=1e-9)
    np.testing.assert_allclose(shifted, before + np.where(own, 0.3 / readings.noise, 0), atol=1e-9)


@pytest.mark.parametrize("late", [0.03, -0.03])
def test_efforts_may_be_later_than_positions_or_earlier(
    systems: dict[str, System], late: float
) -> None:
    with Replayer(carriage_study(systems["screw"].study.model, late)) as replayer:
        [location] = CATALOGUE["delay"].locations(replayer.system)
        one = candidate(replayer.system, "delay", location)
        before, after = replayer.residuals([[], [(one, {"delay": late})]])

    assert np.sqrt(np.mean(after**2)) < 0.05 * np.sqrt(np.mean(before**2))


def test_a_delay_of_efforts_that_their_readings_do_not_resolve_is_tolerated(
    tmp_path: Path,
) -> None:
    """Efforts are read each 10 ms, whatever the rows of the first file are."""
    study = pushed_screw(tmp_path, 4.0, 5.0)
    [episode] = study.episodes
    slow = replace(episode, time=episode.time[::100], command=episode.command[::100])
    with Replayer(replace(study, episodes=(slow,))) as replayer:
        [location] = CATALOGUE["delay"].locations(replayer.system)
        delay = candidate(replayer.system, "delay", location)
        assert is_tolerable(delay, {"delay": 5e-4})
        assert not is_tolerable(delay, {"delay": 1e-3})


def test_a_scale_of_efforts_scales_what_inverse_dynamics_compute(
    systems: dict[str, System],
) -> None:
    one = candidate(systems["effort"], "effort_scale", Location("joint", ("screw",)))
    with Replayer(carriage_study(systems["screw"].study.model)) as replayer:
        plain, scaled = (
            replayer.replay(parts).prediction for parts in ([], [(one, {"scale": 0.5})])
        )

    np.testing.assert_allclose(scaled, 1.5 * plain)


PENDULUM = """<mujoco><worldbody><body><joint name="axis" axis="0 1 0"/>
<geom type="sphere" size="0.01" pos="0 0 -0.5" mass="2" contype="0" conaffinity="0"/></body>
</worldbody><actuator><motor name="motor" joint="axis"/></actuator>
<sensor><jointpos name="angle" joint="axis"/></sensor></mujoco>"""


def swung_study(folder: Path, offset: float, scale: float) -> Study:
    """A log of a swung pendulum, whose encoder has a wrong zero and scale."""
    path = folder / "pendulum.xml"
    path.write_text(PENDULUM)
    time = np.arange(0.0, 24.0, 0.01)
    angle = 0.7 * np.sin(1.3 * time) + 0.4 * np.sin(2.9 * time)
    acceleration = -(0.7 * 1.3**2 * np.sin(1.3 * time) + 0.4 * 2.9**2 * np.sin(2.9 * time))
    effort = (2 * 0.5**2 + 0.4 * 2 * 0.01**2) * acceleration + 2 * 9.81 * 0.5 * np.sin(angle)
    channels = (
        Channel("angle", "angle", unit="rad", noise=1e-6),
        Channel("effort", "axis", unit="N m", noise=0.01, kind="effort"),
    )
    readings = (Reading(time, offset + (1.0 + scale) * angle), Reading(time, effort))
    episode = Episode("swing", time, np.zeros((len(time), 1)), readings)
    return Study("pendulum", path, channels, (episode,))


@pytest.mark.parametrize("offset", [-0.1, 0.1])
def test_a_wrong_zero_of_an_encoder_shows_in_efforts(tmp_path: Path, offset: float) -> None:
    assert left_by(swung_study(tmp_path, offset, 0.0), "joint_offset", {"offset": offset}) < 0.02


@pytest.mark.parametrize("scale", [-0.2, 0.3])
def test_a_wrong_scale_of_an_encoder_shows_in_efforts(tmp_path: Path, scale: float) -> None:
    assert left_by(swung_study(tmp_path, 0.0, scale), "encoder_scale", {"scale": scale}) < 0.02


def left_by(study: Study, id: str, values: dict[str, float]) -> float:
    """RMS with a cause over that without it."""
    with Replayer(study) as replayer:
        [location] = CATALOGUE[id].locations(replayer.system)
        one = candidate(replayer.system, id, location)
        before, after = replayer.residuals([[], [(one, values)]])
    return float(np.sqrt(np.mean(after**2) / np.mean(before**2)))

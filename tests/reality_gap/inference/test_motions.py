"""Tests of the motions that a next experiment is chosen from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reality_gap.inference.motions import PERIOD, SECONDS, motions
from reality_gap.study.data import Channel, Episode, Reading, Study

TIME = np.arange(0.0, 4.0, 0.02)


def study(*commands: np.ndarray) -> Study:
    """Of one actuator a column, commanded in as many episodes."""
    reading = Reading(TIME, np.zeros(len(TIME)))
    episodes = [Episode(str(i), TIME, c, (reading,)) for i, c in enumerate(commands)]
    return Study("s", Path("none.xml"), (Channel("x", "x", unit="m"),), tuple(episodes))


def swings(speed: float) -> np.ndarray:
    """A fast actuator and one a tenth as fast (n, 2), each at constant speed to and fro."""
    to_and_fro = np.abs((TIME % 2.0) - 1.0)
    return speed * np.column_stack([to_and_fro, 0.1 * to_and_fro + 3.0])


@pytest.mark.parametrize("speed", [0.01, 1.0])
def test_no_command_is_faster_or_farther_than_the_study_s(speed: float) -> None:
    known = swings(speed)

    for motion in motions(study(known)):
        moved = np.abs(np.diff(motion.command, axis=0)).max(axis=0) / PERIOD

        assert np.all(moved <= 1.1 * speed * np.array([1.0, 0.1])), motion.title
        assert np.all(motion.command >= known.min(axis=0) - 1e-12), motion.title
        assert np.all(motion.command <= known.max(axis=0) + 1e-12), motion.title
        assert np.all(np.ptp(motion.command, axis=0) > 0.2 * np.ptp(known, axis=0)), motion.title


def test_what_was_commanded_at_once_may_be_so_again() -> None:
    """Quick reversals take a quarter of a second where the study knows steps."""
    steps = np.column_stack([np.where(TIME % 1.0 < 0.5, 0.0, 1.0)])
    quick = next(m for m in motions(study(steps)) if m.title == "quick reversals")

    turns = np.sum(np.diff(np.sign(np.diff(quick.command[:, 0]))) != 0)

    assert turns >= SECONDS / 0.25 - 2


def test_every_motion_lasts_as_long_as_it_is_said_to() -> None:
    lengths = {len(m.command) for m in motions(study(swings(0.3), swings(0.1)))}

    assert lengths == {round(SECONDS / PERIOD)}


def test_an_actuator_that_never_moved_stays_where_it_was() -> None:
    still = np.column_stack([swings(1.0)[:, 0], np.full(len(TIME), 7.0)])

    for motion in motions(study(still)):
        np.testing.assert_array_equal(motion.command[:, 1], 7.0)


def liveliness(time: np.ndarray, command: np.ndarray) -> float:
    return float(np.sqrt(np.mean((np.diff(command, axis=0) / np.diff(time)[:, None]) ** 2)))


def test_no_motion_is_livelier_than_the_study_as_a_whole() -> None:
    """The study swings for a second and rests for three; reversals all the time are gentler."""
    known = swings(1.0)
    known[TIME > 1.0] = known[0]

    for motion in motions(study(known)):
        time = PERIOD * np.arange(len(motion.command))

        assert liveliness(time, motion.command) < 1.1 * liveliness(TIME, known), motion.title

"""Motions among which the next experiment is chosen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reality_gap.inference.motions import PERIOD, SECONDS, motions
from reality_gap.study.data import Channel, Episode, Reading, Study

TIME = np.arange(0.0, 4.0, 0.02)


def study(*commands: np.ndarray) -> Study:
    """Return a study with one episode for each array of commands (n, nu)."""
    reading = Reading(TIME, np.zeros(len(TIME)))
    episodes = [Episode(str(i), TIME, c, (reading,)) for i, c in enumerate(commands)]
    return Study("s", Path("none.xml"), (Channel("x", "x", unit="m"),), tuple(episodes))


def swings(speed: float) -> np.ndarray:
    """Return commands (n, 2) of an actuator to and fro, and of one a tenth as fast."""
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


def test_steps_are_allowed_if_the_study_has_steps() -> None:
    """Then a quick reversal takes a quarter of a second."""
    steps = np.column_stack([np.where(TIME % 1.0 < 0.5, 0.0, 1.0)])
    quick = next(m for m in motions(study(steps)) if m.title == "quick reversals")

    turns = np.sum(np.diff(np.sign(np.diff(quick.command[:, 0]))) != 0)

    assert turns >= SECONDS / 0.25 - 2


def test_every_motion_has_the_stated_duration() -> None:
    lengths = {len(m.command) for m in motions(study(swings(0.3), swings(0.1)))}

    assert lengths == {round(SECONDS / PERIOD)}


def test_an_actuator_that_never_moved_does_not_move() -> None:
    still = np.column_stack([swings(1.0)[:, 0], np.full(len(TIME), 7.0)])

    for motion in motions(study(still)):
        np.testing.assert_array_equal(motion.command[:, 1], 7.0)


def rms_speed(time: np.ndarray, command: np.ndarray) -> float:
    return float(np.sqrt(np.mean((np.diff(command, axis=0) / np.diff(time)[:, None]) ** 2)))


def test_no_motion_is_faster_on_average_than_the_study() -> None:
    """The study moves for a second and rests for three, so that permanent motions are slower."""
    known = swings(1.0)
    known[TIME > 1.0] = known[0]

    for motion in motions(study(known)):
        time = PERIOD * np.arange(len(motion.command))

        assert rms_speed(time, motion.command) < 1.1 * rms_speed(TIME, known), motion.title

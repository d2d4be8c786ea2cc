"""Tests of the motions that a next experiment is chosen from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from reality_gap.causes import cause
from reality_gap.equivalence import Alternatives
from reality_gap.fitting import Fit, to_theta
from reality_gap.next_experiment import PERIOD, SECONDS, halves, motions, next_experiment
from reality_gap.screening import screen, suspects
from reality_gap.study import Channel, Episode, Reading, Study
from reality_gap.workbench import Workbench

Array = NDArray[np.float64]
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


@pytest.mark.parametrize(
    ("chances", "evidence", "expected"),
    [
        ([0.6, 0.4], [32.0], True),
        ([0.6, 0.4], [0.5], False),
        ([0.6, 0.2, 0.2], [32.0, 32.0], True),
        ([0.6, 0.2, 0.2], [32.0, 0.5], False),  # one rival stays as near as it is
        ([1.0, 0.0], [0.0], True),  # no doubt is left to halve
    ],
)
def test_an_experiment_has_to_promise_half_the_doubt(
    chances: list[float], evidence: list[float], expected: bool
) -> None:
    assert halves(np.array(chances), np.array(evidence)) is expected


def liveliness(time: np.ndarray, command: np.ndarray) -> float:
    return float(np.sqrt(np.mean((np.diff(command, axis=0) / np.diff(time)[:, None]) ** 2)))


def test_no_motion_is_livelier_than_the_study_as_a_whole() -> None:
    """The study swings for a second and rests for three; reversals all the time are gentler."""
    known = swings(1.0)
    known[TIME > 1.0] = known[0]

    for motion in motions(study(known)):
        time = PERIOD * np.arange(len(motion.command))

        assert liveliness(time, motion.command) < 1.1 * liveliness(TIME, known), motion.title


def one_rival(bench: Workbench, null: Array, friction: float) -> Alternatives:
    """Friction of the flexor by itself, which may as well not be there."""
    [rubs] = (
        s
        for s in suspects(bench.system, [cause("coulomb_friction")])
        if s.place.elements == ("flexor",)
    )
    values = {"friction": friction, "presliding": 1e-5}
    theta = to_theta([(rubs, values)])
    fitted = Fit(
        [(rubs, values)], bench.residual([(rubs, values)]), np.zeros((len(null), 2)), theta, 6.0
    )
    return Alternatives(rubs, None, (fitted,), np.array([0.6]), np.array([6.0]), 6.0, ())


@pytest.mark.parametrize(("friction", "advised"), [(3.0, True), (1e-4, False)])
def test_that_there_is_nobody_is_a_rival_too(
    lever_study: Study, friction: float, advised: bool
) -> None:
    with Workbench(lever_study) as bench:
        null = bench.residual([])
        found = screen(bench, suspects(bench.system, [cause("length_offset")]), [], null)

        advice = next_experiment(bench, [one_rival(bench, null, friction)], found, null)

    if not advised:
        assert advice is None
        return
    assert advice is not None
    assert "shows whether coulomb_friction at flexor is there" in advice.sentence
    assert advice.separation > advice.separation_before > 0.0
    assert advice.command.shape == (round(SECONDS / PERIOD), 2)

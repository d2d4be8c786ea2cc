"""Static poses: moments of rest are found where commands are constant."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.study.static_poses import find_moments


def _study(*commands: np.ndarray, readings: tuple[Reading, ...] | None = None) -> Study:
    """A study of commands (n, 1) at 100 Hz; by default its channel reads ten times the time."""
    episodes = []
    for i, command in enumerate(commands):
        time = np.arange(len(command)) / 100
        read = (Reading(time, 10 * time),) if readings is None else readings
        episodes.append(Episode(f"episode {i}", time, command, read))
    return Study("test", Path("none.xml"), (Channel("angle", "angle"),), tuple(episodes))


def _ramp_and_rest(*levels: float) -> np.ndarray:
    """A command that moves to each level within a second and holds it for a second (n, 1)."""
    parts = [np.full(100, levels[0])]
    for before, after in pairwise(levels):
        parts += [np.linspace(before, after, 101)[1:], np.full(100, after)]
    return np.concatenate(parts)[:, None]


def test_rest_is_where_commands_are_constant() -> None:
    found = find_moments(_study(_ramp_and_rest(0.0, 1.0, 0.5)))
    assert found.command[:, 0] == pytest.approx([0.0, 1.0, 0.5])
    assert len(found) == 3
    # A moment is at the end of a rest, well after the command has become constant.
    assert np.all(found.time % 2 > 0.5)
    assert found.time[1] == pytest.approx(2.75, abs=0.05)


def test_readings_are_those_at_the_end_of_the_rest() -> None:
    found = find_moments(_study(_ramp_and_rest(0.0, 1.0, 0.5)))
    assert found.value[:, 0] == pytest.approx(10 * found.time, abs=0.1)


def test_a_channel_without_readings_is_nan() -> None:
    early = Reading(np.array([0.6, 0.7, 0.8]), np.array([1.0, 2.0, 3.0]))
    found = find_moments(_study(_ramp_and_rest(0.0, 1.0), readings=(early,)))
    assert found.value[0, 0] == pytest.approx(2.0)
    assert np.isnan(found.value[1, 0])


def test_each_episode_has_its_own_moments() -> None:
    found = find_moments(_study(_ramp_and_rest(0.0, 1.0), _ramp_and_rest(2.0, 3.0)))
    assert found.episode.tolist() == [0, 0, 1, 1]
    assert found.command[:, 0] == pytest.approx([0.0, 1.0, 2.0, 3.0])


def test_a_command_with_a_tiny_ripple_counts_as_constant() -> None:
    command = _ramp_and_rest(0.0, 1.0, 0.5)
    command += 2e-7 * np.sin(np.arange(len(command)))[:, None]
    assert len(find_moments(_study(command))) == 3


def test_no_rest_in_a_sweep() -> None:
    sweep = np.sin(np.arange(500) / 50)[:, None]
    found = find_moments(_study(sweep))
    assert len(found) == 0
    assert found.command.shape == (0, 1)
    assert found.value.shape == (0, 1)


def test_a_short_stop_is_not_a_moment_of_rest() -> None:
    stop = np.concatenate([np.linspace(0, 1, 100), np.full(40, 1.0), np.linspace(1, 2, 100)[1:]])
    assert len(find_moments(_study(stop[:, None]))) == 0


def test_a_long_rest_counts_at_its_end() -> None:
    found = find_moments(_study(np.repeat([0.0, 1.0], 400)[:, None]))
    assert found.time == pytest.approx([3.75, 7.75], abs=0.05)

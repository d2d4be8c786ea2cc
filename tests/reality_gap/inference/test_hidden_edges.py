"""Events of efforts that begin and end where no reading is fitted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reality_gap.causes import CATALOGUE
from reality_gap.inference.forward_selection import Search, Step
from reality_gap.inference.gauss_newton import fit
from reality_gap.inference.hidden_edges import _hidden, with_hidden_edges
from reality_gap.inference.likelihood import independent_noise
from reality_gap.inference.paying import held_out_test
from reality_gap.inference.problem import Problem
from reality_gap.inference.verdict import Options
from reality_gap.pipeline import diagnose
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Reading
from reality_gap.study.splits import hidden_block
from tests.reality_gap.causes.machines import first_of_each_kind, pushed_screw


def test_blocks_of_the_report_split_are_hidden() -> None:
    assert hidden_block(0, 0.8) == (0.75, 1.0)
    assert hidden_block(0, 1.1) is None
    assert hidden_block(1, 0.6) == (0.5, 0.75)
    assert hidden_block(0, -0.05) is None


def problem_of(replayer: Replayer) -> Problem:
    null = replayer.residual([])
    return Problem(replayer, null, independent_noise(replayer.measured, np.zeros((len(null), 0))))


@pytest.mark.parametrize(("begin", "end"), [(0.0, 3.3), (8.7, 11.98)])
def test_edges_stay_within_the_log(tmp_path: Path, begin: float, end: float) -> None:
    with Replayer(pushed_screw(tmp_path, begin, end)) as replayer:
        problem = problem_of(replayer)
        push = first_of_each_kind(replayer.system, CATALOGUE["external_force"])[0]
        values = push.null_values() | {"x": 40.0, "start": begin, "duration": end - begin}
        [(_, moved)] = with_hidden_edges(problem, fit(problem, [(push, values)])).hypothesis
    for name in ("start", "duration"):
        p = push.parameter(name)
        assert p.low <= moved[name] <= p.high
    assert moved["start"] + moved["duration"] <= 12.0


def test_no_edge_is_moved_into_the_next_episode(tmp_path: Path) -> None:
    """A block of the report split begins at 11.75 s, and the first log ends at 11.9 s."""
    study = pushed_screw(tmp_path, 8.7, 11.85)
    [episode] = study.episodes
    early = episode.time < 11.9
    readings = tuple(Reading(r.time[early], r.value[early]) for r in episode.readings)
    cut = replace(episode, time=episode.time[early], command=episode.command[early])
    first = replace(cut, readings=readings)
    times = _hidden(replace(study, episodes=(first, episode)), 11.85)
    assert times
    assert max(times) <= first.duration


def test_moved_edges_are_no_gain_of_another_cause(tmp_path: Path) -> None:
    """The push begins and ends where only the report split shows it."""
    with Replayer(pushed_screw(tmp_path, 3.78, 5.97)) as replayer:
        problem = problem_of(replayer)
        push = first_of_each_kind(replayer.system, CATALOGUE["external_force"])[0]
        delay = first_of_each_kind(replayer.system, CATALOGUE["delay"])[0]
        values = push.null_values() | {"x": 40.0, "start": 3.85, "duration": 2.1}
        alone = fit(problem, [(push, values)])
        both = fit(problem, [*alone.hypothesis, (delay, {"delay": 1e-4})])
        step = Step(alone, (both,), 20.0, 7.0)
        result = Search(problem, (step,), with_hidden_edges(problem, both), ())
        moved = both.hypothesis[0][1]["start"] != result.best.hypothesis[0][1]["start"]
        assert moved
        [of_push, of_delay] = held_out_test(result).each
    assert of_push.pays
    assert not of_delay.pays


@pytest.mark.parametrize(
    ("begin", "end"), [pytest.param(3.85, 6.93, marks=pytest.mark.slow), (4.1, 7.3)]
)
def test_a_push_is_named_wherever_it_begins_and_ends(
    tmp_path: Path, begin: float, end: float
) -> None:
    study = pushed_screw(tmp_path, begin, end)
    hidden = [hidden_block(0, time) is not None for time in (begin, end)]
    assert len(set(hidden)) == 1

    found = diagnose(study, options=Options(suggest=False))

    assert found.verdict.has_names
    [cause] = found.causes
    assert cause.candidate.cause is CATALOGUE["external_force"]
    values = {name: one.value for name, one in cause.parameters.items()}
    assert values["start"] == pytest.approx(begin, abs=0.03)
    assert values["start"] + values["duration"] == pytest.approx(end, abs=0.03)
    assert values["x"] == pytest.approx(40.0, rel=0.05)

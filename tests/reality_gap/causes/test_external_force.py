"""External force: once in a log, or in each episode."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from reality_gap.causes import external_force
from reality_gap.causes.external_force import CAUSE, EACH, REGULAR, REGULAR_EACH
from reality_gap.simulation.hypothesis import Candidate, build
from reality_gap.simulation.replay import replay
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Study
from reality_gap.study.measurements import measured
from reality_gap.study.system import compile_system
from reality_gap.types import Floats

START, DURATION = 1.0, 0.5


def moved(study: Study, note: str, start: float) -> list[Floats]:
    """Times of the readings that a push changes, in each episode [s]."""
    with Replayer(study, 1) as replayer:
        location = next(p for p in CAUSE.locations(replayer.system) if p.note == note)
        push = Candidate(CAUSE, location, CAUSE.parameters(replayer.system, location))
        values = {"x": 3.0, "y": 3.0, "z": 3.0, "start": start, "duration": DURATION}
        null, pushed = replayer.residuals([[], [(push, values)]])
        changed = np.abs(pushed - null) > 1e-3
        measured = replayer.measured
        return [
            measured.time[changed & (measured.episode == e)] for e in range(len(study.episodes))
        ]


def test_a_push_in_each_episode_begins_at_the_same_time_of_each(lever_study: Study) -> None:
    assert len(lever_study.episodes) == 2

    for times in moved(lever_study, EACH, START):
        assert times.min() == pytest.approx(START, abs=0.15)


def test_a_single_push_is_in_one_episode(lever_study: Study) -> None:
    first, second = moved(lever_study, "", lever_study.episodes[0].duration + START)

    assert len(first) == 0
    assert second.min() == pytest.approx(START, abs=0.15)


def test_a_push_at_the_end_of_an_episode_does_not_continue_in_the_next(
    lever_study: Study,
) -> None:
    late = lever_study.episodes[0].duration - 0.2

    for times in moved(lever_study, EACH, late):
        assert times.min() > late - 0.15


def test_a_log_of_one_episode_has_no_pushes_in_each(lever_study: Study) -> None:
    short = replace(lever_study, episodes=lever_study.episodes[:1])

    assert [p.note for p in CAUSE.locations(compile_system(short))] == ["", REGULAR]


@pytest.mark.parametrize("start", [0.4, -0.3])
def test_a_train_is_the_sum_of_its_pushes(lever_study: Study, start: float) -> None:
    """One that had begun before the log has ended, too."""
    study = replace(lever_study, episodes=lever_study.episodes[:1])
    system, period = compile_system(study), 0.7
    values = {"x": 3.0, "y": -2.0, "z": 1.0, "duration": 0.15}
    single, train = (
        Candidate(CAUSE, p, CAUSE.parameters(system, p)) for p in CAUSE.locations(system)
    )
    times = np.arange(0.4, study.duration, period)
    with Replayer(study, 1) as replayer:
        null, found, expected = replayer.residuals(
            [
                [],
                [(train, values | {"start": start, "period": period})],
                [(single, values | {"start": float(time)}) for time in times],
            ]
        )

    assert len(times) > 2
    assert np.abs(found - null).max() > 1.0
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(found - null).max())


def test_a_train_in_each_episode_begins_again(lever_study: Study) -> None:
    system = compile_system(lever_study)
    [location] = [p for p in CAUSE.locations(system) if p.note == REGULAR_EACH]
    train = Candidate(CAUSE, location, CAUSE.parameters(system, location))
    values = train.null_values() | {"z": 3.0, "start": 0.5, "duration": 0.2, "period": 0.6}
    origin = lever_study.episodes[0].duration

    effects = build(system, [(train, values)]).effects
    first, second = (hook.wrenches for hook in effects.hooks)
    assert first is not None
    assert second is not None
    time = np.linspace(0.0, 1.5, 61)
    np.testing.assert_allclose(
        first(system.model, time), second(system.model, time + origin), atol=1e-9
    )
    assert [hook.end for hook in effects.hooks] == [origin, lever_study.duration]


@pytest.mark.parametrize("seconds", [3.0, 60.0, 3600.0])
def test_periods_resolve_a_quarter_of_a_turn(seconds: float) -> None:
    periods = np.array(external_force.periods_of(seconds))
    turns = seconds / periods

    assert len(periods) <= external_force.PERIODS
    assert turns[0] == pytest.approx(external_force.REPEATS)
    np.testing.assert_allclose(np.diff(turns), 0.25)
    assert periods[-1] >= external_force.SHORTEST


@pytest.mark.parametrize("note", ["", EACH, REGULAR, REGULAR_EACH])
def test_a_push_in_c_equals_its_hook(lever_study: Study, note: str) -> None:
    system = compile_system(lever_study)
    location = next(p for p in CAUSE.locations(system) if p.note == note)
    values = {"x": 3.0, "y": -2.0, "z": 1.0, "start": START, "duration": DURATION}
    values |= {"period": 0.8} if note.startswith(REGULAR) else {}
    push = Candidate(CAUSE, location, CAUSE.parameters(system, location))

    def replayed(push: list[tuple[Candidate, dict[str, float]]], in_c: bool) -> Floats:
        plant = build(system, push)
        hooks = plant.effects.hooks
        assert all(h.wrenches is not None for h in hooks)
        stop = START + 0.5 * DURATION  # in the middle of the push
        hooks[:] = [replace(h, end=min(stop, h.end)) for h in hooks]
        if not in_c:
            hooks[:] = [replace(h, wrenches=None) for h in hooks]
        return replay(plant, lever_study, measured(lever_study)).prediction

    in_c, hooked = (replayed([(push, values)], c) for c in (True, False))
    moved = np.abs(hooked - replayed([], in_c=True)).max()

    assert moved > 1e-3
    assert np.abs(in_c - hooked).max() < 1e-9 * moved

"""Absolute encoders, and elongation in the pauses between episodes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from reality_gap.causes import find_cause
from reality_gap.inference.screening import list_candidates
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Study

PAUSE = 600.0
"""Pause between both episodes [s]."""


def candidate_of(replayer: Replayer, cause: str, note: str = "") -> Candidate:
    """Return a cause at the flexor, or at its first point."""
    found = list_candidates(replayer.system, [find_cause(cause)])
    return next(
        c
        for c in found
        if c.location.elements[0].startswith("flexor") and c.location.note.startswith(note)
    )


def test_a_slow_elongation_goes_on_in_pauses(lever_study: Study) -> None:
    first, second = lever_study.episodes
    late = replace(second, start=first.duration + PAUSE)
    paused = replace(lever_study, episodes=(replace(first, start=0.0), late))
    rate = 0.005 / PAUSE
    found = {}
    for name, study in {"paused": paused, "not": lever_study}.items():
        with Replayer(study) as replayer:
            one = candidate_of(replayer, "wire_elongation", "slowly")
            null = replayer.replay([]).prediction
            change = null - replayer.replay([(one, {"rate": rate})]).prediction
            at = (replayer.measured.channel == 0) & (replayer.measured.episode == 1)
            found[name] = float(np.mean(change[at]))
    # A servo holds the length that its encoder reads, within its stiffness.
    assert abs(found["paused"]) > 20.0 * abs(found["not"])


def test_pauses_are_unknown_if_clocks_restart(lever_study: Study) -> None:
    time = np.array([0.5, 7.0])
    np.testing.assert_array_equal(lever_study.elapsed(time), time)


@pytest.mark.parametrize("absolute", [False, True])
def test_relative_encoders_show_no_error_where_they_are_zeroed(
    lever_study: Study, absolute: bool
) -> None:
    study = replace(lever_study, absolute_encoders=absolute)
    with Replayer(study) as replayer:
        one = candidate_of(replayer, "attachment_shift")
        values = one.null_values() | {one.parameters[0].name: 0.002}
        rest = replace(
            study,
            episodes=tuple(
                replace(e, command=np.tile(e.command[:1], (len(e.time), 1)))
                for e in study.episodes[:1]
            ),
        )
    with Replayer(rest) as replayer:
        null = replayer.replay([]).records[0]
        record = replayer.replay([(one, values)]).records[0]
        read = record.sensors[0, record.column("length_flexor")]
        nominal = null.sensors[0, null.column("length_flexor")]
        path = record.length[0, 0] - null.length[0, 0]
    error = read - record.length[0, 0]
    if absolute:
        assert error == pytest.approx(0.0, abs=1e-9)
    else:
        assert abs(error) > 1e-5
        assert read - nominal == pytest.approx(path + error, abs=1e-9)

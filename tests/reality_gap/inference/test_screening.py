"""Tests of the cheap look at every suspect, on a lever that two wires pull."""

from __future__ import annotations

import numpy as np
import pytest

from reality_gap.causes import cause
from reality_gap.inference.screening import Sensitivity, candidates, screen, tolerances
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Study
from reality_gap.types import Floats


class Look:
    """Sensitivities of some causes, and how many replays they took."""

    def __init__(self, study: Study, *ids: str) -> None:
        self.replays = 0
        self.replayer = Replayer(study, tick=self._tick)
        chosen = candidates(self.replayer.system, [cause(id) for id in ids])
        self.null = self.replayer.residual([])
        before = self.replays
        self.found = screen(self.replayer, chosen, [], self.null)
        self.replays -= before + self.replayer.coarse  # the null once more, at the coarse step

    def _tick(self) -> None:
        self.replays += 1

    def alone(self) -> list[Sensitivity]:
        return [s for s in self.found if len(s.candidate.location.elements) == 1]

    def group(self) -> Sensitivity:
        return next(s for s in self.found if len(s.candidate.location.elements) > 1)

    def columns(self) -> list[Floats]:
        """The tolerances but those of the time step."""
        return list(tolerances(self.replayer, self.found, self.null).T[2:])


def test_a_shape_without_a_size_costs_no_replay_and_changes_nothing(lever_study: Study) -> None:
    look = Look(lever_study, "coulomb_friction")

    assert all(s.names == ("friction", "presliding") for s in look.found)
    assert look.replays == len(look.found)
    for sensitivity in look.found:
        assert np.linalg.norm(sensitivity.columns[:, 0]) > 0
        np.testing.assert_array_equal(sensitivity.columns[:, 1], 0.0)


def test_what_no_wire_is_free_of_may_be_in_all_of_them(
    lever_study: Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("reality_gap.inference.screening.MUCH", 1e9)
    look = Look(lever_study, "coulomb_friction")
    own = look.group().columns[:, 0]
    p = look.group().candidate.parameters[0]

    assert len(look.columns()) == len(look.alone()) + 1
    assert any(np.allclose(c, own * p.tolerance / p.scale) for c in look.columns())


@pytest.mark.parametrize("id", ["length_scale", "tendon_elasticity"])
def test_other_tolerances_are_those_of_each_element(lever_study: Study, id: str) -> None:
    look = Look(lever_study, id)
    columns = look.columns()
    first: dict[Candidate, Sensitivity] = {}
    for sensitivity in look.alone():
        first.setdefault(sensitivity.candidate, sensitivity)

    assert look.group() is not None
    assert len(columns) == len(first) == 2
    for column, sensitivity in zip(columns, first.values(), strict=True):
        p = sensitivity.candidate.parameters[0]
        expected = sensitivity.columns[:, 0] * p.tolerance / p.scale
        np.testing.assert_allclose(column, expected, rtol=1e-5)


def test_what_the_columns_of_large_tolerances_are_wrong_by_is_tolerated_too(
    lever_study: Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("reality_gap.inference.screening.MUCH", 1e9)
    look = Look(lever_study, "length_scale")
    screened = look.columns()
    monkeypatch.setattr("reality_gap.inference.screening.MUCH", 1.0)
    kept, wrong = look.columns()[:2], look.columns()[2:]
    tendons = dict.fromkeys(sensitivity.candidate for sensitivity in look.alone())

    # Suspects are ranked by the very columns that are tolerated, or they would seem to do more.
    np.testing.assert_array_equal(kept, screened)
    assert len(wrong) == 2
    for column, more, candidate in zip(screened, wrong, tendons, strict=True):
        p = candidate.parameters[0]
        replayed = look.null - look.replayer.residual([(candidate, {p.name: p.tolerance})])
        np.testing.assert_allclose(column + more, replayed, atol=1e-9)
        assert np.linalg.norm(more) < 0.1 * np.linalg.norm(column)


def test_the_change_that_typical_faults_make(lever_study: Study) -> None:
    look = Look(lever_study, "tension_offset")
    [sensitivity] = [s for s in look.alone() if s.candidate.location.elements == ("flexor",)]
    p = sensitivity.candidate.parameters[0]
    studied = look.replayer.system.study
    channel = [c.name for c in studied.channels].index("tension_flexor")
    count = int(np.sum(look.replayer.measured.channel == channel))
    noise = look.replayer.measured.noise[look.replayer.measured.channel == channel][0]

    # Three typical faults of an offset move every reading of the one sensor by as much.
    assert sensitivity.change == pytest.approx(3 * p.scale / noise * np.sqrt(count), rel=1e-6)


def test_what_looks_different_from_afar_is_looked_at_from_there_too(lever_study: Study) -> None:
    """An encoder that counts too little makes the servo hold its wire short: slopes differ."""
    look = Look(lever_study, "length_scale")
    secants = look.found[0].candidate.parameters[0].hints.secants
    one = [s.columns[:, 0] for s in look.found if s.candidate == look.found[0].candidate]

    assert len(one) == 1 + len(secants) == 3
    assert look.replays == len(look.found)
    # All are slopes, per scale and of the same sign, whatever the size of the step.
    for other in one[1:]:
        assert np.dot(one[0], other) > 0.5 * np.linalg.norm(one[0]) * np.linalg.norm(other)
        assert not np.allclose(one[0], other, rtol=1e-3)

"""Screening and tolerances, on a lever that two tendons pull."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reality_gap.causes import find_cause
from reality_gap.inference.screening import Sensitivity, list_candidates, screen
from reality_gap.inference.tolerances import (
    Tolerance,
    form_errors,
    list_tolerances,
    tolerance_columns,
)
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.types import Floats


class Screening:
    """Sensitivities of some causes.

    Attributes:
        found: the sensitivities.
        replays: number of replays that they took.
    """

    def __init__(self, study: Study, *ids: str) -> None:
        self.replays = 0
        self.replayer = Replayer(study, tick=self._tick)
        chosen = list_candidates(self.replayer.system, [find_cause(id) for id in ids])
        self.null = self.replayer.residual([])
        before = self.replays
        self.found = screen(self.replayer, chosen, self.null)
        self.replays -= before + self.replayer.coarse  # the nominal model again, at the coarse step

    def _tick(self) -> None:
        self.replays += 1

    def alone(self) -> list[Sensitivity]:
        """Return the first sensitivity of each candidate at one element; others are of secants."""
        first: dict[Candidate, Sensitivity] = {}
        for s in self.found:
            if len(s.candidate.location.elements) == 1:
                first.setdefault(s.candidate, s)
        return list(first.values())

    def group(self) -> Sensitivity:
        return next(s for s in self.found if len(s.candidate.location.elements) > 1)

    def columns(self) -> list[Floats]:
        """Return the columns of tolerances, without those of the time step."""
        tolerances = list(list_tolerances(self.found))
        return list(tolerance_columns(self.replayer, tolerances, self.null).T[:-3])


def test_a_shape_without_a_size_costs_no_replay_and_changes_nothing(lever_study: Study) -> None:
    screening = Screening(lever_study, "coulomb_friction")

    slopes = [s for s in screening.found if "presliding" in s.names]
    shapes = {"presliding", "creep"}
    assert all(s.names[0] == "friction" and set(s.names[1:]) <= shapes for s in slopes)
    assert len({s.candidate for s in screening.found}) == len(slopes)
    assert screening.replays == len(screening.found)
    for sensitivity in slopes:
        assert np.linalg.norm(sensitivity.columns[:, 0]) > 0
        np.testing.assert_array_equal(sensitivity.columns[:, 1:], 0.0)


def test_usual_effects_may_deviate_in_all_tendons_at_once(
    lever_study: Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("reality_gap.inference.tolerances.LARGE", 1e9)
    screening = Screening(lever_study, "coulomb_friction")
    own = screening.group().columns[:, 0]
    p = screening.group().candidate.parameters[0]

    assert len(list(list_tolerances(screening.found))) == len(screening.alone()) + 1
    assert any(np.allclose(c, own * p.tolerance / p.scale) for c in screening.columns())


@pytest.mark.parametrize("share", [0.5, 2.0])
def test_where_tolerated_friction_slips_is_not_known(lever_study: Study, share: float) -> None:
    """Other travels than those of the columns leave little of what they change."""
    screening = Screening(lever_study, "coulomb_friction")
    [one] = [
        t
        for t in list_tolerances(screening.found)
        if str(t.candidate.location) == "flexor" and t.parameter.name == "friction"
    ]
    candidate, values = one.deviation(2.0)
    p = candidate.parameter("presliding")
    moved = [(candidate, {**values, "presliding": x * p.null}) for x in (1.0, share)]
    usual, other = screening.replayer.residuals([[part] for part in moved])

    columns = np.column_stack(form_errors(screening.replayer, [one]))

    change = other - usual
    left = change - columns @ np.linalg.lstsq(columns, change)[0]
    assert columns.shape[1] == 2
    used = screening.columns()
    assert all(any(np.array_equal(column, one) for one in used) for column in columns.T)
    assert np.linalg.norm(left) < 0.4 * np.linalg.norm(change)


def test_the_largest_friction_of_a_location_stands_for_its_form(lever_study: Study) -> None:
    screening = Screening(lever_study, "coulomb_friction", "load_dependent_friction")
    at = {"flexor": list[Tolerance](), "extensor": list[Tolerance]()}
    for one in list_tolerances(screening.found, factor=3.0):
        if str(one.candidate.location) in at:
            at[str(one.candidate.location)].append(one)
    both = [max(some, key=lambda one: np.linalg.norm(one.column)) for some in at.values()]

    assert all(len(some) == 2 for some in at.values())
    columns = form_errors(screening.replayer, [*at["flexor"], *at["extensor"]])

    expected = form_errors(screening.replayer, both)
    assert len(columns) == 4
    assert all(np.array_equal(one, other) for one, other in zip(columns, expected, strict=True))


@pytest.mark.parametrize(("id", "count"), [("length_scale", 4), ("tendon_elasticity", 2)])
def test_other_tolerances_are_those_of_each_element(
    lever_study: Study, id: str, count: int
) -> None:
    """Lengths are read, and fed back by servos."""
    screening = Screening(lever_study, id)
    columns = screening.columns()
    first: dict[Candidate, Sensitivity] = {}
    for sensitivity in screening.alone():
        first.setdefault(sensitivity.candidate, sensitivity)

    assert screening.group() is not None
    assert len(columns) == len(first) == count
    for column, sensitivity in zip(columns, first.values(), strict=True):
        p = sensitivity.candidate.parameters[0]
        expected = sensitivity.columns[:, 0] * p.tolerance / p.scale
        np.testing.assert_allclose(column, expected, rtol=1e-5)


def test_what_the_columns_of_large_tolerances_are_wrong_by_is_tolerated_too(
    lever_study: Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("reality_gap.inference.tolerances.LARGE", 1e9)
    screening = Screening(lever_study, "length_scale")
    screened = screening.columns()
    monkeypatch.setattr("reality_gap.inference.tolerances.LARGE", 1.0)
    monkeypatch.setattr("reality_gap.inference.tolerances.SEEN", 0.0)
    count = len(screened)
    kept, wrong = screening.columns()[:count], screening.columns()[count:]
    tendons = dict.fromkeys(sensitivity.candidate for sensitivity in screening.alone())

    # Candidates are ranked by these columns, so that they must be tolerated unchanged.
    np.testing.assert_array_equal(kept, screened)
    assert count == len(tendons) == 4
    assert len(wrong) == 2  # readings alone, which come last, are linear
    for column, more, candidate in zip(screened, wrong, tendons, strict=False):
        p = candidate.parameters[0]
        replayed = screening.null - screening.replayer.residual(
            [(candidate, {p.name: p.tolerance})]
        )
        np.testing.assert_allclose(column + more, replayed, atol=1e-9)
        assert np.linalg.norm(more) < 0.1 * np.linalg.norm(column)


STICKING = """
<mujoco>
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="rail" type="slide" frictionloss="{friction}"/>
      <geom size="0.1" mass="2"/>
    </body>
  </worldbody>
  <actuator><position name="motor" joint="rail" kp="2000" kv="60"/></actuator>
  <sensor>
    <jointpos name="position" joint="rail"/>
    <actuatorfrc name="force" actuator="motor"/>
  </sensor>
</mujoco>
"""


def servo_study(folder: Path, friction: float) -> Study:
    """Return a servo that moves between rests, at which friction bears a part of its force."""
    path = folder / "servo.xml"
    path.write_text(STICKING.format(friction=friction), encoding="utf-8")
    time = np.arange(0.0, 6.0, 0.02)
    command = 0.05 * np.round(2.0 * np.sin(2.0 * time)) / 2.0
    channels = (
        Channel("position", "position", unit="m", noise=1e-4),
        Channel("force", "force", unit="N", noise=0.5),
    )
    readings = tuple(Reading(time, np.zeros(len(time))) for _ in channels)
    episode = Episode("steps", time, command[:, None], readings)
    return Study("servo", path, channels, (episode,))


@pytest.mark.parametrize(("friction", "more"), [(3.0, True), (0.0, False)])
def test_tolerances_are_replayed_at_their_own_size_where_joints_stick(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, friction: float, more: bool
) -> None:
    """A zero that is wrong by one tolerance moves the rest, where friction bears some force."""
    monkeypatch.setattr("reality_gap.inference.tolerances.LARGE", 1e9)
    monkeypatch.setattr("reality_gap.inference.tolerances.SEEN", 0.0)
    screening = Screening(servo_study(tmp_path, friction), "joint_offset")
    tolerances = list(list_tolerances(screening.found))
    columns = screening.columns()
    kept, errors = columns[: len(tolerances)], columns[len(tolerances) :]

    assert (len(errors) > 0) is more
    for one, column, error in zip(tolerances, kept, errors, strict=False):
        replayed = screening.null - screening.replayer.residual([one.deviation(1.0)])
        np.testing.assert_allclose(column + error, replayed, atol=1e-9)


def test_the_change_that_typical_faults_make(lever_study: Study) -> None:
    screening = Screening(lever_study, "tension_offset")
    [sensitivity] = [s for s in screening.alone() if s.candidate.location.elements == ("flexor",)]
    p = sensitivity.candidate.parameters[0]
    studied = screening.replayer.system.study
    channel = [c.name for c in studied.channels].index("tension_flexor")
    count = int(np.sum(screening.replayer.measured.channel == channel))
    noise = screening.replayer.measured.noise[screening.replayer.measured.channel == channel][0]

    # Three typical faults of an offset move every reading of the one sensor by as much.
    assert sensitivity.change == pytest.approx(3 * p.scale / noise * np.sqrt(count), rel=1e-6)


def test_the_change_that_the_largest_screened_fault_makes(lever_study: Study) -> None:
    screening = Screening(lever_study, "backlash")
    for one in screening.alone():
        large = max(one.candidate.parameters[0].hints.secants)
        some = [s for s in screening.found if s.candidate == one.candidate]
        values = one.candidate.null_values() | {one.names[0]: large}
        residual = screening.replayer.residual([(one.candidate, values)])
        changed = float(np.linalg.norm(screening.null - residual))

        assert one.largest_change == one.change
        assert max(s.largest_change for s in some) == pytest.approx(changed, rel=0.01)


def test_secants_are_screened_in_addition_to_the_slope_at_the_null(lever_study: Study) -> None:
    """With an encoder that counts too little, the servo shortens its tendon: slopes differ."""
    screening = Screening(lever_study, "length_scale")
    secants = screening.found[0].candidate.parameters[0].hints.secants
    one = [s.columns[:, 0] for s in screening.found if s.candidate == screening.found[0].candidate]

    assert len(one) == 1 + len(secants) == 3
    assert screening.replays == len(screening.found)
    # All are slopes, per scale and of the same sign, whatever the size of the step.
    for other in one[1:]:
        assert np.dot(one[0], other) > 0.5 * np.linalg.norm(one[0]) * np.linalg.norm(other)
        assert not np.allclose(one[0], other, rtol=1e-3)

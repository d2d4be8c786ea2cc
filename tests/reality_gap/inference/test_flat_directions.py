"""What a log cannot show, and the motion or the mass that would."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reality_gap.causes import find_cause
from reality_gap.inference.flat_directions import SURE, flat_directions
from reality_gap.inference.likelihood import independent_noise
from reality_gap.inference.problem import Problem
from reality_gap.inference.screening import list_candidates, screen
from reality_gap.log_findings import FlatDirection
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Initial, Reading, Study

POSTURE = 0.28185119
"""Angle at which the machine rests with the first command of the second episode [rad]."""
VISIBLE = 3.0
"""Change of the readings from which on a cause shows [noise]."""


def at_rest(study: Study, held: int, angle: float) -> Study:
    """Return a study in which the machine rests with the first command of an episode.

    The second episode moves, but nothing is read in it.

    Args:
        study: the good study.
        held: index of the episode whose first command is held.
        angle: angle at which the machine rests with it [rad].
    """
    first, second = study.episodes
    command = np.tile(study.episodes[held].command[0], (len(first.time), 1))
    none = tuple(Reading(np.zeros(0), np.zeros(0)) for _ in second.readings)
    return replace(
        study,
        channels=tuple(replace(c, noise=c.noise or 1e-3) for c in study.channels),
        episodes=(replace(first, command=command), replace(second, readings=none)),
        initial=Initial({"elbow": angle}, 2.0),
    )


def flat_of(study: Study, *causes: str, named: str = "") -> tuple[FlatDirection, ...]:
    with Replayer(study) as replayer:
        null = replayer.residual([])
        problem = Problem(
            replayer, null, independent_noise(replayer.measured, np.zeros((len(null), 0)))
        )
        found = list_candidates(replayer.system, [find_cause(cause) for cause in causes])
        own = [one for one in found if str(one.location) == named]
        return flat_directions(problem, screen(replayer, found, null), VISIBLE, own)


def test_a_friction_does_not_show_at_rest_but_in_a_motion(lever_study: Study) -> None:
    [found] = flat_of(at_rest(lever_study, 0, 0.0), "viscous_friction")
    assert found.separable
    assert {str(one.location) for one in found.candidates} >= {"elbow"}
    assert found.change < VISIBLE
    assert found.remedy is not None
    assert found.remedy.change > SURE * VISIBLE
    assert found.remedy.seconds == 30.0


def test_what_was_found_does_show(lever_study: Study) -> None:
    """A typical fault of a wrong model may not show where a large one does."""
    resting = at_rest(lever_study, 0, 0.0)
    assert "elbow" in {
        str(one.location) for f in flat_of(resting, "armature") for one in f.candidates
    }
    found = flat_of(resting, "armature", named="elbow")
    assert "elbow" not in {str(one.location) for f in found for one in f.candidates}


def test_a_friction_that_depends_on_the_load_shows_best_with_a_mass(lever_study: Study) -> None:
    [found] = flat_of(at_rest(lever_study, 0, 0.0), "load_dependent_friction")
    assert found.separable
    assert found.remedy is not None
    assert found.remedy.mass > 0.0
    assert found.remedy.body.startswith("lever")


def test_all_that_shows_and_can_be_separated_is_not_flat(lever_study: Study) -> None:
    assert flat_of(lever_study, "length_offset") == ()


def test_causes_with_the_same_effect_are_one_group(lever_study: Study) -> None:
    """At rest, the zero of an encoder and a length that is read with a factor are the same."""
    resting = at_rest(lever_study, 1, POSTURE)
    found = flat_of(resting, "length_offset", "length_scale")
    [group] = (
        one
        for one in found
        if not one.separable and "extensor" in {str(c.location) for c in one.candidates}
    )
    assert {one.cause.id for one in group.candidates} == {"length_offset", "length_scale"}
    assert group.change <= VISIBLE
    assert group.remedy is not None
    assert group.remedy.change > SURE * VISIBLE


def test_no_candidates_have_no_flat_directions(lever_study: Study) -> None:
    assert flat_of(lever_study) == ()

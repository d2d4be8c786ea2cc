"""Updates that make a map worse are found, and undone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.mapping.group_map import METRES
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Pairs
from jmm_agent.vision.hold_out import HoldOut, HoldOutOptions
from tests.jmm_agent.small_map import LIMITS, make_map, postures
from tests.jmm_agent.test_updaters import MIDDLE, UpdaterTrial

OPTIONS = HoldOutOptions(every=2, memory=3, least=2, factor=1.5, noise=0.003, patience=2)
POSTURES = MIDDLE + np.random.default_rng(3).uniform(-0.4, 0.4, (12, 4)) * (LIMITS[:, 1] - MIDDLE)


def shifted(jmm: JointMuscleMap, offset: float) -> JointMuscleMap:
    """The map with all lengths longer by an offset [m]."""
    return jmm.with_output_layers(
        {group.name: (group.W2, group.b2 + offset / METRES) for group in jmm.groups}
    )


@pytest.fixture
def jmm() -> JointMuscleMap:
    return make_map()


def pairs_of(jmm: JointMuscleMap, offset: float, count: int) -> list[Pairs]:
    """Pairs of a robot whose muscles are longer than in the map by an offset [m]."""
    angles = postures(count)
    noise = np.array([0.001])
    return [Pairs(q[None], jmm.lengths(q)[None] + offset, noise) for q in angles]


def holding(jmm: JointMuscleMap, offset: float = 0.005) -> HoldOut:
    """Three held-out pairs of such a robot."""
    hold_out = HoldOut(OPTIONS, 4, 5)
    assert [hold_out.keeps(pair) for pair in pairs_of(jmm, offset, 6)] == 3 * [False, True]
    return hold_out


def test_only_the_newest_are_remembered(jmm: JointMuscleMap) -> None:
    hold_out = HoldOut(OPTIONS, 4, 5)
    pairs = pairs_of(jmm, 0.005, 10)
    for pair in pairs:
        hold_out.keeps(pair)
    np.testing.assert_array_equal(
        hold_out.pairs.postures, np.concatenate([pairs[k].postures for k in (5, 7, 9)])
    )


@pytest.mark.parametrize(
    ("offset", "harmful"), [(0.005, False), (-0.003, False), (-0.006, True), (0.015, False)]
)
def test_only_a_much_larger_error_is_harm(
    offset: float, harmful: bool, jmm: JointMuscleMap
) -> None:
    """Errors: 5 mm before; after 0, 8, 11 and 10 mm. Harm begins above 1.5 x 5 + 3 mm."""
    assert holding(jmm).harmed(jmm, shifted(jmm, offset)) == harmful


def test_one_pair_is_no_evidence(jmm: JointMuscleMap) -> None:
    hold_out = HoldOut(OPTIONS, 4, 5)
    for pair in pairs_of(jmm, 0.0, 3):
        hold_out.keeps(pair)
    assert len(hold_out.pairs.noise) == 1
    assert not hold_out.harmed(jmm, shifted(jmm, 1.0))


def test_a_pair_that_is_wrong_itself_hides_no_harm(jmm: JointMuscleMap) -> None:
    hold_out = holding(jmm, 0.0)
    hold_out.pairs.lengths[0] += 0.5
    assert hold_out.harmed(jmm, shifted(jmm, 0.01))


def test_where_all_updates_seem_harmful_the_robot_has_changed(jmm: JointMuscleMap) -> None:
    hold_out = holding(jmm)
    harmful = shifted(jmm, -0.02)
    assert [hold_out.harmed(jmm, harmful) for _ in range(4)] == [True, True, False, False]
    assert not len(hold_out.pairs.noise)


def test_a_harmless_update_between_shows_that_it_has_not(jmm: JointMuscleMap) -> None:
    hold_out = holding(jmm)
    harmful = shifted(jmm, -0.02)
    maps = (harmful, harmful, jmm, harmful, harmful)
    assert [hold_out.harmed(jmm, after) for after in maps] == [True, True, False, True, True]


@pytest.mark.parametrize("wrong", ["every", "memory", "least", "patience"])
def test_options_that_hold_nothing_out_are_refused(wrong: str) -> None:
    with pytest.raises(AgentError, match=wrong):
        HoldOutOptions(**{wrong: 1 if wrong == "every" else 0})


def learned(**options: Any) -> UpdaterTrial:
    """An updater that has seen eight postures."""
    trial = UpdaterTrial(distance=0.0, **options)
    for q in POSTURES[:8]:
        trial.observe(q)
    return trial


def test_held_out_observations_are_not_learned() -> None:
    trial = learned(hold_out=OPTIONS)
    assert trial.vision.fired == len(trial.vision.pairs.noise) == 4
    assert trial.vision.hold_out is not None
    np.testing.assert_allclose(trial.vision.hold_out.pairs.postures, POSTURES[[3, 5, 7]], atol=0.05)
    assert trial.observe(POSTURES[8]).learned
    assert trial.observe(POSTURES[9]).reason == "held back, to test updates on it"


def test_an_observation_with_a_saturated_muscle_is_not_held_out() -> None:
    trial = UpdaterTrial(distance=0.0, hold_out=OPTIONS)
    for q in POSTURES[:4]:
        trial.observe(q, tensions=np.full(5, 480.0))
    assert trial.vision.hold_out is not None
    assert not len(trial.vision.hold_out.pairs.noise)


def test_an_update_from_a_wrong_observation_is_undone() -> None:
    """Lengths of one observation are 40 mm off, as if the marker had been seen elsewhere."""
    trial, believing = learned(hold_out=OPTIONS), learned()
    before, memory = trial.learner.map, trial.vision.memory
    wrong = trial.lengths(POSTURES[8]) + 0.04
    given = {"lengths": wrong, "target": wrong, "estimate": POSTURES[8]}

    assert believing.observe(POSTURES[8], **given).learned
    seen = trial.observe(POSTURES[8], **given)

    assert not seen.learned
    assert seen.reason.startswith("undone")
    assert trial.learner.map is before
    assert all(now is then for now, then in zip(trial.vision.memory, memory, strict=True))
    assert trial.vision.dropped[seen.reason] == 1


def test_a_robot_that_changed_is_learned_all_the_same() -> None:
    trial = learned(hold_out=OPTIONS)
    trial.start = shifted(trial.start, 0.04)
    for q in np.tile(POSTURES, (3, 1)):
        trial.observe(q)

    errors = trial.learner.map.lengths(POSTURES) - trial.lengths(POSTURES)
    assert np.sqrt(np.mean(errors**2)) < 0.005

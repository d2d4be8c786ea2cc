"""What the Vision Updater remembers after an episode's begin, a zeroing, a repair and a doubt."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.mapping.learner import Pairs
from jmm_agent.updaters.rest_fitter import FittedRests, RestMemory
from jmm_agent.updaters.vision_memory import EpisodeStart, VisionMemory
from jmm_agent.vision.marker_observation import MarkerObservation
from jmm_agent.vision.observation_fit import ObservationFit
from jmm_agent.vision.rest_fit import Rest

ANGLES = np.arange(6.0).reshape(3, 2)
LENGTHS = 0.1 * np.arange(1.0, 13.0).reshape(3, 4)
TENSIONS = np.full(4, 50.0)


def observed(number: int) -> MarkerObservation:
    return MarkerObservation(np.eye(4), LENGTHS[number], ANGLES[number], tensions=TENSIONS)


@pytest.fixture
def memory() -> VisionMemory:
    """Two observations of a robot of two joints and four muscles, and one rest."""
    pairs = Pairs(ANGLES[:2], LENGTHS[:2], np.full(2, 1e-3))
    rest = Rest(LENGTHS[2], TENSIONS, ANGLES[2])
    zeros = np.zeros((2, 4))
    return VisionMemory(
        [observed(0), observed(1)],
        list(LENGTHS[:2]),
        [True, False],
        ANGLES[:2],
        zeros,
        pairs,
        EpisodeStart(1, zeros[:1]),
        rests=RestMemory(zero=np.zeros(2), rests=(rest,)),
    )


def test_a_repaired_muscle_has_another_offset_from_now_on(memory: VisionMemory) -> None:
    after = memory.repaired(2)
    np.testing.assert_array_equal(after.elongated, [[0, 0, 1, 0]] * 2)
    assert after.start is not None
    np.testing.assert_array_equal(after.start.elongated, [[0, 0, 1, 0]])
    assert (after.rests.rests, after.rests.zero is memory.rests.zero) == ((), True)
    assert after.shown.tolist() == [True, True, False, True]
    assert not memory.elongated.any()


def test_lengths_in_doubt_are_unknown_in_all_that_is_remembered(memory: VisionMemory) -> None:
    after = memory.doubted(1)
    parts = [one.lengths for one in (*after.observations, *after.rests.rests)]
    for lengths in (*parts, *after.commands, *after.pairs.lengths):
        assert np.isnan(lengths).tolist() == [False, True, False, False]
    assert after.shown.tolist() == [True, False, True, True]
    assert np.isfinite([one.lengths for one in memory.observations]).all()


def test_a_zeroing_opens_all_offsets_and_ends_the_search_for_one(memory: VisionMemory) -> None:
    after = memory.zeroed(0.3)
    np.testing.assert_array_equal(after.elongated, np.full((2, 4), 0.3))
    assert (after.start, after.rests.rests, after.shown.any()) == (None, (), False)


@pytest.mark.parametrize(("least", "searched"), [(2, True), (3, False)])
def test_an_episode_begins_with_what_is_believed_then(
    memory: VisionMemory, least: int, searched: bool
) -> None:
    after = memory.repaired(2).begun(least)
    assert (after.start is not None, after.rests.rests) == (searched, ())
    if after.start is not None:
        assert after.start.newest == 0
        np.testing.assert_array_equal(after.start.elongated, [[0, 0, 1, 0]] * 2)


def test_the_oldest_observation_is_forgotten_with_its_command(memory: VisionMemory) -> None:
    newest = [observed(1), observed(2)]
    fit = ObservationFit(ANGLES[1:], True, np.zeros((2, 2)))
    found = FittedRests(fit, np.ones((2, 4)), RestMemory())
    after = memory.believed(newest, found, LENGTHS[2], True, 5)
    np.testing.assert_array_equal(after.commands, LENGTHS[1:])
    assert (after.sound, after.rests) == ([False, True], RestMemory())
    assert after.start is not None
    assert after.start.newest == 2
    assert [one.command[0] for one in after.records] == [LENGTHS[1, 0], LENGTHS[2, 0]]


def test_rests_without_all_tensions_are_not_balanced(memory: VisionMemory) -> None:
    unknown = memory.observations[0]._replace(tensions=np.full(4, np.nan))
    angles, tensions = memory._replace(
        observations=[unknown, memory.observations[1]]
    ).balanced_rests()
    np.testing.assert_array_equal(angles, [ANGLES[2], ANGLES[1]])
    np.testing.assert_array_equal(tensions, [TENSIONS] * 2)
    none = VisionMemory.none(2, 4).balanced_rests()
    assert [part.shape for part in none] == [(0, 2), (0, 4)]


def test_a_start_is_before_the_first_of_the_muscles_that_were_elongated_lately() -> None:
    elongated = np.zeros((9, 5))
    elongated[:3] += 0.36  # a zeroing of all, long ago
    elongated[:1, 0] += 1.0
    assert EpisodeStart.before_elongations(elongated, 2) is None
    elongated[:6, 1] += 1.0
    elongated[:7, 3] += 1.0
    assert EpisodeStart.before_elongations(elongated, 1) is None
    found = EpisodeStart.before_elongations(elongated, 2)
    assert found is not None
    assert found.newest == 2  # observations 7 and 8
    np.testing.assert_allclose(found.elongated[:, 0], [1.36, 0.36, 0.36, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(found.elongated[:6, 1], [1.36] * 3 + [1.0] * 3)
    np.testing.assert_allclose(found.elongated[:, 2:], [[0.36] * 3] * 3 + [[0.0] * 3] * 4)
    assert EpisodeStart.before_elongations(elongated, 3) is None  # the zeroing is of lately


def test_an_observation_is_forgotten_with_all_that_belongs_to_it(memory: VisionMemory) -> None:
    drift = memory.rests.drift._replace(ages=np.array([7.0, 0.0]))
    aged = memory._replace(rests=memory.rests._replace(drift=drift))
    for number, kept in ((0, 1), (1, 0)):
        after = aged.without(number)
        assert [one.lengths.tolist() for one in after.observations] == [LENGTHS[kept].tolist()]
        assert [command.tolist() for command in after.commands] == [LENGTHS[kept].tolist()]
        assert after.sound == [aged.sound[kept]]
        np.testing.assert_array_equal(after.angles, ANGLES[kept : kept + 1])
        assert after.elongated.shape == (1, 4)
        assert after.rests.drift.ages.tolist() == [drift.ages[kept]]
        assert after.start is not None
    before = aged.without(0).start
    assert before is not None
    assert (before.newest, before.elongated.shape) == (1, (0, 4))
    since = aged.without(1).start
    assert since is not None
    assert (since.newest, since.elongated.shape) == (0, (1, 4))


def test_a_new_episode_forgets_that_a_pose_was_unexpected(memory: VisionMemory) -> None:
    assert not memory._replace(unexpected=True).begun(5).unexpected

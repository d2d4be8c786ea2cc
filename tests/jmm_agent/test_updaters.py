"""When the updaters fire, what they learn, and what they refuse, on a small map.

The marker of these tests shows three joints by its position and the fourth by a matrix entry.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import BatchOptions, Learner, Pairs, RidgeRule
from jmm_agent.mapping.minibatch import MinibatchRule
from jmm_agent.mapping.prior import MapPrior, PriorOptions
from jmm_agent.updaters import (
    AntagonismOptions,
    AntagonismUpdater,
    Seen,
    VisionOptions,
    VisionUpdater,
)
from jmm_agent.vision.observation_fit import ObservationFitOptions
from tests.jmm_agent.small_map import LIMITS, make_map, postures

MIDDLE = LIMITS.mean(axis=1)
CALM = np.full(5, 50.0)


def picture(q: np.ndarray) -> np.ndarray:
    """Pose (4, 4) of the marker at joint angles (4,) [rad]."""
    pose = np.eye(4)
    pose[:3, 3], pose[3, 0] = q[:3], q[3]
    return pose


def marker_residual(q: np.ndarray, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    error = np.array([*(q[:3] - pose[:3, 3]), q[3] - pose[3, 0], 0.0, 0.0])
    return error, np.eye(6)[:, :4]


class Recorder:
    """The ridge rule, recording its arguments."""

    def __init__(self, prior: MapPrior) -> None:
        self.rule = RidgeRule(prior)
        self.calls: list[tuple[Pairs, Pairs]] = []

    def move(self, current: JointMuscleMap, remembered: Pairs, batch: Pairs) -> JointMuscleMap:
        self.calls.append((remembered, batch))
        return self.rule.move(current, remembered, batch)

    def with_prior(self, prior: MapPrior) -> Recorder:
        self.rule = RidgeRule(prior)
        return self


class UpdaterTrial:
    """Both updaters on one learner, and a robot whose lengths are off by a constant."""

    def __init__(self, rule: Any = None, **options: Any) -> None:
        self.start = make_map(0)
        prior = MapPrior(self.start, postures(100, 8), PriorOptions())
        self.rule = Recorder(prior)
        self.learner = Learner(
            self.start, LIMITS, rule or self.rule, BatchOptions(), np.random.default_rng(0)
        )
        self.vision = VisionUpdater(
            self.learner, prior, marker_residual, LIMITS, VisionOptions(**options)
        )

    def lengths(self, q: np.ndarray) -> np.ndarray:
        return self.start.lengths(q) + 0.01

    def observe(self, q: np.ndarray, **more: Any) -> Seen:
        """Observe a robot that is at ``q``."""
        lengths = self.lengths(q)
        given = {
            "pose": picture(q),
            "estimate": q + 0.05,
            "lengths": lengths,
            "target": lengths,
            "tensions": CALM,
        }
        return self.vision.seen(**(given | more))

    @property
    def state(self) -> tuple[Any, ...]:
        vision = self.vision
        pairs = [part.tobytes() for part in vision.pairs]
        return (self.learner.map, vision.fired, dict(vision.dropped), *pairs)


def test_an_observation_shows_the_joints_and_moves_the_map_towards_the_robot() -> None:
    trial = UpdaterTrial()
    seen = trial.observe(MIDDLE)
    assert seen.learned
    assert seen.reason == ""
    np.testing.assert_allclose(seen.angles, MIDDLE, atol=5e-3)
    np.testing.assert_allclose(seen.error, MIDDLE + 0.05 - seen.angles, atol=1e-12)
    np.testing.assert_allclose(trial.learner.map.lengths(MIDDLE), trial.lengths(MIDDLE), atol=1e-3)
    assert trial.vision.fired == 1


@pytest.mark.parametrize("kind", ["l", "l_target", "min"])
def test_the_pair_holds_the_lengths_that_were_asked_for(kind: str) -> None:
    trial = UpdaterTrial(lengths=kind)
    lengths = trial.lengths(MIDDLE)
    target = lengths + np.array([0.005, -0.005, 0.003, -0.003, 0.0])
    trial.observe(MIDDLE, target=target)
    wanted = {"l": lengths, "l_target": target, "min": np.minimum(lengths, target)}[kind]
    np.testing.assert_array_equal(trial.vision.pairs.lengths, wanted[None])
    _, batch = trial.rule.calls[0]
    np.testing.assert_array_equal(batch.lengths[0], wanted)
    np.testing.assert_allclose(batch.postures[0], MIDDLE, atol=5e-3)
    assert len(batch.postures) == 10


def test_it_fires_only_far_enough_from_its_last_update() -> None:
    trial = UpdaterTrial(distance=0.15)
    assert trial.observe(MIDDLE).learned
    after = trial.learner.map
    near = MIDDLE + np.array([0.06, 0.06, -0.06, 0.06])  # 0.12 rad
    seen = trial.observe(near)
    assert (seen.learned, seen.reason) == (False, "too close to the last update")
    assert trial.learner.map is after
    far = MIDDLE + np.array([0.1, 0.1, -0.1, 0.1])  # 0.2 rad
    assert trial.observe(far).learned
    # The distance is from the last update, not from the first.
    assert trial.observe(MIDDLE).learned
    assert trial.vision.dropped == {"too close to the last update": 1}
    assert trial.vision.fired == 3


def test_an_observation_far_from_the_estimate_is_dropped_and_counted() -> None:
    trial = UpdaterTrial(threshold=0.5)
    for times in (1, 2):
        seen = trial.observe(MIDDLE, estimate=MIDDLE + 0.3)  # 0.6 rad
        assert (seen.learned, seen.reason) == (False, "too far from the estimate")
        assert trial.vision.dropped == {"too far from the estimate": times}
        assert trial.learner.map is trial.start
    assert trial.observe(MIDDLE, estimate=MIDDLE + 0.2).learned  # 0.4 rad


def test_a_pose_that_no_posture_reaches_is_dropped_and_counted() -> None:
    trial = UpdaterTrial()
    seen = trial.observe(MIDDLE, pose=picture(LIMITS[:, 1] + 0.2), estimate=LIMITS[:, 1])
    assert (seen.learned, seen.reason) == (False, "inverse kinematics did not converge")
    assert trial.vision.dropped == {seen.reason: 1}
    assert trial.learner.map is trial.start


def test_bad_observations_leave_no_trace_in_what_is_learned_from_good_ones() -> None:
    clean, spoilt = UpdaterTrial(threshold=0.5), UpdaterTrial(threshold=0.5)
    for q in (MIDDLE, MIDDLE + 0.2, MIDDLE - 0.2):
        spoilt.observe(MIDDLE, estimate=MIDDLE + 0.3, lengths=np.full(5, 0.3))
        spoilt.observe(MIDDLE, pose=picture(LIMITS[:, 1] + 0.2))
        clean.observe(q)
        spoilt.observe(q)
    assert sum(spoilt.vision.dropped.values()) == 6
    for one, other in zip(clean.learner.map.groups, spoilt.learner.map.groups, strict=True):
        np.testing.assert_array_equal(one.W2, other.W2)
        np.testing.assert_array_equal(one.b2, other.b2)


def test_a_saturated_muscle_makes_no_pair() -> None:
    trial = UpdaterTrial(saturation=450.0)
    trial.observe(MIDDLE, tensions=np.array([50.0, 50.0, 451.0, 50.0, 50.0]))
    assert len(trial.vision.pairs.postures) == 0
    for remembered, batch in trial.rule.calls:
        for part in (remembered, batch):
            assert not np.any(np.all(np.abs(part.postures - MIDDLE) < 0.01, axis=1))
    trial.observe(MIDDLE + 0.2, tensions=np.full(5, 449.0))
    np.testing.assert_allclose(trial.vision.pairs.postures, [MIDDLE + 0.2], atol=5e-3)


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("lengths", ["min", "l_target", "l"])
def test_a_joint_at_its_stop_makes_no_pair_of_commands(lengths: str, side: int) -> None:
    """A command is not the length of a posture that a stop holds; a measured length is."""
    trial = UpdaterTrial(stop_margin=0.02, lengths=lengths)
    held = MIDDLE.copy()
    held[2] = LIMITS[2, side]
    trial.observe(held)
    assert len(trial.vision.pairs.postures) == (1 if lengths == "l" else 0)
    if lengths == "l":
        return
    trial.observe(MIDDLE)
    np.testing.assert_allclose(trial.vision.pairs.postures, [MIDDLE], atol=5e-3)


@pytest.mark.parametrize(("fit", "apart"), [("together", 0.0), ("rests", 1e-4)])
def test_an_observation_without_learning_changes_nothing(fit: str, apart: float) -> None:
    """``apart``: earlier observations are held, so that angles differ a little [rad]."""
    learned, asked = UpdaterTrial(fit=fit), UpdaterTrial(fit=fit)
    for trial in (learned, asked):
        trial.observe(MIDDLE)
    before = asked.state
    for q in (MIDDLE, MIDDLE + 0.2):
        seen = asked.observe(q, learn=False)
        assert not seen.learned
    asked.observe(MIDDLE + 0.2, estimate=MIDDLE - 1.0, learn=False)
    assert asked.state[0] is before[0]
    assert asked.state[1:] == before[1:]
    seen = asked.observe(MIDDLE + 0.2, learn=False).angles
    expected = learned.observe(MIDDLE + 0.2).angles
    np.testing.assert_allclose(seen, expected, rtol=0.0, atol=apart)
    assert asked.observe(MIDDLE + 0.2).learned


def test_only_the_newest_observations_are_remembered() -> None:
    trial = UpdaterTrial(observations=ObservationFitOptions(memory=2))
    asked = [MIDDLE, MIDDLE + 0.2, MIDDLE - 0.2]
    for q in asked:
        assert trial.observe(q).learned
    np.testing.assert_allclose(trial.vision.pairs.postures, asked[1:], atol=5e-3)
    np.testing.assert_array_equal(trial.vision.pairs.lengths, [trial.lengths(q) for q in asked[1:]])


def test_earlier_pairs_and_the_other_updaters_are_remembered() -> None:
    trial = UpdaterTrial(fit="together")
    other = Pairs(postures(2, 5), np.full((2, 5), 0.01), np.full(2, 0.02))
    trial.observe(MIDDLE)
    trial.observe(MIDDLE + 0.2, antagonism=other)
    remembered, batch = trial.rule.calls[1]
    np.testing.assert_allclose(remembered.postures[0], MIDDLE, atol=5e-3)
    np.testing.assert_array_equal(remembered.postures[1:], other.postures)
    np.testing.assert_allclose(batch.postures[0], MIDDLE + 0.2, atol=5e-3)


def test_the_papers_rule_learns_too() -> None:
    trial = UpdaterTrial(MinibatchRule(steps=300, rate=0.1), lengths="l_target")

    def missed() -> float:
        return float(np.abs(trial.learner.map.lengths(MIDDLE) - trial.lengths(MIDDLE)).mean())

    before = missed()
    assert trial.observe(MIDDLE).learned
    assert missed() < 0.8 * before


# The Antagonism Updater


def antagonism(trial: UpdaterTrial, **options: Any) -> AntagonismUpdater:
    return AntagonismUpdater(trial.learner, AntagonismOptions(**options))


def test_antagonism_learns_the_estimate_and_the_measured_lengths() -> None:
    trial = UpdaterTrial()
    updater = antagonism(trial, noise=0.02)
    lengths = trial.lengths(MIDDLE)
    remembered = Pairs(postures(1, 5), np.full((1, 5), 0.01), np.full(1, 0.001))
    assert updater.settled(MIDDLE, lengths, remembered)
    given, batch = trial.rule.calls[0]
    np.testing.assert_array_equal(batch.postures[0], MIDDLE)
    np.testing.assert_array_equal(batch.lengths[0], lengths)
    assert (len(batch.noise), batch.noise[0]) == (10, 0.02)
    np.testing.assert_array_equal(given.postures, remembered.postures)
    assert trial.learner.map is not trial.start


def test_antagonism_fires_only_far_enough_from_its_last_update() -> None:
    trial = UpdaterTrial()
    updater = antagonism(trial, distance=0.15)
    none = Pairs.none(4, 5)
    lengths = trial.lengths(MIDDLE)
    assert updater.settled(MIDDLE, lengths, none)
    after = trial.learner.map
    step = np.array([0.06, 0.06, -0.06, 0.06])  # 0.12 rad
    assert not updater.settled(MIDDLE + step, lengths, none)
    assert trial.learner.map is after
    assert updater.settled(MIDDLE + 2 * step, lengths, none)
    assert not updater.settled(MIDDLE + step, lengths, none)
    assert updater.settled(MIDDLE, lengths, none)
    assert updater.fired == 3


def test_antagonism_remembers_its_newest_pairs() -> None:
    trial = UpdaterTrial()
    updater = antagonism(trial, memory=2)
    asked = [MIDDLE, MIDDLE + 0.2, MIDDLE - 0.2, MIDDLE]
    for q in asked:
        updater.settled(q, trial.lengths(q), Pairs.none(4, 5))
    np.testing.assert_array_equal(updater.pairs.postures, asked[2:])
    remembered, _ = trial.rule.calls[3]
    np.testing.assert_array_equal(remembered.postures, asked[1:3])


def test_an_estimate_that_is_changed_afterwards_does_not_change_the_memory() -> None:
    trial = UpdaterTrial()
    updater = antagonism(trial)
    estimate, lengths = MIDDLE.copy(), trial.lengths(MIDDLE)
    updater.settled(estimate, lengths, Pairs.none(4, 5))
    estimate += 1.0
    lengths += 1.0
    assert not updater.settled(MIDDLE, trial.lengths(MIDDLE), Pairs.none(4, 5))
    np.testing.assert_array_equal(updater.pairs.postures, [MIDDLE])
    np.testing.assert_array_equal(updater.pairs.lengths, [trial.lengths(MIDDLE)])


def test_defaults_are_whole() -> None:
    options = VisionOptions()
    assert options.lengths is None
    assert replace(options, lengths="l_target").lengths == "l_target"


def test_observations_alone_are_learned_one_by_one() -> None:
    """As in the paper, a new observation does not change the joint angles of earlier ones."""
    trial = UpdaterTrial(fit="alone")
    first = trial.observe(MIDDLE)
    kept = trial.vision.pairs.postures[0].copy()
    second = trial.observe(MIDDLE + 0.2)
    assert first.learned
    assert second.learned
    np.testing.assert_array_equal(trial.vision.pairs.postures[0], kept)
    np.testing.assert_allclose(second.angles, MIDDLE + 0.2, atol=5e-3)

"""The whole loop on the elbow: estimate, settle, learn, command. The error falls by learning only.

In place of a camera the test hands the true elbow angle with 0.5 deg of noise to the Vision
Updater, as a pose that shows this one angle.
"""

from __future__ import annotations

from typing import NamedTuple

import gymnasium as gym
import numpy as np
import pytest

from jmm_agent.kalman_filter import JointEstimator
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import BatchOptions, Learner, RidgeRule
from jmm_agent.mapping.prior import MapPrior, PriorOptions
from jmm_agent.mapping.recipe import Recipe
from jmm_agent.mapping.training import train
from jmm_agent.nominal_model import NominalModel
from jmm_agent.settling import SettlingDetector, SettlingOptions
from jmm_agent.updaters import (
    AntagonismOptions,
    AntagonismUpdater,
    VisionOptions,
    VisionUpdater,
)
from jmm_agent.vision.observation_fit import ObservationFitOptions
from kengoro.trained_maps import nominal_model
from kengoro_env.assets import asset_path
from kengoro_env.env import KengoroEnv

SEED = 5
PERIOD = 0.02
POSTURES = np.radians([20, 80, 45, 95, 30, 65, 90, 15, 55, 75, 35])
TESTED = np.radians([25, 85, 50, 70, 40])
NOISE = np.radians(0.5)


class Outcome(NamedTuple):
    """Target - true [deg] at the tested angles before and after learning, estimate - true after.

    And how often the Vision and the Antagonism Updater fired.
    """

    before: float
    after: float
    estimate: float
    seen: int
    fired: int


@pytest.fixture(scope="module")
def nominal() -> NominalModel:
    return nominal_model(asset_path("mjcf/kengoro_arm/elbow.xml"))


@pytest.fixture(scope="module")
def nominal_map(nominal: NominalModel) -> JointMuscleMap:
    return train(nominal, 0, Recipe(hidden=100, samples=3000, steps=400))[0]


def residual(q: np.ndarray, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Error and Jacobian of an angle against a "pose" that holds it at [0, 3]."""
    slope = np.zeros((6, 1))
    slope[0] = 1.0
    return slope[:, 0] * (q[0] - pose[0, 3]), slope


class Loop:
    """A robot and a mind for one joint."""

    def __init__(self, nominal: NominalModel, nominal_map: JointMuscleMap, learning: bool) -> None:
        env = gym.make("Kengoro/Elbow-v0", robot_seed=SEED).unwrapped
        assert isinstance(env, KengoroEnv)
        self.env = env
        limits = np.column_stack([nominal.lower, nominal.upper])
        rng = np.random.default_rng(SEED)
        prior = MapPrior(nominal_map, rng.uniform(*limits.T, (200, 1)), PriorOptions())
        self.learner = Learner(nominal_map, limits, RidgeRule(prior), BatchOptions(), rng)
        self.antagonism = AntagonismUpdater(self.learner, AntagonismOptions())
        options = VisionOptions(observations=ObservationFitOptions(position_noise=NOISE))
        self.vision = VisionUpdater(self.learner, prior, residual, limits, options)
        self.estimator = JointEstimator(nominal_map, limits)
        self.settling = SettlingDetector(SettlingOptions())
        self.learning, self.steps, self.noise, self.at = learning, 0, rng, 0.5
        self.observation, self.truth = env.reset(seed=SEED, options={"posture": [self.at]})

    def step(self, angle: float) -> bool:
        command = self.learner.map.lengths(np.array([angle]))
        action = self.env.lengths_to_action(command)
        self.observation, _, _, _, self.truth = self.env.step(action)
        self.steps += 1
        lengths = self.observation["lengths"]
        self.estimator.update(lengths, PERIOD)
        settled = self.settling.update(self.steps * PERIOD, lengths)
        if settled and self.learning:
            self.learn(lengths, command)
        return settled

    def learn(self, lengths: np.ndarray, command: np.ndarray) -> None:
        self.antagonism.settled(self.estimator.q, lengths, self.vision.pairs)
        pose = np.eye(4)
        pose[0, 3] = self.truth["joint_angles"][0] + NOISE * self.noise.standard_normal()
        tensions = self.observation["tensions"]
        estimate = self.estimator.q
        self.vision.seen(pose, estimate, lengths, command, tensions, self.antagonism.pairs)
        self.estimator.set_map(self.learner.map)

    def move(self, angle: float) -> tuple[float, float]:
        """Go to an angle and rest there; target - true and estimate - true [deg]."""
        start, settled = self.at, False
        for step in range(200):
            share = min(1.0, (step + 1) / 60)
            settled |= self.step(start + share * (angle - start))
            if settled and step > 90:
                break
        self.at = angle
        true = self.truth["joint_angles"][0]
        return float(np.degrees(angle - true)), float(np.degrees(self.estimator.q[0] - true))

    def test(self) -> np.ndarray:
        """Root mean squares (2,) [deg] of what `move` gives at the tested angles, learning off."""
        learning, self.learning = self.learning, False
        errors = np.array([self.move(angle) for angle in TESTED])
        self.learning = learning
        return np.sqrt(np.mean(errors**2, axis=0))


def run(nominal: NominalModel, nominal_map: JointMuscleMap, learning: bool) -> Outcome:
    loop = Loop(nominal, nominal_map, learning)
    before, _ = loop.test()
    for angle in POSTURES:
        loop.move(angle)
    after, estimate = loop.test()
    loop.env.close()
    return Outcome(before, after, estimate, loop.vision.fired, loop.antagonism.fired)


def test_the_error_falls_to_a_third_by_learning(
    nominal: NominalModel, nominal_map: JointMuscleMap
) -> None:
    outcome = run(nominal, nominal_map, learning=True)
    assert outcome.before > 6.0
    assert outcome.seen >= 8
    assert outcome.fired >= 5
    assert outcome.after < outcome.before / 3
    assert outcome.estimate < outcome.before / 3


def test_without_learning_the_error_stays(
    nominal: NominalModel, nominal_map: JointMuscleMap
) -> None:
    outcome = run(nominal, nominal_map, learning=False)
    assert (outcome.seen, outcome.fired) == (0, 0)
    assert outcome.after == pytest.approx(outcome.before, rel=0.1)
    assert outcome.estimate > outcome.before / 2

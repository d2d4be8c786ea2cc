"""Elbow with three muscles, and an agent without camera that learns it (paper, sec. IV-B)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from experiments.harness.errors import ExperimentError
from experiments.robots.conditions import ACTUAL
from jmm_agent.kalman_filter import JointEstimator
from jmm_agent.kalman_filter_options import EstimatorOptions
from jmm_agent.mapping.learner import BatchOptions, Learner, Pairs, RidgeRule, Rule
from jmm_agent.mapping.prior import MapPrior, PriorOptions
from jmm_agent.settling import SettlingDetector, SettlingOptions
from jmm_agent.types import Floats
from jmm_agent.updaters import AntagonismOptions, AntagonismUpdater
from kengoro.robots import NO_END
from kengoro.trained_maps import trained_map
from kengoro_env.assets import asset_path
from kengoro_env.departures import actual, drawing
from kengoro_env.env import KengoroEnv
from kengoro_env.robot.control_period import CONTROL_PERIOD
from kengoro_env.robot.draft import Draft

SCENE = "mjcf/kengoro_arm/elbow.xml"
MUSCLES = ("biceps", "brachialis", "triceps")
AGONISTS, ANTAGONIST = (0, 1), 2
STOPS = EstimatorOptions(limit_margin=0.0)
"""Estimates stay within the joint limits. Beyond full extension the moment arm of the triceps
changes its sign, and an estimate that contradictory lengths have pushed there would not return."""

TYPICAL = 200
"""Number of sampled angles that set the scale of the prior."""


@dataclass(frozen=True)
class Tightened:
    """Departure: all muscles have the same offset of their encoders, which causes co-contraction.

    Attributes:
        length: by how much each muscle is shorter than its encoder reads [m]; negative for longer.
    """

    length: float

    def edit(self, draft: Draft) -> None:
        """Add the length to the offset of each encoder."""
        offset = draft.sensor_errors.length_offset
        for muscle in draft.tendons:
            offset[muscle] = offset.get(muscle, 0.0) + self.length


class Elbow:
    """``Kengoro/Elbow-v0`` with an agent that has an Antagonism Updater only.

    Args:
        condition: `ACTUAL`, or any other text for the robot without departures.
        seed: of the robot and of random samples.
        tightened: length of `Tightened` [m].
        cache: folder of trained maps.
        rule: update rule of the map; the ridge rule if left out.
        learning: whether the agent learns.

    Raises:
        ExperimentError: the environment has other muscles than `MUSCLES`.
    """

    def __init__(
        self,
        condition: str,
        seed: int,
        tightened: float,
        cache: Path | None,
        rule: Rule | None = None,
        learning: bool = True,
    ) -> None:
        departures = (actual(seed) if condition == ACTUAL else drawing()) + (Tightened(tightened),)
        env = gym.make("Kengoro/Elbow-v0", departures=departures, max_episode_steps=NO_END)
        if not isinstance(env.unwrapped, KengoroEnv) or env.unwrapped.muscles != MUSCLES:
            raise ExperimentError(f"The elbow needs the muscles {', '.join(MUSCLES)}.")
        self.world = env.unwrapped
        start = trained_map(cache, scene=asset_path(SCENE))
        robot, rng = self.world.robot, np.random.default_rng([seed, 2])
        limits = np.column_stack([robot.lower, robot.upper])
        typical = rng.uniform(robot.lower, robot.upper, (TYPICAL, 1))
        prior = MapPrior(start, typical, PriorOptions())
        self.learner = Learner(start, limits, rule or RidgeRule(prior), BatchOptions(), rng)
        self._antagonism = AntagonismUpdater(self.learner, AntagonismOptions())
        self._none = Pairs.none(1, len(MUSCLES))
        self._estimator = JointEstimator(start, limits, STOPS)
        self._settling = SettlingDetector(SettlingOptions())
        self.learning, self._steps = learning, 0
        self.at = 0.0
        """Angle of the last command [rad]."""
        self._observation, self._truth = self.world.reset(seed=seed, options={"posture": [self.at]})

    @property
    def true(self) -> float:
        """True angle [rad]."""
        return float(self._truth["joint_angles"][0])

    @property
    def estimate(self) -> float:
        """Estimated angle [rad]."""
        return float(self._estimator.q[0])

    @property
    def fired(self) -> int:
        """Number of updates of the map."""
        return self._antagonism.fired

    def go(self, angle: float, move: float, hold: float) -> Floats:
        """Move to an angle and hold it.

        Args:
            angle: of the elbow [rad].
            move: duration of the movement [s].
            hold: time at the angle after it [s].

        Returns:
            True tensions at each control step, shape (K, 3) [N].
        """
        moving, holding = round(move / CONTROL_PERIOD), round(hold / CONTROL_PERIOD)
        start, tensions = self.at, []
        for step in range(moving + holding):
            share = min(1.0, (step + 1) / moving)
            share *= share * (3.0 - 2.0 * share)
            self._step(start + share * (angle - start))
            tensions.append(self.world.robot.tensions)
        self.at = angle
        return np.array(tensions)

    def _step(self, angle: float) -> None:
        command: Any = self.learner.map.lengths(np.array([angle]))
        step = self.world.step(self.world.lengths_to_action(command))
        self._observation, self._truth = step[0], step[-1]
        self._steps += 1
        lengths = self._observation["lengths"]
        self._estimator.update(lengths, CONTROL_PERIOD)
        settled = self._settling.update(self._steps * CONTROL_PERIOD, lengths)
        if (
            settled
            and self.learning
            and self._antagonism.settled(self._estimator.q, lengths, self._none)
        ):
            self._estimator.set_map(self.learner.map)

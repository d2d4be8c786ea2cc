"""The elbow with its three wires, and a mind that feels it but has no eyes (paper, sec. IV-B)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from experiments.harness.errors import ExperimentError
from jmm_agent.kalman_filter import JointEstimator
from jmm_agent.kalman_filter_options import EstimatorOptions
from jmm_agent.mapping.learner import BatchOptions, Learner, Pairs, RidgeRule, Rule
from jmm_agent.mapping.prior import MapPrior, PriorOptions
from jmm_agent.settling import SettlingDetector, SettlingOptions
from jmm_agent.types import Floats
from jmm_agent.updaters import AntagonismOptions, AntagonismUpdater
from kengoro.arm import ACTUAL, NO_END
from kengoro.trained_maps import trained_map
from kengoro_env.assets import asset_path
from kengoro_env.departures import actual, drawing
from kengoro_env.env import CONTROL_PERIOD, KengoroEnv
from kengoro_env.robot.draft import Draft

SCENE = "mjcf/kengoro_arm/elbow.xml"
MUSCLES = ("biceps", "brachialis", "triceps")
AGONISTS, ANTAGONIST = (0, 1), 2
STOPS = EstimatorOptions(limit_margin=0.0)
"""An elbow does not bend backwards. Behind its stop the triceps would turn round, and an estimate
that wires which contradict each other have pushed there would not come back."""

TYPICAL = 200
"""Angles that set the scale of the prior."""


@dataclass(frozen=True)
class Tightened:
    """Every wire was zeroed too tight, by the same length: what makes wires fight each other.

    Attributes:
        length: how much shorter each wire is than it reads [m]; negative for looser.
    """

    length: float

    def edit(self, draft: Draft) -> None:
        """Shift the lengths that encoders read."""
        offset = draft.sensor_errors.length_offset
        for muscle in draft.tendons:
            offset[muscle] = offset.get(muscle, 0.0) + self.length


class Elbow:
    """``Kengoro/Elbow-v0`` and a mind with an Antagonism Updater alone.

    Args:
        condition: `ACTUAL`, or any other word for the robot without departures.
        seed: of the robot, and of what is drawn by chance.
        tightened: by how much all wires were zeroed too tight [m].
        cache: folder of trained maps.
        rule: how the map is moved; the ridge rule if left out.
        learning: whether it learns.
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
        drawn = trained_map(cache, scene=asset_path(SCENE))
        robot, rng = self.world.robot, np.random.default_rng([seed, 2])
        limits = np.column_stack([robot.lower, robot.upper])
        typical = rng.uniform(robot.lower, robot.upper, (TYPICAL, 1))
        prior = MapPrior(drawn, typical, PriorOptions())
        self.learner = Learner(drawn, limits, rule or RidgeRule(prior), BatchOptions(), rng)
        self._antagonism = AntagonismUpdater(self.learner, AntagonismOptions())
        self._none = Pairs.none(1, len(MUSCLES))
        self._estimator = JointEstimator(drawn, limits, STOPS)
        self._settling = SettlingDetector(SettlingOptions())
        self.learning, self._steps = learning, 0
        self.at = 0.0
        """Angle that was last commanded [rad]."""
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
        """How often the map was moved."""
        return self._antagonism.fired

    def go(self, angle: float, move: float, hold: float) -> Floats:
        """Move to an angle [rad] within ``move`` [s] and stay ``hold`` [s]; true tensions (K, 3)
        [N] at each control step."""
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

"""Robot of the can-grasping experiment: trial, control, and tests before and after."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from experiments.robots.conditions import Seen, make_session, robot_of
from jmm_agent.agent import Agent
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from kengoro.agents import make_agent
from kengoro.grasp_trial import GraspTrial, Trial, begin_trial
from kengoro.hand_search import TrialOptions
from kengoro.robots import make_env, shuffled_postures
from kengoro.session import EpisodeEndedError, Session
from kengoro.trained_maps import trained_map
from kengoro.visits import errors, group_joints, no_visits, visit

LOG_PERIOD = 0.2
"""Time between two points of the saved curves [s]."""

SWEEP_DEG = np.arange(-120.0, 31.0, 2.0)
"""Shoulder pitch at which the map is compared before and after, with all other joints at zero."""

Watch = Callable[[Session], None]


class CanRobot:
    """The experiment on one robot.

    The posture set is split in random order: the end is for tests, the rest for learning.

    Args:
        condition: `ACTUAL`, or `NOMINAL` for the robot without departures.
        seed: of the robot and of all random choices.
        options: of the trial.
        tested: number of postures on which the map is tested before and after.
        cache: folder of trained maps.
        seen: what carries no marker; nothing if left out.
    """

    def __init__(
        self,
        condition: str,
        seed: int,
        options: TrialOptions,
        tested: int,
        cache: Path | None,
        seen: Seen | None = None,
    ) -> None:
        self._condition, self.seed, self._options = condition, seed, options
        self.before = trained_map(cache)
        self._seen = seen or Seen()
        self.agent = self._agent()
        self.trial = Trial()
        self.session: Session | None = None
        self._library, self._tested = np.split(shuffled_postures(seed), [-1 - tested])

    def run_trial(self, watch: Watch | None = None, render_mode: str | None = None) -> None:
        """Run the trial: approach the can, learn, and approach again."""
        trial = self._begin(self.agent, watch, render_mode)
        self.session, self.trial = trial.session, trial.run_to_end()
        self.session.env.close()

    def run_control(self) -> bool:
        """Run the control; returns whether the map before learning grasps at the last IK target."""
        plan = self.trial.plan
        if plan is None:
            return False
        agent = self._agent(learning=False)
        control = self._begin(agent)
        try:
            return control.grasp(plan, arrival=0.0)
        except EpisodeEndedError:
            return False
        finally:
            control.session.env.close()

    def _begin(
        self,
        agent: Agent,
        watch: Watch | None = None,
        render_mode: str | None = None,
    ) -> GraspTrial:
        robot_seed = robot_of(self._condition, self.seed)
        hand, can = self._seen.hand, self._seen.can
        env = make_env("CanGrasp", robot_seed, hand=hand, can=can, render_mode=render_mode)
        return begin_trial(env, agent, self.seed, self._library, self._options, watch)

    def _agent(self, jmm: JointMuscleMap | None = None, learning: bool = True) -> Agent:
        """A new agent with a map, that of the nominal model if left out."""
        jmm = self.before if jmm is None else jmm
        hand = self._seen.detector or self._seen.hand
        return make_agent(self.seed, jmm=jmm, hand=hand, can=self._seen.can, learning=learning)

    def test(self, jmm: JointMuscleMap | None = None) -> dict[str, float]:
        """`errors` of this robot at postures that are not learned from, with learning off.

        Args:
            jmm: map of a new agent; the agent of the trial if left out.
        """
        agent = self.agent if jmm is None else self._agent(jmm)
        agent.learning = False
        start, *targets = self._tested
        session = make_session(self._condition, self.seed, agent, start, self._seen.hand)
        visits = no_visits()
        for target in targets:
            visit(session, target, visits)
        session.env.close()
        return errors(visits)

    def curves(self) -> dict[str, Any]:
        """Curves for the figures, in s, deg, N and mm."""
        if self.session is None:
            raise RuntimeError("the trial has not run")
        log, agent = self.session.log, self.agent
        thin = max(1, round(LOG_PERIOD / (log.time[1] - log.time[0])))
        joints = agent.map.joints
        observations = np.degrees(log.observation_error).reshape(-1, len(joints))
        true = np.degrees(np.array(log.estimate) - np.array(log.true))[::thin]
        shoulder = next(group for group in agent.map.groups if group.name == "shoulder")
        return {
            "time": np.round(log.time[::thin], 2).tolist(),
            "tensions": np.round(log.tensions[::thin], 1).tolist(),
            "true_error": np.round(np.sqrt(np.mean(true**2, axis=1)), 2).tolist(),
            "observation_time": np.round(log.observation_time, 2).tolist(),
            "observation_error": {
                name: np.round(np.sqrt(np.mean(observations[:, own] ** 2, axis=1)), 2).tolist()
                for name, own in group_joints().items()
            },
            "approach_start": [round(approach.start, 2) for approach in self.trial.approaches],
            "pitch": SWEEP_DEG.tolist(),
            "muscles": [agent.map.muscles[i] for i in shoulder.muscle_index],
            "lengths_before": swept_lengths(self.before, shoulder.muscle_index),
            "lengths_after": swept_lengths(agent.map, shoulder.muscle_index),
        }


def swept_lengths(jmm: JointMuscleMap, muscles: np.ndarray) -> list[list[float]]:
    """Lengths of some muscles during shoulder flexion, with a row for each of `SWEEP_DEG` [mm]."""
    postures = np.zeros((len(SWEEP_DEG), len(jmm.joints)))
    postures[:, jmm.joints.index("sh_pitch")] = np.radians(SWEEP_DEG)
    lengths: list[list[float]] = np.round(1e3 * jmm.lengths(postures)[:, muscles], 2).tolist()
    return lengths

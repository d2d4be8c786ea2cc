"""One robot of the can-grasping experiment: trial, control, and tests before and after."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.arm import make_agent, make_env
from experiments.common import trained_map
from experiments.grasp_trial import READY, GraspTrial, Trial, TrialOptions, find_hand
from experiments.session import EpisodeEndedError, Session
from jmm_agent.agent import Agent
from jmm_agent.grasping import GraspPlanner
from kengoro_env.names import GROUP_JOINTS
from kengoro_env.postures import posture_set

Floats = NDArray[np.float64]

MEASURES = (
    "target_true_deg",
    "estimate_true_deg",
    "estimate_target_deg",
    "hand_target_true_mm",
    "hand_estimate_true_mm",
)
TESTED = 8
"""Postures on which the map is tested before and after."""

Watch = Callable[[Session, str], None]


class CanRobot:
    """The experiment on one robot.

    Args:
        seed: of the robot and of all that is drawn; the drawing itself if ``drawn``.
        cache: folder of trained maps.
        drawn: whether the robot is the drawing.
    """

    def __init__(self, seed: int, cache: Path | None, drawn: bool = False) -> None:
        self.seed, self._robot_seed = seed, None if drawn else seed
        self.before = trained_map(cache)
        self.agent = make_agent(self.before, seed)
        self.trial = Trial()
        self.session: Session | None = None

    def run_trial(self, watch: Watch | None = None, render_mode: str | None = None) -> None:
        """Look, reach, miss, learn, grasp."""
        env = make_env("CanGrasp", self._robot_seed, render_mode=render_mode)
        postures = posture_set()

        def tell(session: Session) -> None:
            if watch is not None:
                watch(session, trial.stage)

        self.session = Session(env, self.agent, self.seed, tell, {"posture": np.array(READY)})
        planner = GraspPlanner(self.agent.kinematics, "eye", GROUP_JOINTS["neck"])
        rng = np.random.default_rng([self.seed, 3])
        trial = GraspTrial(self.session, planner, postures, rng)
        self.trial = trial.trial
        try:
            trial.run()
        except EpisodeEndedError as end:
            self.trial.notes.append(f"{trial.stage}: {end}")
        env.close()

    def run_control(self) -> bool:
        """Whether the map before learning grasps the can from the last approach's IK target."""
        plan = self.trial.plan
        if plan is None:
            return False
        agent = make_agent(self.before, self.seed, learning=False)
        env = make_env("CanGrasp", self._robot_seed)
        session = Session(env, agent, self.seed, None, {"posture": np.array(READY)})
        planner = GraspPlanner(agent.kinematics, "eye", GROUP_JOINTS["neck"])
        control = GraspTrial(session, planner, posture_set(), np.random.default_rng(0))
        try:
            return control.grasp(plan)
        except EpisodeEndedError:
            return False
        finally:
            env.close()

    def test(self, agent: Agent) -> dict[str, float]:
        """How well an agent moves this robot to postures that were not learned, learning off.

        Medians over the postures: RMSE of target - true, estimate - true, estimate - target and
        estimate - seen [deg], grip point target - true and estimate - true [mm]; and the largest
        tension [N].
        """
        agent.learning = False
        order = np.random.default_rng([self.seed, 4]).permutation(len(posture_set()))
        start, *targets = posture_set()[order[: 1 + TESTED]]
        env = make_env("Posture", self._robot_seed, max_episode_steps=100_000)
        session = Session(env, agent, self.seed, None, {"posture": start, "target": targets[0]})

        def grip(q: Floats) -> Floats:
            return agent.kinematics.pose("grip", q)[:3, 3]

        rows = []
        for target in targets:
            session.move(target, 2.0, 2.0)
            true, estimate = session.truth["joint_angles"], agent.joint_angles
            angles = [target - true, estimate - true, estimate - target]
            hands = [grip(target) - grip(true), grip(estimate) - grip(true)]
            rows.append(
                [
                    *(np.degrees(np.sqrt(np.mean(error**2))) for error in angles),
                    *(1e3 * np.linalg.norm(error) for error in hands),
                ]
            )
            find_hand(session, target, TrialOptions())
        env.close()
        seen = [np.degrees(np.sqrt(np.mean(error**2))) for error in session.log.look_error]
        result = dict(zip(MEASURES, np.median(rows, axis=0).tolist(), strict=True))
        result["seen_deg"] = float(np.median(seen)) if seen else float("nan")
        result["max_tension_N"] = float(np.max(session.log.tensions))
        return result

"""Can-grasping trial of one robot (paper, sec. IV, last subsection).

The robot finds a can, reaches for it and misses. It moves its hand in view of its camera, learns
and approaches again. If it misses again, it observes its hand near the can, until it grasps the can
and lifts it. After every approach but the last the can is put back where it stood.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from typing import Any

import gymnasium as gym
import numpy as np

from jmm_agent.agent import Agent
from jmm_agent.grasping import GraspPlan, GraspPlanner
from jmm_agent.posture_feedback import FeedbackOptions
from jmm_agent.types import Floats
from jmm_agent.vision.can_finder import CanSkip
from kengoro.hand_search import READY, TrialOptions, find_hand, scan_offsets
from kengoro.session import CLOSED, OPEN, EpisodeEndedError, Session
from kengoro_env.names import GROUP_JOINTS

ARRIVED = 0.003
"""Distance of the estimated grip point from its target at which the fingers close [m]."""


@dataclass
class Approach:
    """One approach to the can.

    Attributes:
        start: when it began [s].
        distance: true distance of the grip point from its target before the fingers close [m].
        can_distance: true distance of the grip point from the can then [m].
        grasped: whether the can was lifted and held.
        target: where the grip point should be, shape (3,) [m].
        max_tension: largest true tension during the approach [N].
    """

    start: float
    distance: float
    can_distance: float
    grasped: bool
    target: Floats
    max_tension: float


@dataclass
class Trial:
    """Result of a trial.

    Attributes:
        approaches: in order.
        postures: number of postures at which the hand was observed.
        notes: why an approach was not made, for people.
        plan: of the last approach; None before the first.
    """

    approaches: list[Approach] = field(default_factory=list)
    postures: int = 0
    notes: list[str] = field(default_factory=list)
    plan: GraspPlan | None = None


class GraspTrial:
    """Runs a trial in a session.

    Args:
        session: of the task CanGrasp.
        planner: with the agent's own kinematics.
        library: postures with the hand in view, shape (N, n) [rad].
        rng: chooses postures.
        options: sizes and durations.
    """

    def __init__(
        self,
        session: Session,
        planner: GraspPlanner,
        library: Floats,
        rng: np.random.Generator,
        options: TrialOptions | None = None,
    ) -> None:
        self.session, self._planner, self._library = session, planner, library
        self._rng, self._options = rng, options or TrialOptions()
        self._can: Floats | None = None
        self.trial = Trial()

    def run(self) -> Trial:
        """Run the trial until a grasp succeeds after learning, or to the last approach.

        A can that is grasped before anything was learned is released, and the trial goes on.
        """
        options = self._options
        for number in range(options.approaches):
            if number == 1:
                self.session.stage = "moves its hand in view"
                self._explore(self._random_postures(options.postures))
            elif number > 1:
                self.session.stage = "observes its hand near the can"
                self._explore(self._near_postures())
            self.session.stage = f"approach {number + 1}"
            grasped = self.approach(options.arrival if number else 0.0)
            if grasped and number > 0:
                break
            self._let_go()
        return self.trial

    def run_to_end(self) -> Trial:
        """Run the trial; a note says why, if the episode ended before."""
        try:
            return self.run()
        except EpisodeEndedError as end:
            self.trial.notes.append(f"{self.session.stage}: {end}")
            return self.trial

    def _explore(self, postures: Sequence[Floats]) -> None:
        for posture in postures:
            self.session.move(posture, self._options.move, self._options.patience)
            find_hand(self.session, posture, self._options)
            self.session.world.put_can_back()
            self.trial.postures += 1

    def _random_postures(self, count: int) -> list[Floats]:
        """Postures of the library, each the farthest from those before among a few samples."""
        chosen: list[Floats] = []
        while len(chosen) < count:
            samples = self._library[self._rng.integers(len(self._library), size=5)]
            nearest = [
                min((float(np.linalg.norm(q - c)) for c in chosen), default=0.0) for q in samples
            ]
            chosen.append(samples[int(np.argmax(nearest))])
        return chosen

    def _near_postures(self) -> list[Floats]:
        """Postures above and beside the can."""
        if self._can is None:
            return self._random_postures(self._options.near)
        postures = []
        for _ in range(self._options.near):
            offset = np.array([-0.05, -0.05, 0.16]) + self._rng.uniform(-0.06, 0.06, 3)
            postures.append(self._planner.hover(self._can, offset, self.session.agent.target))
        return postures

    def _find_can(self) -> Floats | None:
        """Turn the head until the can is in view; the pose of its upper end in the world (4, 4)."""
        agent, options = self.session.agent, self._options
        towards = self._planner.point_camera(np.array(options.table_point), np.array(options.ready))
        self.session.move(towards, options.move)
        for offset in [(0.0, 0.0), *scan_offsets(options)]:
            turned = towards.copy()
            turned[:2] += offset
            self.session.move(turned, options.turn, options.patience)
            pose = self._can_in_view()
            if pose is not None:
                centred = self._planner.point_camera(pose[:3, 3], agent.target)
                self.session.move(centred, options.turn, options.patience)
                again = self._can_in_view()
                return pose if again is None else again
        return None

    def _can_in_view(self) -> Floats | None:
        session = self.session
        still_since = session.time
        session.wait(0.6)  # until a frame has come that was taken at rest
        if session.readings.frame_time < still_since:
            return None
        agent = session.agent
        found = agent.detect_can(session.readings)
        if isinstance(found, CanSkip):
            return None
        return self._planner.marker_in_world(found.pose_can_in_camera, agent.joint_angles)

    def approach(self, arrival: float) -> bool:
        """Find the can and `grasp` it; a note says why, if no approach was made.

        Args:
            arrival: see `grasp`.
        """
        session = self.session
        self._can = pose = self._find_can()
        if pose is None:
            self.trial.notes.append(f"{session.stage}: the can was not found")
            return False
        plan = self._planner.plan(pose, session.agent.target)
        if not plan.reachable:
            self.trial.notes.append(
                f"{session.stage}: not made, the can is out of reach by {1e3 * plan.worst:.0f} mm"
            )
            return False
        self.trial.plan = plan
        return self.grasp(plan, arrival)

    def _let_go(self) -> None:
        """Open the hand and retract it; the can is put back."""
        session, options = self.session, self._options
        session.fingers = OPEN
        session.wait(0.5)
        session.move(np.array(options.ready), options.move)
        session.world.put_can_back()

    def grasp(self, plan: GraspPlan, arrival: float) -> bool:
        """Reach for the can, close the fingers and lift; whether the can was lifted and held.

        Args:
            plan: postures of the approach and of the lift.
            arrival: longest wait until the hand, as estimated, has arrived at the can by feedback
                of the posture [s]; 0: without feedback, as before anything was learned, when
                feedback would only pull at what is wrong.
        """
        session, options = self.session, self._options
        start = session.time
        with _feedback(session.agent) if arrival else nullcontext():
            session.move(plan.approach[0], options.move)
            session.move(plan.approach[1:], options.reach)
            session.wait(0.6)
            self._arrive(plan, arrival)
            approach = self._measure(plan, start)
            self.trial.approaches.append(approach)
            session.fingers = CLOSED
            session.wait(1.0)
            session.move(plan.lift[1:], 1.5)
            session.wait(1.6)
        truth = session.truth  # lifted for long enough, and held to the end
        approach.grasped = bool(truth["success"] and truth["grasped"])
        return approach.grasped

    def _arrive(self, plan: GraspPlan, arrival: float) -> None:
        """Wait until the estimated grip point is at its target; friction may hold it elsewhere."""
        session = self.session
        end = session.time + arrival
        while session.time < end:
            grip = self._planner.grip(session.agent.joint_angles)
            if np.linalg.norm(grip - plan.grip) < ARRIVED:
                break
            session.step()

    def _measure(self, plan: GraspPlan, start: float) -> Approach:
        """True distances before the fingers close; the agent never gets them."""
        truth, log = self.session.truth, self.session.log
        hand = truth["hand_pose"][:3, 3]
        first = int(np.searchsorted(log.time, start))
        return Approach(
            start=start,
            distance=float(np.linalg.norm(hand - plan.grip)),
            can_distance=float(np.linalg.norm(hand - truth["can_pose"][:3, 3])),
            grasped=False,
            target=plan.grip,
            max_tension=float(np.max(log.tensions[first:])),
        )


@contextmanager
def _feedback(agent: Agent) -> Iterator[None]:
    """Within this context the agent's posture has feedback, its own or the default's."""
    before = agent.feedback
    agent.feedback = before or FeedbackOptions()
    try:
        yield
    finally:
        agent.feedback = before


def begin_trial(
    env: gym.Env[Any, Any],
    agent: Agent,
    seed: int,
    library: Floats,
    options: TrialOptions | None = None,
    watch: Callable[[Session], None] | None = None,
) -> GraspTrial:
    """Begin the trial of a robot, with the can where the seed puts it.

    Args:
        env: of the task CanGrasp.
        agent: moves the robot.
        seed: of the episode and of the chosen postures.
        library: postures with the hand in view, shape (N, n) [rad].
        options: sizes and durations.
        watch: called with the session after each step.
    """
    session = Session(env, agent, seed, watch, {"posture": np.array(READY)})
    planner = GraspPlanner(agent.kinematics, "eye", GROUP_JOINTS["neck"])
    return GraspTrial(session, planner, library, np.random.default_rng([seed, 3]), options)


def outcome_sentences(
    distances: Sequence[float], grasped: Sequence[bool], observations: int, duration: float
) -> list[str]:
    """Result of a trial in three sentences, or in one if there was no approach.

    Args:
        distances: of the grip point from its target before the fingers close, in each approach [m].
        grasped: whether the can was lifted, in each approach.
        observations: number of marker observations from which the agent learned.
        duration: from the first approach to the last [s].
    """
    if not distances:
        return ["The robot made no approach to the can."]
    first = "grasped the can by chance" if grasped[0] else "missed the can"
    last = "grasped and lifted the can" if grasped[-1] else "missed the can again"
    return [
        f"In its first approach the robot {first}: its hand was {1e3 * distances[0]:.0f} mm off.",
        f"It then learned from {observations} observations of its hand in {duration:.0f} s.",
        f"In approach {len(distances)} it {last}, with its hand {1e3 * distances[-1]:.0f} mm off.",
    ]

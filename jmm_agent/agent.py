"""The mind: lengths and frames in, target lengths out; it learns while moving (sec. III-A).

One control step estimates the joints, fires the updaters that are due, and commands the next point
on the way to the target posture through the joint-muscle mapping.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import Fault
from jmm_agent.guard.guard import Guard
from jmm_agent.kalman_filter import JointEstimator
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Learner, RidgeRule, Rule
from jmm_agent.mapping.prior import MapPrior
from jmm_agent.observation import SensorReadings
from jmm_agent.options import AgentOptions
from jmm_agent.settling import SettlingDetector
from jmm_agent.trajectory import Trajectory
from jmm_agent.types import Floats
from jmm_agent.updaters import (
    AntagonismMemory,
    AntagonismUpdater,
    Seen,
    VisionMemory,
    VisionUpdater,
)
from jmm_agent.vision.marker_detector import Detector, MarkerPose, Skip
from jmm_agent.vision.marker_residual import MarkerResidual

__all__ = ["Agent", "AgentOptions"]

PERIOD = 0.02
"""Control period [s]."""

WAKING = 50
"""Estimates of the first lengths before the first command."""


class Learned(NamedTuple):
    """What was learned until a time [s]: the map, and what both updaters remember."""

    time: float
    map: JointMuscleMap
    antagonism: AntagonismMemory
    vision: VisionMemory


class Agent:
    """Estimates, learns and commands.

    Args:
        drawn: the map trained on the drawing.
        kinematics: of the same joints, in the map's order.
        detector: finds markers in frames; None for an agent without eyes.
        typical: postures (N, n) [rad] that set the scale of the prior.
        start: joint angles (n,) [rad] it believes to start from.
        rng: draws rehearsal pairs.
        rule: how the map is moved; the ridge rule if left out.
        guard: names faults, keeps them from being learned and commands within the motors' limit;
            without one every reading must be a number, and all are believed.
    """

    def __init__(
        self,
        drawn: JointMuscleMap,
        kinematics: ArmKinematics,
        detector: Detector | None,
        typical: Floats,
        start: Floats,
        rng: np.random.Generator,
        options: AgentOptions | None = None,
        rule: Rule | None = None,
        guard: Guard | None = None,
    ) -> None:
        if kinematics.joints != drawn.joints:
            raise AgentError(
                f"Agent: the kinematics' joints {kinematics.joints} are not the map's "
                f"{drawn.joints}."
            )
        self.options = options = options or AgentOptions()
        self.kinematics, self._detector, self.guard = kinematics, detector, guard
        prior = MapPrior(drawn, typical, options.prior)
        sight = MarkerResidual(kinematics, options.camera, options.marker_site)
        self.learner = Learner(
            drawn, kinematics.limits, rule or RidgeRule(prior), options.batch, rng
        )
        self.antagonism = AntagonismUpdater(self.learner, options.antagonism)
        self.vision = VisionUpdater(self.learner, prior, sight, kinematics.limits, options.vision)
        self._settling = SettlingDetector(options.settling)
        self.estimator = JointEstimator(drawn, kinematics.limits, options.estimator, start)
        self._trajectory = Trajectory(np.array([start, start]), 0.0, 0.0)
        self._time = -np.inf
        self._target_lengths = drawn.lengths(start)
        self._asked = drawn, start.copy(), self._target_lengths
        self._observation_due = False
        self._frame_time = -np.inf
        self._before: deque[Learned] = deque()
        self.taken_back = 0
        """How often something was unlearned that was learned just before a fault was noticed."""
        self.learning = True
        """False while the agent is tested: it looks, but nothing is learned or remembered."""
        self.hand_is_free = True
        """False while the hand holds or touches something: the map is then left alone, since it
        holds only where no forces but gravity act (sec. I)."""
        self.seen: Seen | None = None
        """What the newest look brought; None before the first."""
        self.markers: dict[int, MarkerPose] = {}
        """Markers in the newest frame that was looked at, by id."""

    @property
    def map(self) -> JointMuscleMap:
        """The joint-muscle mapping as learned so far."""
        return self.learner.map

    @property
    def joint_angles(self) -> Floats:
        """Estimated joint angles (n,) [rad]."""
        return self.estimator.q

    @property
    def target(self) -> Floats:
        """Joint angles (n,) [rad] at the end of the way."""
        return self._trajectory.points[-1]

    @property
    def at_rest(self) -> bool:
        """Whether the lengths have settled and nothing waits to be learned from them."""
        return np.isfinite(self._settling.since) and not self._observation_due

    @property
    def faults(self) -> list[Fault]:
        """What is wrong now, in the order in which it was noticed; nothing without a guard."""
        return [] if self.guard is None else list(self.guard.faults)

    def begin_episode(self) -> None:
        """Forget where the arm was, as before a new episode; keep what was learned."""
        if self.guard is not None:
            self.guard.reset()
        self._before.clear()
        self._time = self._frame_time = -np.inf
        self._settling.reset()
        self._observation_due = False
        self.markers, self.seen = {}, None
        self._trajectory = Trajectory(np.array([self.target, self.target]), 0.0, 0.0)
        self.estimator.reset(self.target)

    def go(self, postures: Floats, duration: float) -> None:
        """Move through postures (K, n) or to one (n,) [rad] within ``duration`` [s].

        Before the first step of an episode the way begins where the arm is found then.

        Raises:
            AgentError: a posture is not finite or of the wrong shape, or there is none, or the
                duration is negative or not finite.
        """
        points = np.atleast_2d(np.asarray(postures, dtype=float))
        if (
            points.shape[1:] != self.target.shape
            or len(points) == 0
            or not np.isfinite(points).all()
        ):
            raise AgentError(
                f"Agent: postures must be finite angles of {len(self.target)} joints, got shape "
                f"{points.shape}."
            )
        if not 0.0 <= duration < np.inf:
            raise AgentError(f"Agent: a duration must be finite and not negative: {duration} s.")
        low, high = self.kinematics.limits.T
        way = np.vstack([self._trajectory.at(self._time), np.clip(points, low, high)])
        self._trajectory = Trajectory(way, self._time, duration)

    def step(self, readings: SensorReadings) -> Floats:
        """Target muscle lengths (m,) [m] for the next control period.

        Raises:
            AgentError: senses that are not finite or of the wrong shape, and nothing is changed;
                or a frame of the wrong shape that was to be looked at, and the map stays. A guard
                takes care of readings that are not finite, as long as one length is.
        """
        muscles, guarded = len(self._target_lengths), self.guard is not None
        readings = readings.checked(self._time, muscles, guarded)
        if self.guard is not None:
            readings = self._felt(readings, self.guard)
        if np.isfinite(self._time):
            self.estimator.update(readings.lengths, readings.time - self._time)
        else:
            self._wake(readings)
        self._time = readings.time
        if self.guard is not None:
            self._look_for_faults(readings, self.guard)
        if self.faults or not self.hand_is_free:
            self._settling.reset()
        elif self._settling.update(readings.time, readings.lengths):
            self._observation_due = self._detector is not None
            self._learn_antagonism(readings)
        if not np.isfinite(self._settling.since):
            self._observation_due = False
        elif self._observation_due and readings.frame_time >= self._settling.since:
            self._observation_due = False
            self._learn_vision(readings)
        target_lengths = self._lengths_at(self._trajectory.at(readings.time))
        if self.guard is not None:
            target_lengths = self.guard.safe(target_lengths)
        self._target_lengths = target_lengths
        return target_lengths

    def _lengths_at(self, q: Floats) -> Floats:
        """The map's lengths (m,) [m] at ``q`` (n,) [rad]: while it is held they stay the same."""
        by, at, lengths = self._asked
        if by is not self.map or not np.array_equal(at, q):
            lengths = self.map.lengths(q)
            self._asked = self.map, q, lengths
        return lengths.copy()

    def _felt(self, readings: SensorReadings, guard: Guard) -> SensorReadings:
        """Senses with readings that can be used; those in doubt are left out of the estimate."""
        period = readings.time - self._time if np.isfinite(self._time) else PERIOD
        command, expected = self._target_lengths, self.estimator.lengths
        felt = guard.feel(period, readings.lengths, readings.tensions, command, expected)
        self.estimator.doubt(felt.doubted)
        return readings._replace(lengths=felt.lengths, tensions=felt.tensions)

    def _look_for_faults(self, readings: SensorReadings, guard: Guard) -> None:
        """Ask all watchers; unlearn what was learned just before something new was noticed."""
        estimate = self.estimator.q
        guard.trust(len(self.vision.memory.observations))
        if self.hand_is_free:
            guard.watch_hand(readings.time, estimate, lambda: self.map.jacobian(estimate))
        else:
            guard.leave_hand()
        if self._detector is not None:
            guard.watch_camera(
                readings.time,
                readings.frame,
                readings.frame_time,
                self._hand_marker,
                self._hand_pose,
            )
        while self._before and readings.time - self._before[0].time > guard.options.take_back:
            self._before.popleft()
        if guard.judge(readings.time) and self._before:
            self._take_back(self._before[0])

    def _hand_marker(self, frame: np.ndarray) -> MarkerPose | Skip:
        """What a frame shows of the hand's marker."""
        assert self._detector is not None
        hand = self.options.hand_marker
        found = self._detector.detect(frame, self._expected_markers())
        return found.poses[hand] if hand in found.poses else found.skips[hand]

    def _hand_pose(self, q: Floats) -> Floats:
        """pose_marker_in_camera (4, 4) of the hand at joint angles (n,) [rad]."""
        options = self.options
        return self.kinematics.pose(options.marker_site, q, relative_to=options.camera)

    def _remember(self) -> None:
        """Keep what is known before something is learned, in case that a fault is noticed."""
        if self.guard is not None and self.learning:
            memories = self.antagonism.memory, self.vision.memory
            self._before.append(Learned(self._time, self.map, *memories))

    def _take_back(self, before: Learned) -> None:
        """Unlearn what was learned since."""
        self.recall(before.map, before.antagonism, before.vision)
        self._before.clear()
        self.taken_back += 1

    def recall(
        self, jmm: JointMuscleMap, antagonism: AntagonismMemory, vision: VisionMemory
    ) -> None:
        """Know what was known at another time: the map, and what both updaters remembered."""
        self.learner.map = jmm
        self.antagonism.memory, self.vision.memory = antagonism, vision
        self._map_moved()

    def _map_moved(self) -> None:
        """Let estimator and guard follow the map."""
        self.estimator.set_map(self.map)
        if self.guard is not None:
            self.guard.map_changed()

    def _wake(self, readings: SensorReadings) -> None:
        """Find out where the arm is, and stay there or begin the way that was asked for."""
        for _ in range(WAKING):
            self.estimator.update(readings.lengths, PERIOD)
        here = self.estimator.q
        asked = self._trajectory.points[1:] if self._trajectory.start == self._time else here[None]
        self._trajectory = Trajectory(
            np.vstack([here, asked]), readings.time, self._trajectory.duration
        )

    def look(self, readings: SensorReadings) -> dict[int, MarkerPose]:
        """Markers in the newest frame, by id; empty without a frame."""
        new = readings.frame_time != self._frame_time
        if self._detector is not None and readings.frame is not None and new:
            self.markers = self._detector.detect(readings.frame, self._expected_markers()).poses
            self._frame_time = readings.frame_time
        return self.markers

    def _expected_markers(self) -> dict[int, Floats]:
        return {self.options.hand_marker: self._hand_pose(self.estimator.q)}

    def _learn_antagonism(self, readings: SensorReadings) -> None:
        if not (self.learning and self.options.learn_antagonism):
            return
        self._remember()
        if self.antagonism.settled(self.estimator.q, readings.lengths, self.vision.pairs):
            self._map_moved()

    def _learn_vision(self, readings: SensorReadings) -> None:
        marker = self.look(readings).get(self.options.hand_marker)
        if marker is None:
            if self.learning:
                self.vision.drop("the hand's marker was not seen")
            return
        self._remember()
        estimate = self.estimator.q
        self.seen = self.vision.seen(
            marker.pose_marker_in_camera,
            estimate,
            readings.lengths,
            self._target_lengths,
            readings.tensions,
            self.antagonism.pairs if self.options.learn_antagonism else None,
            learn=self.learning and self.options.learn_vision,
        )
        if self.seen.learned:
            self._map_moved()

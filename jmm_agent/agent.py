"""Agent: sensor readings in, target muscle lengths out; it learns while it moves (sec. III).

One control step

1. filters the readings (`Guard.filter`),
2. estimates the joint angles (`JointEstimator`, sec. II-D),
3. names faults (`Guard.watch`); after a new one, what was learned just before is taken back,
4. learns, if the lengths have settled: the Antagonism Updater at once (sec. III-B), the Vision
   Updater from the first frame that was taken at rest (sec. III-C),
5. maps the next point of the trajectory to muscle lengths and limits them (`Guard.limit`).

Sections are those of Kawaharazuka et al. 2018.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.guard.arm_state import ArmState
from jmm_agent.guard.faults import Fault
from jmm_agent.guard.guard import Guard
from jmm_agent.guard.null_guard import NullGuard
from jmm_agent.kalman_filter import JointEstimator
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Learner, RidgeRule, Rule
from jmm_agent.mapping.prior import MapPrior
from jmm_agent.observation import CONTROL_PERIOD, SensorReadings
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
from jmm_agent.vision.hand_marker import HandMarker
from jmm_agent.vision.marker_detector import Detector, MarkerPose
from jmm_agent.vision.marker_residual import MarkerResidual

__all__ = ["Agent", "AgentOptions"]

START_UPDATES = 50
"""Updates of the estimator with the first lengths, before the first command."""


class Learned(NamedTuple):
    """What was learned until a time [s]: the map, and what both updaters remember."""

    time: float
    map: JointMuscleMap
    antagonism: AntagonismMemory
    vision: VisionMemory


class Agent:
    """Estimates joint angles, learns the joint-muscle mapping and commands muscle lengths.

    Args:
        nominal_map: the map that was trained on the nominal model.
        kinematics: of the same n joints, in the map's order.
        detector: finds markers in frames; None for an agent without a camera.
        typical: postures (N, n) [rad] that set the scale of the prior.
        start: joint angles (n,) [rad] at which it believes to start.
        rng: samples rehearsal pairs.
        options: of the agent and its parts; the defaults if left out.
        rule: how the map is moved by what is learned; the ridge rule if left out.
        guard: names faults, keeps them from being learned, and limits commands. Without one all
            readings are believed, and readings that are not finite are refused.

    Attributes:
        guard: as given, or a `NullGuard`; may be replaced before an episode begins.
        learner: holds the map.
        antagonism: the Antagonism Updater.
        vision: the Vision Updater.
        estimator: estimates the joint angles.
        learning: whether anything is learned. While False, marker observations are evaluated, but
            neither learned nor remembered.
        hand_is_free: False while the hand holds or touches something. The map is then left alone,
            because it holds only while no forces but gravity act (sec. I).
        taken_back: number of times that something was unlearned because it had been learned just
            before a fault was noticed.
        seen: result of the newest marker observation; None before the first.
        markers: markers in the newest frame in which they were detected, by id.

    Raises:
        AgentError: kinematics and map have different joints, or a frame of the options is unknown.
    """

    def __init__(
        self,
        nominal_map: JointMuscleMap,
        kinematics: ArmKinematics,
        detector: Detector | None,
        typical: Floats,
        start: Floats,
        rng: np.random.Generator,
        options: AgentOptions | None = None,
        rule: Rule | None = None,
        guard: Guard | None = None,
    ) -> None:
        if kinematics.joints != nominal_map.joints:
            raise AgentError(
                f"Agent: the kinematics' joints {kinematics.joints} are not the map's "
                f"{nominal_map.joints}."
            )
        self.options = options = options or AgentOptions()
        self.kinematics = kinematics
        self.guard: Guard | NullGuard = NullGuard() if guard is None else guard
        limits, camera, site = kinematics.limits, options.camera, options.marker_site
        prior = MapPrior(nominal_map, typical, options.prior)
        residual = MarkerResidual(kinematics, camera, site)
        self._marker = (
            None
            if detector is None
            else HandMarker(detector, kinematics, options.hand_marker, camera, site)
        )
        self.learner = Learner(nominal_map, limits, rule or RidgeRule(prior), options.batch, rng)
        self.antagonism = AntagonismUpdater(self.learner, options.antagonism)
        self.vision = VisionUpdater(self.learner, prior, residual, limits, options.vision)
        self._settling = SettlingDetector(options.settling)
        self.estimator = JointEstimator(nominal_map, limits, options.estimator, start)
        self._trajectory = Trajectory(np.array([start, start]), 0.0, 0.0)
        self._time = -np.inf
        self._target_lengths = nominal_map.lengths(start)
        self._mapped = nominal_map, start.copy(), self._target_lengths
        self._observation_due = False
        self._frame_time = -np.inf
        self._before: deque[Learned] = deque()
        self.taken_back = 0
        self.learning = True
        self.hand_is_free = True
        self.seen: Seen | None = None
        self.markers: dict[int, MarkerPose] = {}

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
        """Joint angles (n,) [rad] at the end of the trajectory."""
        return self._trajectory.points[-1]

    @property
    def at_rest(self) -> bool:
        """Whether the lengths have settled and nothing remains to be learned from them."""
        return np.isfinite(self._settling.since) and not self._observation_due

    @property
    def faults(self) -> list[Fault]:
        """Faults that are found now, in the order in which they were noticed."""
        return list(self.guard.faults)

    def begin_episode(self) -> None:
        """Forget the state of the arm, as before a new episode; keep what was learned."""
        self.guard.reset()
        self._before.clear()
        self._time = self._frame_time = -np.inf
        self._settling.reset()
        self._observation_due = False
        self.markers, self.seen = {}, None
        self._trajectory = Trajectory(np.array([self.target, self.target]), 0.0, 0.0)
        self.estimator.reset(self.target)

    def go(self, postures: Floats, duration: float) -> None:
        """Move through postures within a time.

        Before the first step of an episode the trajectory begins at the first estimate.

        Args:
            postures: joint angles (K, n) [rad] to pass, or the target (n,) [rad] alone; clipped
                into the joint limits.
            duration: of the movement [s].

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
        points = np.vstack([self._trajectory.at(self._time), np.clip(points, low, high)])
        self._trajectory = Trajectory(points, self._time, duration)

    def step(self, readings: SensorReadings) -> Floats:
        """Run one control step.

        Args:
            readings: of m muscles, later than those before.

        Returns:
            Target muscle lengths (m,) [m] for the next control period.

        Raises:
            AgentError: readings that are not finite or of the wrong shape, and nothing is changed;
                or a frame of the wrong shape that was to be evaluated, and the map stays. A guard
                replaces readings that are not finite, as long as one length is finite.
        """
        filtered = self.guard.filter(
            readings, self._time, self._target_lengths, self.estimator.lengths
        )
        self.estimator.doubt(filtered.doubted)
        readings = readings._replace(lengths=filtered.lengths, tensions=filtered.tensions)
        if np.isfinite(self._time):
            self.estimator.update(readings.lengths, readings.time - self._time)
        else:
            self._start(readings)
        self._time = readings.time
        self._watch(readings)
        if self.faults or not self.hand_is_free:
            self._settling.reset()
        elif self._settling.update(readings.time, readings.lengths):
            self._observation_due = self._marker is not None
            self._learn_antagonism(readings)
        if not np.isfinite(self._settling.since):
            self._observation_due = False
        elif self._observation_due and readings.frame_time >= self._settling.since:
            self._observation_due = False
            self._learn_vision(readings)
        target_lengths = self._lengths_at(self._trajectory.at(readings.time))
        self._target_lengths = self.guard.limit(target_lengths)
        return self._target_lengths

    def detect_markers(self, readings: SensorReadings) -> dict[int, MarkerPose]:
        """Markers in the newest frame, by id; empty without a frame.

        Raises:
            AgentError: the frame has a wrong shape or type.
        """
        new = readings.frame_time != self._frame_time
        if self._marker is not None and readings.frame is not None and new:
            self.markers = self._marker.detect(readings.frame, self.estimator.q).poses
            self._frame_time = readings.frame_time
        return self.markers

    def recall(
        self, jmm: JointMuscleMap, antagonism: AntagonismMemory, vision: VisionMemory
    ) -> None:
        """Return to what was learned at another time.

        Args:
            jmm: the map.
            antagonism: what the Antagonism Updater remembered.
            vision: what the Vision Updater remembered.
        """
        self.learner.map = jmm
        self.antagonism.memory, self.vision.memory = antagonism, vision
        self._map_changed()

    def _lengths_at(self, q: Floats) -> Floats:
        """The map's lengths (m,) [m] at ``q`` (n,) [rad], computed again only if either changed."""
        by, at, lengths = self._mapped
        if by is not self.map or not np.array_equal(at, q):
            lengths = self.map.lengths(q)
            self._mapped = self.map, q, lengths
        return lengths.copy()

    def _start(self, readings: SensorReadings) -> None:
        """Estimate where the arm is, and begin the trajectory there, or stay there without one."""
        for _ in range(START_UPDATES):
            self.estimator.update(readings.lengths, CONTROL_PERIOD)
        here = self.estimator.q
        given = self._trajectory.start == self._time
        points = self._trajectory.points[1:] if given else here[None]
        self._trajectory = Trajectory(
            np.vstack([here, points]), readings.time, self._trajectory.duration
        )

    def _watch(self, readings: SensorReadings) -> None:
        """Look for faults; unlearn what was learned just before a new one."""
        state = ArmState(
            self.estimator.q,
            self.map,
            len(self.vision.memory.observations),
            self.hand_is_free,
            self._marker,
        )
        new = self.guard.watch(readings, state)
        while self._before and readings.time - self._before[0].time > self.guard.take_back:
            self._before.popleft()
        if new and self._before:
            earlier = self._before[0]
            self.recall(earlier.map, earlier.antagonism, earlier.vision)
            self._before.clear()
            self.taken_back += 1

    def _remember(self) -> None:
        """Keep what is known before something is learned, in case that a fault is noticed."""
        if self.learning:
            memories = self.antagonism.memory, self.vision.memory
            self._before.append(Learned(self._time, self.map, *memories))

    def _map_changed(self) -> None:
        """Pass a new map to estimator and guard."""
        self.estimator.set_map(self.map)
        self.guard.map_changed()

    def _learn_antagonism(self, readings: SensorReadings) -> None:
        if not (self.learning and self.options.learn_antagonism):
            return
        self._remember()
        if self.antagonism.settled(self.estimator.q, readings.lengths, self.vision.pairs):
            self._map_changed()

    def _learn_vision(self, readings: SensorReadings) -> None:
        marker = self.detect_markers(readings).get(self.options.hand_marker)
        if marker is None:
            if self.learning:
                self.vision.drop("the hand's marker was not seen")
            return
        self._remember()
        self.seen = self.vision.seen(
            marker.pose_marker_in_camera,
            self.estimator.q,
            readings.lengths,
            self._target_lengths,
            readings.tensions,
            self.antagonism.pairs if self.options.learn_antagonism else None,
            learn=self.learning and self.options.learn_vision,
        )
        if self.seen.learned:
            self._map_changed()

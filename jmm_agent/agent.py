"""The mind: lengths and frames in, target lengths out; it learns while moving (sec. III-A).

One control step estimates the joints, fires the updaters that are due, and commands the next point
on the way to the target posture through the joint-muscle mapping.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from jmm_agent.drawing import Floats
from jmm_agent.errors import AgentError
from jmm_agent.estimator import EstimatorOptions, JointEstimator
from jmm_agent.kinematics import ArmKinematics
from jmm_agent.learner import BatchOptions, Learner, RidgeRule, Rule
from jmm_agent.mapping import JointMuscleMap
from jmm_agent.marker import MarkerDetector, MarkerPose
from jmm_agent.prior import MapPrior, PriorOptions
from jmm_agent.settling import SettlingDetector, SettlingOptions
from jmm_agent.sight import MarkerSight
from jmm_agent.updaters import (
    AntagonismOptions,
    AntagonismUpdater,
    Seen,
    VisionOptions,
    VisionUpdater,
)

PERIOD = 0.02
"""Control period [s]."""

WAKING = 50
"""Estimates of the first lengths before the first command."""


class Senses(NamedTuple):
    """What the robot feels and sees at one moment; nothing else reaches the agent.

    Attributes:
        time: now [s].
        lengths: measured muscle lengths (m,) [m].
        tensions: measured muscle tensions (m,) [N].
        frame: newest camera frame (H, W, 3) uint8, or None.
        frame_time: when that frame was taken [s].
    """

    time: float
    lengths: Floats
    tensions: Floats
    frame: np.ndarray | None = None
    frame_time: float = -np.inf


@dataclass(frozen=True)
class AgentOptions:
    """Everything that can be set; the defaults are what the experiments use.

    Attributes:
        learn_antagonism, learn_vision: which updaters run.
        hand_marker, can_marker: ids of the markers.
        camera, marker_site: frames of the kinematics.
        prior, batch, settling, antagonism, vision, estimator: of the parts.
    """

    learn_antagonism: bool = True
    learn_vision: bool = True
    hand_marker: int = 0
    can_marker: int = 1
    camera: str = "eye"
    marker_site: str = "marker_hand"
    prior: PriorOptions = field(default_factory=PriorOptions)
    batch: BatchOptions = field(default_factory=BatchOptions)
    settling: SettlingOptions = field(default_factory=SettlingOptions)
    antagonism: AntagonismOptions = field(default_factory=AntagonismOptions)
    vision: VisionOptions = field(default_factory=VisionOptions)
    estimator: EstimatorOptions = field(default_factory=EstimatorOptions)


class Way(NamedTuple):
    """Joint angles (K, n) [rad] to pass, evenly in time from ``start`` [s] for ``duration`` [s]."""

    points: Floats
    start: float
    duration: float

    def at(self, time: float) -> Floats:
        """Joint angles (n,) [rad] at a time [s]: at rest at both ends."""
        share = np.clip((time - self.start) / self.duration, 0.0, 1.0) if self.duration else 1.0
        place = share * share * (3.0 - 2.0 * share) * (len(self.points) - 1)
        first = min(int(place), len(self.points) - 2)
        return self.points[first] + (place - first) * (self.points[first + 1] - self.points[first])


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
    """

    def __init__(
        self,
        drawn: JointMuscleMap,
        kinematics: ArmKinematics,
        detector: MarkerDetector | None,
        typical: Floats,
        start: Floats,
        rng: np.random.Generator,
        options: AgentOptions | None = None,
        rule: Rule | None = None,
    ) -> None:
        if kinematics.joints != drawn.joints:
            raise AgentError(
                f"Agent: the kinematics' joints {kinematics.joints} are not the map's "
                f"{drawn.joints}."
            )
        self.options = options = options or AgentOptions()
        self.kinematics, self._detector = kinematics, detector
        prior = MapPrior(drawn, typical, options.prior)
        sight = MarkerSight(kinematics, options.camera, options.marker_site)
        self.learner = Learner(
            drawn, kinematics.limits, rule or RidgeRule(prior), options.batch, rng
        )
        self.antagonism = AntagonismUpdater(self.learner, options.antagonism)
        self.vision = VisionUpdater(self.learner, prior, sight, kinematics.limits, options.vision)
        self._settling = SettlingDetector(options.settling)
        self.estimator = JointEstimator(drawn, kinematics.limits, options.estimator, start)
        self._way = Way(np.array([start, start]), 0.0, 0.0)
        self._time = -np.inf
        self._target_lengths = drawn.lengths(start)
        self._look_due = False
        self._frame_time = -np.inf
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
        return self._way.points[-1]

    @property
    def at_rest(self) -> bool:
        """Whether the lengths have settled and nothing waits to be learned from them."""
        return np.isfinite(self._settling.since) and not self._look_due

    def begin_episode(self) -> None:
        """Forget where the arm was, as before a new episode; keep what was learned."""
        self._time = self._frame_time = -np.inf
        self._settling.reset()
        self._look_due = False
        self.markers, self.seen = {}, None
        self._way = Way(np.array([self.target, self.target]), 0.0, 0.0)
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
        way = np.vstack([self._way.at(self._time), np.clip(points, low, high)])
        self._way = Way(way, self._time, duration)

    def step(self, senses: Senses) -> Floats:
        """Target muscle lengths (m,) [m] for the next control period.

        Raises:
            AgentError: senses that are not finite or of the wrong shape, and nothing is changed;
                or a frame of the wrong shape that was to be looked at, and the map stays.
        """
        senses = self._checked(senses)
        if np.isfinite(self._time):
            self.estimator.update(senses.lengths, senses.time - self._time)
        else:
            self._wake(senses)
        self._time = senses.time
        if not self.hand_is_free:
            self._settling.reset()
        elif self._settling.update(senses.time, senses.lengths):
            self._look_due = self._detector is not None
            self._learn_antagonism(senses)
        if not np.isfinite(self._settling.since):
            self._look_due = False
        elif self._look_due and senses.frame_time >= self._settling.since:
            self._look_due = False
            self._learn_vision(senses)
        self._target_lengths = self.map.lengths(self._way.at(senses.time))
        return self._target_lengths

    def _checked(self, senses: Senses) -> Senses:
        """The senses with copies of the numbers, which are kept; `AgentError` if unusable."""
        lengths = self._numbers("lengths", senses.lengths)
        tensions = self._numbers("tensions", senses.tensions)
        if not (np.isfinite(senses.time) and senses.time > self._time):
            raise AgentError(
                f"Agent: time must be finite and later than {self._time} s, got {senses.time} s."
            )
        return senses._replace(lengths=lengths, tensions=tensions)

    def _numbers(self, name: str, value: Floats) -> Floats:
        """A copy of one finite number a muscle; `AgentError` if it is something else."""
        array, shape = np.array(value, dtype=float), self._target_lengths.shape
        if array.shape != shape or not np.isfinite(array).all():
            raise AgentError(
                f"Agent: {name} must be finite and of shape {shape}, got shape {array.shape}."
            )
        return array

    def _wake(self, senses: Senses) -> None:
        """Find out where the arm is, and stay there or begin the way that was asked for."""
        for _ in range(WAKING):
            self.estimator.update(senses.lengths, PERIOD)
        here = self.estimator.q
        asked = self._way.points[1:] if self._way.start == self._time else here[None]
        self._way = Way(np.vstack([here, asked]), senses.time, self._way.duration)

    def look(self, senses: Senses) -> dict[int, MarkerPose]:
        """Markers in the newest frame, by id; empty without a frame."""
        new = senses.frame_time != self._frame_time
        if self._detector is not None and senses.frame is not None and new:
            self.markers = self._detector.detect(senses.frame, self._expected_markers()).poses
            self._frame_time = senses.frame_time
        return self.markers

    def _expected_markers(self) -> dict[int, Floats]:
        options = self.options
        pose = self.kinematics.pose(
            options.marker_site, self.estimator.q, relative_to=options.camera
        )
        return {options.hand_marker: pose}

    def _learn_antagonism(self, senses: Senses) -> None:
        if not (self.learning and self.options.learn_antagonism):
            return
        if self.antagonism.settled(self.estimator.q, senses.lengths, self.vision.pairs):
            self.estimator.set_map(self.map)

    def _learn_vision(self, senses: Senses) -> None:
        marker = self.look(senses).get(self.options.hand_marker)
        if marker is None:
            if self.learning:
                self.vision.drop("the hand's marker was not seen")
            return
        estimate = self.estimator.q
        self.seen = self.vision.seen(
            marker.pose_marker_in_camera,
            estimate,
            senses.lengths,
            self._target_lengths,
            senses.tensions,
            self.antagonism.pairs if self.options.learn_antagonism else None,
            learn=self.learning and self.options.learn_vision,
        )
        if self.seen.learned:
            self.estimator.set_map(self.map)

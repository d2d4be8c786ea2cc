"""Learning from rests: from the lengths when they settle, then from the observed hand.

What keeps the agent from learning is named (`LearningWatch`).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from jmm_agent.guard.faults import Fault
from jmm_agent.hand_observer import HandObservation, HandObserver, Observed
from jmm_agent.learning.job import LearningJob, MapLearning
from jmm_agent.learning.schedule import Schedule
from jmm_agent.learning_watch import LearningWatch, StepState
from jmm_agent.observation import SensorReadings
from jmm_agent.options import AgentOptions
from jmm_agent.settling import SettlingDetector
from jmm_agent.vision.hand_pose import ArmSample


class RestLearning:
    """Learns once from the lengths of each rest, and once from the hand.

    Args:
        learned: the map and both updaters.
        schedule: runs the jobs of learning.
        observer: observes the hand.
        options: of the agent.

    Attributes:
        settling: detects when the lengths settle.
    """

    def __init__(
        self,
        learned: MapLearning,
        schedule: Schedule,
        observer: HandObserver,
        options: AgentOptions,
    ) -> None:
        self._vision, self._schedule, self._observer = learned.vision, schedule, observer
        self._options = options
        self.settling = SettlingDetector(options.settling)
        muscles = learned.learner.map.muscles
        self._watch = LearningWatch(self._vision, self.settling, muscles, options.learning_monitor)

    def reset(self) -> None:
        """Finish learning, and forget the arm, as before a new episode."""
        self._schedule.reset()
        self._observer.reset()
        self._watch.reset()
        self._vision.begin()
        self.settling.reset()

    def restart(self) -> None:
        """Await the next rest, because lengths now mean something else."""
        self.settling.reset()
        self._observer.forget_rest()

    @property
    def done(self) -> bool:
        """Whether the lengths have settled and nothing remains to be learned from them."""
        settled = bool(np.isfinite(self.settling.since))
        return settled and not self._observer.due and not self._schedule.pending

    @property
    def faults(self) -> list[Fault]:
        """Faults of learning that are found now."""
        return self._watch.faults

    def advance(self, step: int, time: float, hand_is_free: bool) -> None:
        """Let the results of a control step enter.

        Args:
            step: number of the step.
            time: of the step [s].
            hand_is_free: whether the map may change.
        """
        self._schedule.advance(step, hand_is_free)
        self._watch.name_zeroing(time)

    def learn(
        self, readings: SensorReadings, sample: ArmSample, trusted: bool, jumped: bool
    ) -> None:
        """Learn in a control step.

        Args:
            readings: of the step.
            sample: state of the arm in it; since when the lengths are at rest is set here.
            trusted: whether the robot has no fault and the hand is free.
            jumped: whether the time stamps jumped.

        Raises:
            AgentError: the frame has a wrong shape or type.
        """
        settled = False
        if trusted and not jumped:
            settled = self.settling.update(readings.time, readings.lengths)
        else:
            self.settling.reset()
        sample = sample._replace(since=self.settling.since)
        if settled:
            self._observer.begin_rest()
            options = self._options
            if self._schedule.enabled and (options.learn_antagonism or options.learn_vision):
                job = _job(sample)._replace(remember=options.learn_vision)
                self._schedule.submit(job)
        self._observer.follow(readings, sample.estimate)
        self._learn_vision(self._observer.observe_pose(sample, trusted))
        self._learn_vision(self._observer.observe_frame(readings, sample))

    def watch(
        self,
        readings: SensorReadings,
        passed: float,
        hand_is_free: bool,
        at_target: bool,
        contradicted: Mapping[str, float],
    ) -> None:
        """Name what keeps the agent from learning.

        Args:
            readings: of a control step in which the robot has no fault.
            passed: duration of the step [s].
            hand_is_free: whether the hand is free.
            at_target: whether the trajectory has ended.
            contradicted: joints whose encoders contradict the lengths, and by how much [rad].
        """
        since, why = self.settling.since, ""
        if self._options.learn_vision and np.isfinite(since):
            why = self._observer.why_unobserved(readings, since)
        seen = self._schedule.seen
        detail = "" if seen is None else seen.detail
        clock = self._observer.clock_problem
        self._watch.update(
            StepState(
                readings.time, passed, hand_is_free, at_target, why, detail, contradicted, clock
            )
        )

    def _learn_vision(self, observed: Observed) -> None:
        """Learn from an observation of the hand, or only evaluate it; count those left out."""
        found = observed.observation
        if found is not None:
            learn = self._schedule.enabled and self._options.learn_vision
            self._schedule.submit(_job(found.sample, found, learn))
        if self._schedule.enabled:
            for reason in observed.dropped:
                self._vision.drop(reason)


def _job(at: ArmSample, found: HandObservation | None = None, learn: bool = True) -> LearningJob:
    """Learning from the lengths of a rest, or from an observation of the hand in it."""
    rest = at.time, at.estimate, at.lengths, at.target, at.tensions
    if found is None:
        return LearningJob("antagonism", *rest, joint_angles=at.joint_angles)
    more = found.frames, found.covariance, at.joint_angles
    return LearningJob("vision", *rest, found.pose, learn, *more)

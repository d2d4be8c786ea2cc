"""Learning jobs: what is learned from one rest, as a function of immutable records.

(`LearnedState`, `LearningJob`) -> `JobResult`. A job gives the same bits wherever it runs.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from typing import Any, Literal, NamedTuple

import numpy as np

from jmm_agent.map_consistency import CONTRADICTED
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Learner
from jmm_agent.types import Floats
from jmm_agent.updaters import (
    AntagonismMemory,
    AntagonismUpdater,
    Seen,
    VisionMemory,
    VisionUpdater,
)
from jmm_agent.updaters.assignment import Assignment, step_between
from jmm_agent.vision.hold_out import HoldOutMemory
from jmm_agent.vision.marker_observation import Frames
from jmm_agent.vision.rest_fit import Rest

_log = logging.getLogger(__name__)


class LearningJob(NamedTuple):
    """One rest from which an updater learns.

    Attributes:
        kind: the updater.
        time: of the readings [s].
        estimate: theta_est (n,) [rad].
        lengths: l (m,) [m].
        target: l_target (m,) [m].
        tensions: (m,) [N].
        pose: measured pose_marker_in_camera (4, 4); None for the Antagonism Updater.
        learn: if False, the observation is only evaluated.
        frames: of the pose, see `MarkerObservation`; as well as ``covariance`` and
            ``joint_angles``.
        covariance: of the pose (6, 6).
        joint_angles: measured joint angles (n,) [rad], NaN where there is no encoder.
        remember: whether the Vision Updater remembers the rest, too.
        assignment: of channels, by which lengths, targets and tensions are ordered, and which
            muscles have been lost.
    """

    kind: Literal["antagonism", "vision"]
    time: float
    estimate: Floats
    lengths: Floats
    target: Floats
    tensions: Floats
    pose: Floats | None = None
    learn: bool = True
    frames: Frames | None = None
    covariance: Floats | None = None
    joint_angles: Floats | None = None
    remember: bool = True
    assignment: Assignment = Assignment()

    def ordered(self, assignment: Assignment) -> LearningJob:
        """The job with lengths, targets and tensions in the order of another wiring."""
        if self.assignment.order == assignment.order:
            return self
        order = step_between(self.assignment, assignment, len(self.lengths))
        return self._replace(
            lengths=self.lengths[order],
            target=self.target[order],
            tensions=self.tensions[order],
            assignment=assignment,
        )


class LearnedState(NamedTuple):
    """All that learning changes.

    Attributes:
        map: the joint-muscle mapping.
        generator: state of the random generator.
        antagonism: what the Antagonism Updater remembers.
        vision: what the Vision Updater remembers.
        hold_out: held-out observations; None if none are held out.
        fired: number of updates of the Antagonism and of the Vision Updater.
    """

    map: JointMuscleMap
    generator: Mapping[str, Any]
    antagonism: AntagonismMemory
    vision: VisionMemory
    hold_out: HoldOutMemory | None
    fired: tuple[int, int]


class JobResult(NamedTuple):
    """What came of a job.

    Attributes:
        state: after the job; None if it failed, or if the observation was only evaluated.
        moved: whether the map was moved.
        seen: result of the marker observation; None for the Antagonism Updater.
        dropped: reasons why the observation was not learned from, and the number of each.
        failure: why the job failed; empty if it did not.
    """

    state: LearnedState | None
    moved: bool = False
    seen: Seen | None = None
    dropped: tuple[tuple[str, int], ...] = ()
    failure: str = ""


class MapLearning:
    """The map and both updaters, which run learning jobs.

    Args:
        learner: holds the map.
        antagonism: of the same learner.
        vision: of the same learner.
        joint: whether the Antagonism Updater learns, and the Vision Updater its pairs, too.

    Attributes:
        learner: as given.
        antagonism: as given.
        vision: as given.
    """

    def __init__(
        self, learner: Learner, antagonism: AntagonismUpdater, vision: VisionUpdater, joint: bool
    ) -> None:
        self.learner, self.antagonism, self.vision = learner, antagonism, vision
        self._joint = joint

    @property
    def state(self) -> LearnedState:
        """All that was learned; may be set to another value."""
        hold_out = self.vision.hold_out
        return LearnedState(
            self.learner.map,
            self.learner.rng.bit_generator.state,
            self.antagonism.memory,
            self.vision.memory,
            None if hold_out is None else hold_out.memory,
            (self.antagonism.fired, self.vision.fired),
        )

    @state.setter
    def state(self, state: LearnedState) -> None:
        self.learner.map = state.map
        self.learner.rng.bit_generator.state = state.generator
        self.antagonism.memory, self.vision.memory = state.antagonism, state.vision
        if self.vision.hold_out is not None and state.hold_out is not None:
            self.vision.hold_out.memory = state.hold_out
        self.antagonism.fired, self.vision.fired = state.fired

    @property
    def spread(self) -> Callable[[Floats], Floats] | None:
        """How far lengths of the map may be off at joint angles (n,) [rad], (m,) [m].

        None if the rule of learning has no prior.
        """
        prior = self.learner.prior
        if prior is None:
            return None
        pairs = self.vision.pairs
        postures, noise = pairs.postures, np.maximum(pairs.noise, prior.options.noise)

        def spread(q: Floats) -> Floats:
            return CONTRADICTED * np.hypot(prior.spread(postures, noise, q), prior.options.noise)

        return spread

    def run(self, job: LearningJob, state: LearnedState) -> JobResult:
        """Learn a job.

        Args:
            job: what is learned, or only evaluated.
            state: what was learned before it.

        Returns:
            The result. `state` is then the one after the job.
        """
        self.state = state
        lost = self.vision.assignment.losing(job.assignment, len(job.lengths))
        if lost is not self.vision.assignment:
            self.vision.rewire(lost)
        job = job.ordered(self.vision.assignment)
        if job.kind == "antagonism":
            return self._rest(job)
        assert job.pose is not None
        before, self.vision.dropped = self.vision.dropped, {}
        try:
            seen = self.vision.seen(
                job.pose,
                job.estimate,
                job.lengths,
                job.target,
                job.tensions,
                self.antagonism.pairs if self._joint else None,
                learn=job.learn,
                frames=job.frames,
                covariance=job.covariance,
                joint_angles=job.joint_angles,
                time=job.time,
            )
            rewired = job.learn and self.vision.find_miswiring()
            if job.learn and seen.reason and not rewired:
                rewired = self.vision.find_misplaced()
            if rewired or seen.zeroed or (seen.learned and seen.moved):
                self.antagonism.forget()
        finally:
            dropped, self.vision.dropped = self.vision.dropped, before
        return JobResult(
            self.state if job.learn else None, seen.learned or rewired, seen, tuple(dropped.items())
        )

    def _rest(self, job: LearningJob) -> JobResult:
        """Learn from lengths and tensions of a rest."""
        estimate, learned = job.estimate, False
        if job.remember:
            rested = self.vision.rested(Rest(job.lengths, job.tensions, estimate))
            if rested is not None:
                estimate, learned = rested.angles, True
                if rested.moved:
                    self.antagonism.forget()
        if self._joint:
            moved = self.antagonism.settled(estimate, job.lengths, self.vision.pairs)
            learned = learned or moved
        return JobResult(self.state, learned)


def run_named(learning: MapLearning, job: LearningJob, state: LearnedState) -> JobResult:
    """Run a job; an exception becomes the result's `failure`.

    Args:
        learning: runs the job.
        job: what is learned, or only evaluated.
        state: what was learned before it.
    """
    try:
        return learning.run(job, state)
    except Exception as error:  # learning must not end the control loop
        _log.warning("A learning job failed.", exc_info=True)
        return JobResult(None, failure=f"{type(error).__name__}: {error}")

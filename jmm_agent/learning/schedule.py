"""Schedule of learning: which jobs run, what their results change, and what is taken back.

Each job begins with the state that the one before has left. A job that runs or waits is cancelled
if its readings were taken just before a fault, if what was learned is set to another time, or if
learning is switched off; the last two are counted in `VisionUpdater.dropped`, as is a job that
fails. Nothing enters while the hand holds something, because the map must stay then.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterable
from typing import NamedTuple

from jmm_agent.learning.job import JobResult, LearnedState, LearningJob, MapLearning
from jmm_agent.learning.job_queue import Entered, JobQueue
from jmm_agent.learning.options import LearningOptions
from jmm_agent.learning.worker import ProcessWorker, StepWorker
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.prediction_record import PredictionRecord
from jmm_agent.updaters import AntagonismMemory, Seen, VisionMemory
from jmm_agent.updaters.assignment import Assignment

_log = logging.getLogger(__name__)

BUSY = "learning was busy with earlier observations"
SWITCHED_OFF = "learning was switched off before the result entered"
RECALLED = "what was learned was set to another time before the result entered"
FAILED = "learning failed"


class _Before(NamedTuple):
    """What was known before the readings of a time [s] were learned."""

    time: float
    state: LearnedState


class Schedule:
    """Runs learning jobs, and takes over their results.

    Args:
        learning: the map and both updaters.
        options: where jobs run, and when results enter.
        changed: called after the map has changed.

    Attributes:
        seen: result of the newest marker observation; None before the first.
        predictions: of the looks that were learned, or were to be, beside their errors.
        assignment: wiring by which the readings of new jobs are ordered.
        taken_back: number of times that something was unlearned.
    """

    def __init__(
        self, learning: MapLearning, options: LearningOptions, changed: Callable[[], None]
    ) -> None:
        self._learning, self._changed, self._enabled = learning, changed, True
        self._worker = (
            ProcessWorker(learning, options.timeout)
            if options.where == "process"
            else StepWorker(learning)
        )
        self._queue = JobQueue[LearningJob, JobResult](
            self._worker, options.enters_after, self._use, self._too_many, _failed
        )
        self._before: deque[_Before] = deque()
        self.seen: Seen | None = None
        self.predictions = PredictionRecord()
        self.assignment = Assignment()
        self.taken_back = 0

    @property
    def enabled(self) -> bool:
        """Whether anything is learned; False drops the jobs that are to be learned."""
        return self._enabled

    @enabled.setter
    def enabled(self, enabled: bool) -> None:
        self._enabled = enabled
        if not enabled:
            self._cancel(SWITCHED_OFF)

    @property
    def entered(self) -> list[Entered]:
        """Ends of jobs, in order."""
        return self._queue.entered

    @property
    def pending(self) -> bool:
        """Whether the result of some job has not entered yet."""
        return self._queue.pending

    @property
    def late(self) -> bool:
        """Whether some job has not ended yet."""
        return self._queue.pending and not self._worker.done

    @property
    def process_id(self) -> int | None:
        """Number of the process in which jobs run; None while there is none."""
        return self._worker.process_id

    def replay(self, entered: Iterable[Entered]) -> None:
        """Let results enter at recorded steps.

        Args:
            entered: recorded ends of jobs, in order.
        """
        self._queue.replay(entered)

    def submit(self, job: LearningJob) -> None:
        """Run a job, at once or after the one that runs.

        Args:
            job: the job.
        """
        self._queue.submit(job._replace(assignment=self.assignment))

    def advance(self, step: int, hand_is_free: bool) -> None:
        """Let the results of a control step enter; called before `submit`.

        Args:
            step: number of the step.
            hand_is_free: whether the map may change.
        """
        self._queue.step = step
        if hand_is_free:
            self._queue.advance()

    def take_back(self, time: float, window: float, fault: bool) -> None:
        """Forget states from before the window; at a fault, unlearn what was learned in it.

        Args:
            time: now [s].
            window: what was learned less than this before a fault is taken back [s].
            fault: whether a fault was noticed now.
        """
        while self._before and time - self._before[0].time > window:
            self._before.popleft()
        if not fault:
            return
        cancelled = self._queue.cancel(lambda job: job.time >= time - window)
        if self._before:
            earlier = self._before[0].state
            self._before.clear()
            self._return_to(earlier.map, earlier.antagonism, earlier.vision)
            self.taken_back += 1
        elif cancelled:
            self.taken_back += 1

    def recall(
        self, jmm: JointMuscleMap, antagonism: AntagonismMemory, vision: VisionMemory
    ) -> None:
        """Return to what was learned at another time, and drop jobs, which began with another.

        Args:
            jmm: the map.
            antagonism: what the Antagonism Updater remembered.
            vision: what the Vision Updater remembered.
        """
        self._cancel(RECALLED)
        self._return_to(jmm, antagonism, vision)

    def _return_to(
        self, jmm: JointMuscleMap, antagonism: AntagonismMemory, vision: VisionMemory
    ) -> None:
        learning = self._learning
        learning.learner.map = jmm
        learning.antagonism.memory, learning.vision.memory = antagonism, vision
        self._changed()

    def finish(self) -> None:
        """Wait for all jobs, and let their results enter."""
        self._queue.finish()

    def reset(self) -> None:
        """Finish all jobs, and forget the arm, as before a new episode."""
        self._queue.finish()
        self._before.clear()
        self.seen = None

    def close(self) -> None:
        """Finish all jobs, and end the process; a later job starts another one."""
        self._queue.finish()
        self._worker.close()

    def _use(self, job: LearningJob, result: JobResult) -> None:
        """Take over what a job has learned."""
        learning, vision = self._learning, self._learning.vision
        if result.failure:
            vision.drop(f"{FAILED}: {result.failure}")
            _log.warning("%s: %s", FAILED, result.failure)
            return
        if self._enabled:
            self._before.append(_Before(job.time, learning.state))
        if result.seen is not None:
            self.seen = result.seen
            self.predictions.add(result.seen)
        if result.state is not None:
            learning.state = result.state
        for reason, count in result.dropped:
            vision.dropped[reason] = vision.dropped.get(reason, 0) + count
        if result.moved:
            self._changed()

    def _too_many(self) -> None:
        self._learning.vision.drop(BUSY)

    def _cancel(self, reason: str) -> None:
        for _ in range(self._queue.cancel(lambda job: job.learn)):
            self._learning.vision.drop(reason)


def _failed(reason: str) -> JobResult:
    return JobResult(None, failure=reason)

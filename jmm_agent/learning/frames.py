"""Search for the hand in frames beside the control loop, in a thread.

OpenCV releases Python's lock while it searches a frame, so a thread is enough: a control step waits
only for the part that refines corners. The frame is copied, because a driver may use its memory
again.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from queue import SimpleQueue
from typing import NamedTuple

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.learning.job_queue import JobQueue
from jmm_agent.learning.options import LearningOptions
from jmm_agent.types import Floats
from jmm_agent.vision.hand_finder import Findings, FoundBy, FrameJob, Hand, HandFinder


class DetectionResult(NamedTuple):
    """What was found in a frame.

    Attributes:
        found: the hand, and markers; None if the search failed.
        failure: why it failed; empty if it did not.
    """

    found: Findings | None
    failure: str = ""


class DetectionThread:
    """Runs frame jobs in a thread that starts with the first one and ends with the program.

    Args:
        finder: finds the hand.
    """

    def __init__(self, finder: HandFinder) -> None:
        self._finder = finder
        self._number = 0
        self._result: DetectionResult | None = None
        self._start_queues()

    def __deepcopy__(self, memo: dict[int, object]) -> DetectionThread:
        """A copy with a thread of its own; the detector, which remembers nothing, is shared."""
        return DetectionThread(self._finder)

    def submit(self, job: FrameJob) -> None:
        """Start the detection in a frame; the result of an earlier one is forgotten."""
        if not self._thread.is_alive():
            self._start_queues()
            self._thread.start()
        self._number += 1
        self._result = None
        self._inbox.put((self._number, job.frame, self._finder.pose(job.q)))

    @property
    def done(self) -> bool:
        """Whether the result of the newest job is there."""
        while self._result is None and not self._outbox.empty():
            self._take()
        return self._result is not None

    def result(self) -> DetectionResult:
        """Wait for the result of the newest job, and return it."""
        while self._result is None:
            self._take()
        return self._result

    def close(self) -> None:
        """End the thread; a later job starts another one."""
        self._inbox.put(None)

    def _take(self) -> None:
        number, result = self._outbox.get()
        if number == self._number:
            self._result = result

    def _start_queues(self) -> None:
        self._inbox = SimpleQueue[tuple[int, np.ndarray, Floats] | None]()
        self._outbox = SimpleQueue[tuple[int, DetectionResult]]()
        self._thread = threading.Thread(
            target=_detect,
            args=(self._finder, self._inbox, self._outbox),
            name="hand detection",
            daemon=True,
        )


class DetectionNow:
    """Runs frame jobs at once.

    Args:
        finder: finds the hand.
    """

    done = True

    def __init__(self, finder: HandFinder) -> None:
        self._finder = finder
        self._result = DetectionResult(None)

    def submit(self, job: FrameJob) -> None:
        """Find the hand in a frame."""
        self._result = DetectionResult(self._finder.find_at(job.frame, self._finder.pose(job.q)))

    def result(self) -> DetectionResult:
        """The result of the newest job."""
        return self._result

    def close(self) -> None:
        """Do nothing."""


class FrameQueue:
    """Finds the hand in frames beside the control loop; see `FrameFinder`.

    Args:
        finder: finds it in a frame.
        options: where that is done, and when detections enter.

    Attributes:
        newest: the newest frame with what was found in it; None before the first.
        skipped: number of frames in which nothing was searched, because newer ones came.
    """

    def __init__(self, finder: HandFinder, options: LearningOptions) -> None:
        self._finder = finder
        self._runner = (DetectionThread if options.where == "process" else DetectionNow)(finder)
        self.queue = JobQueue[FrameJob, DetectionResult](
            self._runner, options.enters_after, self._use, self._too_many, _failed
        )
        self._results: list[tuple[FrameJob, Hand]] = []
        self._submitted = -np.inf
        self.newest: tuple[FrameJob, Findings] | None = None
        self.skipped = 0

    @property
    def what(self) -> FoundBy:
        """See `FrameFinder`."""
        return self._finder.what

    @property
    def around(self) -> Callable[[Floats], bool] | None:
        """See `FrameFinder`."""
        return self._finder.around

    def pose(self, q: Floats) -> Floats:
        """Expected pose (4, 4) of the hand in the camera at joint angles (n,) [rad]."""
        return self._finder.pose(q)

    def submit(self, job: FrameJob) -> None:
        """Find the hand in a frame, unless that was begun already.

        Args:
            job: the frame.
        """
        if job.time != self._submitted:
            self._submitted = job.time
            self.queue.submit(job._replace(frame=np.array(job.frame)))

    def results(self) -> list[tuple[FrameJob, Hand]]:
        """What entered in this control step."""
        return self._results

    def advance(self, step: int) -> None:
        """Let the detections of a control step enter.

        Args:
            step: number of the step.

        Raises:
            AgentError: a frame has a wrong shape or type, or its detection failed.
        """
        self._results = []
        self.queue.step = step
        self.queue.advance()

    def reset(self) -> None:
        """Forget all frames, as before a new episode."""
        self.queue.cancel(lambda job: True)
        self._results, self._submitted, self.newest = [], -np.inf, None

    def close(self) -> None:
        """End the thread; a later frame starts another one."""
        self.reset()
        self._runner.close()

    def _use(self, job: FrameJob, result: DetectionResult) -> None:
        if result.found is None:
            raise AgentError(result.failure)
        found = self._finder.chosen(result.found, job.q if job.exposed is None else job.exposed)
        self.newest = job, found
        if found.hand is not None:
            self._results.append((job, found.hand))

    def _too_many(self) -> None:
        self.skipped += 1


def _detect(
    finder: HandFinder,
    inbox: SimpleQueue[tuple[int, np.ndarray, Floats] | None],
    outbox: SimpleQueue[tuple[int, DetectionResult]],
) -> None:
    """Find the hand in frames until there are no more."""
    while (message := inbox.get()) is not None:
        number, frame, pose = message
        try:
            result = DetectionResult(finder.find_at(frame, pose))
        except Exception as error:  # named by the control step
            result = _failed(str(error) if isinstance(error, AgentError) else repr(error))
        outbox.put((number, result))


def beside(finder: HandFinder | None, options: LearningOptions) -> FrameQueue | None:
    """The queue of frames; None where a frame is searched in the step that needs it.

    Args:
        finder: finds the hand; None without a camera.
        options: where frames are searched, and when detections enter.
    """
    return FrameQueue(finder, options) if finder is not None and options.enters_after else None


def _failed(reason: str) -> DetectionResult:
    return DetectionResult(None, reason)

"""Queue of jobs beside the control loop: when they start, and at which step results enter.

One job runs at a time, and one more waits. When a third comes, the one that waits is dropped. A
result enters at a stated step (`LearningOptions.enters_after`), for which the step waits, or at the
first step at which it is there. Which step that was is recorded, and a run with the same inputs
repeats to the bit if its results enter at recorded steps.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import Generic, NamedTuple, Protocol, TypeVar

from jmm_agent.learning.options import AS_SOON


class Entered(NamedTuple):
    """The end of a job.

    Attributes:
        step: number of the control step at which its result entered, from 0 for the agent's first.
        kind: "antagonism", "vision" or "frame".
        time: of the readings, or of the frame, that it used [s].
        failure: why it failed; empty if it did not.
    """

    step: int
    kind: str
    time: float
    failure: str = ""


class Job(Protocol):
    """What a queue needs to know of a job."""

    @property
    def kind(self) -> str:
        """Name in the record."""

    @property
    def time(self) -> float:
        """Of the data that it uses [s]."""


class Result(Protocol):
    """What a queue needs to know of a result."""

    @property
    def failure(self) -> str:
        """Why the job failed; empty if it did not."""


J = TypeVar("J", bound=Job)
R = TypeVar("R", bound=Result)
J_contra = TypeVar("J_contra", bound=Job, contravariant=True)
R_co = TypeVar("R_co", bound=Result, covariant=True)


class Runner(Protocol[J_contra, R_co]):
    """Runs one job at a time."""

    def submit(self, job: J_contra) -> None:
        """Start a job; the result of an earlier one is forgotten."""

    @property
    def done(self) -> bool:
        """Whether the result of the newest job is there."""

    def result(self) -> R_co:
        """Wait for the result of the newest job, and return it."""


class _Started(NamedTuple, Generic[J]):
    job: J
    step: int


class JobQueue(Generic[J, R]):
    """Jobs of one kind of work (module docstring).

    Args:
        runner: runs the jobs.
        enters_after: number of steps after which a result enters, or `AS_SOON`.
        use: called with each job and its result when that enters.
        drop: called when a job is dropped because two newer ones came while another ran.
        failed: makes the result of a job whose recorded failure is not empty.

    Attributes:
        entered: ends of jobs, in order.
        step: number of the control step, from 0; -1 before the first.
    """

    def __init__(
        self,
        runner: Runner[J, R],
        enters_after: int,
        use: Callable[[J, R], None],
        drop: Callable[[], None],
        failed: Callable[[str], R],
    ) -> None:
        self._runner, self._enters_after = runner, enters_after
        self._use, self._drop, self._failed = use, drop, failed
        self._running: _Started[J] | None = None
        self._waiting: J | None = None
        self._replayed: deque[Entered] | None = None
        self.entered: list[Entered] = []
        self.step = -1

    @property
    def pending(self) -> bool:
        """Whether some result has not entered yet."""
        return self._running is not None

    def replay(self, entered: Iterable[Entered]) -> None:
        """Let results enter at recorded steps, in place of the options.

        Args:
            entered: recorded ends of jobs, in order.
        """
        self._replayed = deque(entered)

    def submit(self, job: J) -> None:
        """Run a job, at once or after the one that runs.

        Args:
            job: the job.
        """
        if self._running is not None:
            if self._waiting is not None:
                self._drop()
            self._waiting = job
            return
        self._start(job)
        if self._is_due():
            self._enter()

    def advance(self) -> None:
        """Let the results of this control step enter; called before `submit`."""
        while self._running is not None and self._is_due():
            self._enter()

    def finish(self) -> None:
        """Wait for all jobs, and let their results enter."""
        while self._running is not None:
            self._enter()

    def cancel(self, concerns: Callable[[J], bool]) -> int:
        """Forget jobs whose results have not entered.

        Args:
            concerns: whether a job is forgotten.

        Returns:
            Their number.
        """
        count = 0
        if self._waiting is not None and concerns(self._waiting):
            self._waiting, count = None, count + 1
        if self._running is not None and concerns(self._running.job):
            self._running, count = None, count + 1
            self._start_waiting()
        return count

    def _start(self, job: J) -> None:
        self._runner.submit(job)
        self._running = _Started(job, self.step)

    def _start_waiting(self) -> None:
        if self._waiting is not None:
            waiting, self._waiting = self._waiting, None
            self._start(waiting)

    def _is_due(self) -> bool:
        """Whether the result of the running job enters at this step."""
        assert self._running is not None
        if self._replayed is not None:
            return bool(self._replayed) and self._replayed[0].step <= self.step
        if self._enters_after == AS_SOON:
            return self._runner.done
        return self.step >= self._running.step + self._enters_after

    def _enter(self) -> None:
        """Wait for the result of the running job and use it; start the job that waits."""
        assert self._running is not None
        job, result = self._running.job, self._runner.result()
        self._running = None
        if self._replayed:
            failure = self._replayed.popleft().failure
            result = self._failed(failure) if failure else result
        self.entered.append(Entered(self.step, job.kind, job.time, result.failure))
        try:
            self._use(job, result)
        finally:
            self._start_waiting()

"""Workers that run learning jobs: in the control step, or in a process beside the control loop.

A thread beside the loop would hold Python's lock for most of a job, and each NumPy call of a
control step would wait for it. The process runs `jmm_agent.learning.worker_process`, not the
caller's main module. A thread of this process, which mostly sleeps, packs, sends and receives; so
a control step pays for none of that. The process ends when its input ends, also if this process
was killed.
"""

from __future__ import annotations

import os
import pickle  # noqa: TID251  # between a process and its parent, never from a file
import subprocess
import sys
import threading
from contextlib import suppress
from copy import deepcopy
from queue import Empty, SimpleQueue
from time import monotonic
from typing import Any

from jmm_agent.errors import AgentError
from jmm_agent.learning.job import JobResult, LearnedState, LearningJob, MapLearning, run_named
from jmm_agent.mapping.torch_process import shared

CLOSING = 5.0
"""Time for a job to end when its process is closed; after that it is killed [s]."""


class StepWorker:
    """Runs jobs at once, in the caller's thread.

    Args:
        learning: runs the jobs; its state stays.
    """

    def __init__(self, learning: MapLearning) -> None:
        self._learning = learning
        self._result = JobResult(None)

    process_id = None

    def submit(self, job: LearningJob) -> None:
        """Run a job."""
        state = self._learning.state
        self._result = run_named(self._learning, job, state)
        self._learning.state = state

    @property
    def done(self) -> bool:
        """True: a job is done when `submit` returns."""
        return True

    def result(self) -> JobResult:
        """The result of the newest job."""
        return self._result

    def close(self) -> None:
        """End the process in which torch runs, if a rule has started one."""
        shared().close()


class ProcessWorker:
    """Runs jobs in a process beside this one, which is started at once.

    When the process ends, the job fails with that reason, and another process is started.

    Args:
        learning: a copy of it runs the jobs.
        timeout: a job that takes longer fails, and its process is killed [s].

    Raises:
        AgentError: something that learning needs cannot be sent to a process.
    """

    def __init__(self, learning: MapLearning, timeout: float) -> None:
        try:
            self._packed = pickle.dumps(learning)
        except Exception as error:  # pickle raises errors of many types
            raise AgentError(
                f"Learning in a process: what it needs cannot be sent there ({error}). Classes and "
                "functions must stand at the top level of a module that can be imported."
            ) from error
        self._learning, self._timeout = learning, timeout
        self._number, self._deadline = 0, 0.0
        self._result: JobResult | None = JobResult(None, failure="no job was submitted")
        self._courier: _Courier | None = _Courier(self._packed)

    def __deepcopy__(self, memo: dict[int, Any]) -> ProcessWorker:
        """A worker with a process of its own, without the job that runs here."""
        return ProcessWorker(deepcopy(self._learning, memo), self._timeout)

    @property
    def process_id(self) -> int | None:
        """Number of the process; None while there is none."""
        return None if self._courier is None else self._courier.process_id

    def submit(self, job: LearningJob) -> None:
        """Start a job with what is learned now; the result of an earlier one is forgotten."""
        self._number += 1
        self._result, self._deadline = None, monotonic() + self._timeout
        if self._courier is None:
            self._courier = _Courier(self._packed)
        self._courier.inbox.put((self._number, job, self._learning.state))

    @property
    def done(self) -> bool:
        """Whether the result of the newest job is there."""
        self._receive(0.0)
        return self._result is not None

    def result(self) -> JobResult:
        """Wait for the result of the newest job, and return it."""
        while self._result is None:
            self._receive(0.1)
        return self._result

    def close(self) -> None:
        """End the process; a later job starts another one."""
        if self._courier is not None:
            self._courier.end()
        self._courier = None

    def _receive(self, patience: float) -> None:
        """Take results for some time [s], until the newest is there."""
        while self._result is None and self._courier is not None:
            try:
                number, result = self._courier.outbox.get(patience > 0.0, patience)
            except Empty:
                break
            if number == self._number:
                self._result = result
        if self._result is None and monotonic() > self._deadline:
            self._result = JobResult(None, failure=f"it took more than {self._timeout:g} s")
            if self._courier is not None:
                self._courier.kill()


class _Courier:
    """Thread that carries jobs to a process, and results back.

    Attributes:
        inbox: number, job and state of each job.
        outbox: number and result of each job.
    """

    def __init__(self, packed: bytes) -> None:
        self._packed = packed
        self._process: subprocess.Popen[bytes] | None = None
        self.inbox = SimpleQueue[tuple[int, LearningJob, LearnedState] | None]()
        self.outbox = SimpleQueue[tuple[int, JobResult]]()
        self._thread = threading.Thread(target=self._carry, name="learning", daemon=True)
        self._thread.start()

    @property
    def process_id(self) -> int | None:
        """Number of the process; None while there is none."""
        return None if self._process is None else self._process.pid

    def end(self) -> None:
        """End thread and process."""
        self.inbox.put(None)
        self._thread.join(CLOSING)
        self.kill()

    def kill(self) -> None:
        """Kill the process, if there is one."""
        if self._process is not None:
            self._process.kill()

    def _carry(self) -> None:
        """Carry jobs until `end`."""
        with suppress(OSError):
            self._start()
        while (message := self.inbox.get()) is not None:
            number, job, state = message
            try:
                if self._process is None:
                    self._start()
                result = self._ask(job, state)
            except Exception as error:  # any error here is one of the job
                result = JobResult(None, failure=self._reason(error))
                self._stop()
            self.outbox.put((number, result))
            if self._process is None:
                with suppress(OSError):
                    self._start()
        self._stop()

    def _start(self) -> None:
        """Start the process and send it what it needs."""
        self._process = subprocess.Popen(
            [sys.executable, "-m", "jmm_agent.learning.worker_process"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )
        assert self._process.stdin is not None
        self._process.stdin.write(self._packed)
        self._process.stdin.flush()

    def _ask(self, job: LearningJob, state: LearnedState) -> JobResult:
        """The result of a job that the process runs."""
        process = self._process
        assert process is not None
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(pickle.dumps((job, state)))
        process.stdin.flush()
        result = pickle.load(process.stdout)
        assert isinstance(result, JobResult)
        return result

    def _reason(self, error: Exception) -> str:
        """Why a job has failed that raised an error here."""
        if not isinstance(error, (EOFError, OSError, pickle.UnpicklingError)):
            return f"{type(error).__name__}: {error}"
        if self._process is None:
            return f"the process could not be started: {error}"
        code = self._process.wait()
        how = f"was killed by signal {-code}" if code < 0 else f"ended with exit code {code}"
        return f"the process {how}"

    def _stop(self) -> None:
        """Let the process end, and kill it if it does not."""
        process, self._process = self._process, None
        if process is None:
            return
        for pipe in (process.stdin, process.stdout):
            with suppress(OSError):
                assert pipe is not None
                pipe.close()
        try:
            process.wait(CLOSING)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

"""Process that runs learning jobs; see `jmm_agent.learning.worker`.

It reads a `MapLearning`, then jobs with their states, from its standard input, and writes their
results to its standard output, all as pickles. The only other end is the process that started it.
It ignores Ctrl-C, which reaches all processes of a terminal, and ends when its input ends. Its
priority is low, so that the control loop comes first where both share a core.
"""

from __future__ import annotations

import os
import pickle  # noqa: TID251  # between a process and its parent, never from a file
import signal
import sys
from collections.abc import Callable
from functools import partial
from typing import BinaryIO

from jmm_agent.learning.job import JobResult, LearnedState, LearningJob, run_named

NICENESS = 10
"""By which the priority is lower than that of the control loop."""


def main() -> None:
    """Run jobs until there are no more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    results = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what libraries print is no result
    jobs = sys.stdin.buffer
    try:
        run = _runner(jobs)
        while True:
            results.write(pickle.dumps(run(*pickle.load(jobs))))
            results.flush()
    except (EOFError, BrokenPipeError):
        return


def _runner(jobs: BinaryIO) -> Callable[[LearningJob, LearnedState], JobResult]:
    """What runs jobs; it names in their results why it could not be read."""
    try:
        learning = pickle.load(jobs)
    except EOFError:
        raise
    except Exception as error:  # pickle raises errors of many types
        reason = (
            f"the process cannot load what it needs ({type(error).__name__}: {error}); classes "
            "must stand in a module that can be imported, not in the program itself"
        )
        return lambda job, state: JobResult(None, failure=reason)
    return partial(run_named, learning)


if __name__ == "__main__":
    main()

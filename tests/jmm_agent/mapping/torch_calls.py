"""Functions that a test lets the process of torch run."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable

from jmm_agent.mapping.recipe import TrainingError

Report = Callable[[float], None]


def answer(number: int, progress: Report) -> tuple[int, int]:
    """Twice a number, and the process that computed it."""
    print("what a library prints is no message")
    progress(0.5)
    progress(1.0)
    return 2 * number, os.getpid()


def threads(progress: Report) -> tuple[int, bool]:
    """Number of torch's threads, and whether it sees a graphics card."""
    import torch

    return torch.get_num_threads(), torch.cuda.is_available()


def refuse(progress: Report) -> None:
    """Raise an error of training."""
    raise TrainingError("The rate is too high.")


def fail(progress: Report) -> None:
    """Raise an error of torch."""
    import torch

    torch.ones(2) @ torch.ones(3)


def kill(progress: Report) -> None:
    """End without a message, as the kernel ends what takes too much memory."""
    os.kill(os.getpid(), signal.SIGKILL)


def leave(progress: Report) -> None:
    """End with an exit code."""
    os._exit(3)


def work(progress: Report) -> None:
    """Report shares for a minute, longer than any test waits."""
    for k in range(600):
        progress(k / 600)
        time.sleep(0.1)


def silent(progress: Report) -> None:
    """Work for a minute without a report."""
    time.sleep(60.0)

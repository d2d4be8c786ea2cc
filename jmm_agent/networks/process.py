"""Process that runs functions which need torch; see `jmm_agent.mapping.torch_process`.

It reads names of functions and their arguments from its standard input, and writes shares of the
work that are done, results and errors to its standard output, all as pickles. The only other end is
the process that started it. It ignores Ctrl-C, which reaches all processes of a terminal, and ends
when its input ends, or when the process that started it has ended.
"""

from __future__ import annotations

import importlib
import os
import pickle  # noqa: TID251  # between a process and its parent, never from a file
import signal
import sys
import threading
import time
from typing import Any, BinaryIO

from jmm_agent.mapping.recipe import TrainingError
from jmm_agent.mapping.torch_process import FAILED, PROGRESS, RESULT

WATCHED = 1.0
"""Time between two looks at whether the process that started this one still runs [s]."""


def main() -> None:
    """Run functions until there are no more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if os.name == "posix":
        threading.Thread(target=_watch, args=(os.getppid(),), daemon=True).start()
    messages = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what libraries print is no message
    try:
        while True:
            function, arguments = pickle.load(sys.stdin.buffer)
            _send(messages, *_run(messages, function, arguments))
    except (EOFError, BrokenPipeError):
        return


def _watch(parent: int) -> None:
    """End this process with the one that started it, also where a fork holds its input open."""
    while os.getppid() == parent:
        time.sleep(WATCHED)
    os._exit(1)


def _run(messages: BinaryIO, function: str, arguments: tuple[Any, ...]) -> tuple[str, Any]:
    """Kind and content of the last message of a call."""
    module, name = function.split(":")
    try:
        call = getattr(importlib.import_module(module), name)
        _prepare()
        return RESULT, call(*arguments, lambda share: _send(messages, PROGRESS, share))
    except BrokenPipeError:
        raise
    except TrainingError as error:
        return FAILED, str(error)
    except ImportError as error:
        return FAILED, (
            f"Training: a library cannot be imported ({error}); torch, which trains networks, is "
            "installed with this package."
        )
    except Exception as error:  # torch raises errors of many types
        reason = " ".join(str(error).split())[:300].rstrip(".")
        return FAILED, f"Training: {type(error).__name__}: {reason}."


def _prepare() -> None:
    """Let torch, once imported, use one thread and no operation that differs from run to run."""
    torch = sys.modules.get("torch")
    if torch is not None:
        torch.set_num_threads(1)
        torch.use_deterministic_algorithms(True)


def _send(messages: BinaryIO, kind: str, content: object) -> None:
    messages.write(pickle.dumps((kind, content)))
    messages.flush()


if __name__ == "__main__":
    main()

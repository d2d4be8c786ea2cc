"""Process in which torch trains networks, beside the one that asks for it.

Nothing but `jmm_agent.networks` imports torch, and it runs in such a process only. On Linux torch
comes with Triton, which ends the process that imports it after Mesa has drawn there, and no program
that renders knows in which order its libraries were imported. The process runs
`jmm_agent.networks.process`, not the caller's main module, so scripts need no
``if __name__ == "__main__"``. It has one thread, so that the bits do not depend on the number of
cores, and ends when its input ends, also if the process that started it was killed.
"""

from __future__ import annotations

import os
import pickle  # noqa: TID251  # between a process and its parent, never from a file
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any
from weakref import finalize

from jmm_agent.mapping.recipe import TrainingError

PROGRESS, RESULT, FAILED = "progress", "result", "failed"
"""Kinds of the messages of the process."""

CLOSING = 5.0
"""Time for the process to end when its input has ended; after that it is killed [s]."""

ALONE = {
    **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"),
    "CUDA_VISIBLE_DEVICES": "",
}
"""Variables of the process: one thread, and no graphics card."""


class TorchProcess:
    """A process that runs functions which need torch; it starts with the first call.

    A call that is interrupted ends the process; a later call starts another one. Calls of several
    threads run one after the other. In a ``with`` statement the process starts at once, and ends
    with the block.
    """

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._end: finalize[..., Any] | None = None
        self._lock = threading.Lock()

    def __enter__(self) -> TorchProcess:
        with self._lock:
            self._start()
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    @property
    def process_id(self) -> int | None:
        """Number of the process; None while there is none."""
        return None if self._process is None else self._process.pid

    def call(
        self,
        function: str,
        *arguments: object,
        progress: Callable[[float], None] | None = None,
    ) -> Any:
        """Run a function in the process, and wait for its result.

        Args:
            function: "module:name" of a function whose last argument is a callback of the share of
                its work that is done.
            arguments: those before the callback; they are copied.
            progress: called with each share that is reported.

        Returns:
            What the function returns.

        Raises:
            TrainingError: the function has raised it, or it or the process has failed.
        """
        with self._lock:
            try:
                self._start()
                self._send((function, arguments))
                while True:
                    kind, content = self._receive()
                    if kind != PROGRESS:
                        break
                    if progress is not None:
                        progress(content)
            except BaseException:  # also Ctrl-C: what the process still sends belongs to no call
                self._stop(0.0)
                raise
        if kind == RESULT:
            return content
        raise TrainingError(content)

    def close(self) -> None:
        """End the process; a later call starts another one."""
        with self._lock:
            self._stop(CLOSING)

    def _start(self) -> None:
        if self._process is not None:
            return
        # The paths of this program, and not the folder in which it runs unless that is one of them.
        paths = dict.fromkeys(str(path) or os.getcwd() for path in sys.path)
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "jmm_agent.networks.process"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env={**os.environ, **ALONE, "PYTHONPATH": os.pathsep.join(paths)},
            )
        except OSError as error:
            raise TrainingError(
                f"Training: the process that runs torch could not be started: {error}."
            ) from error
        self._end = finalize(self, _end, self._process, CLOSING)

    def _send(self, request: object) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(pickle.dumps(request))
            self._process.stdin.flush()
        except OSError as error:
            raise self._ended() from error

    def _receive(self) -> tuple[str, Any]:
        """Kind and content of the next message."""
        assert self._process is not None
        assert self._process.stdout is not None
        try:
            kind, content = pickle.load(self._process.stdout)
        except (EOFError, OSError, pickle.UnpicklingError) as error:
            raise self._ended() from error
        return kind, content

    def _ended(self) -> TrainingError:
        """How the process has ended."""
        assert self._process is not None
        try:
            code = self._process.wait(CLOSING)
        except subprocess.TimeoutExpired:
            return TrainingError("Training: the process that runs torch has closed its output.")
        how = f"was killed by signal {-code}" if code < 0 else f"ended with exit code {code}"
        return TrainingError(f"Training: the process that runs torch {how}.")

    def _stop(self, patience: float) -> None:
        process, self._process = self._process, None
        if process is not None:
            assert self._end is not None
            self._end.detach()
            _end(process, patience)


def shared() -> TorchProcess:
    """The process of online learning, one for all agents of this program; it ends with it."""
    return _SHARED.setdefault(os.getpid(), TorchProcess())  # a fork cannot share it


_SHARED: dict[int, TorchProcess] = {}


def _end(process: subprocess.Popen[bytes], patience: float) -> None:
    """Let a process end, and kill it after some time [s]."""
    for pipe in (process.stdin, process.stdout):
        with suppress(OSError):
            assert pipe is not None
            pipe.close()
    try:
        process.wait(patience)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()

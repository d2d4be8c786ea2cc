"""Sandbox: a worker process for untrusted files, with limits of time and memory."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from mjcf_sandbox.errors import SandboxError, UntrustedFileError

START = (
    "import json, sys; task = json.loads(sys.argv[1]); sys.path[:] = task.pop('path'); "
    "from mjcf_sandbox.worker import main; main(**task)"
)
"""Program of the worker, which finds modules where its parent does and nowhere else."""
REASON, PROGRESS = "reason", "progress"
"""Names of files in the worker's folder: the reason of a refusal, and the progress."""
STARTING = 60.0
"""Largest time of the worker's imports, on a busy machine [s]."""
TICK = 0.02
"""Time between two checks of the worker [s]."""


@dataclass(frozen=True)
class Limits:
    """Limits of a worker.

    Attributes:
        seconds: time without progress, after the imports [s].
        cpu: CPU time of all threads, after the imports [s]; None: no limit.
        memory: memory beyond that of the imports [bytes].
    """

    seconds: float
    cpu: int | None
    memory: int


def run(
    module: str,
    arguments: Sequence[str],
    limits: Limits,
    on_progress: Callable[[float], None] = lambda share: None,
) -> None:
    """Call ``main(*arguments)`` of a module in a worker process.

    The worker runs in an empty folder, and its output is discarded. It calls
    `mjcf_sandbox.worker.report_progress`, and refuses a file by raising `UntrustedFileError`.

    Args:
        module: name of the module.
        arguments: arguments of its ``main``; paths must be absolute.
        limits: limits beyond which the worker is killed.
        on_progress: called with the share of the work that is done, 0 to 1, when it changes.

    Raises:
        SandboxError: the worker crashed or exceeded its limits.
        UntrustedFileError: the worker refused the file.
    """
    path = [os.path.abspath(folder) for folder in sys.path]
    task = {
        "path": path,
        "module": module,
        "arguments": list(arguments),
        "cpu": limits.cpu,
        "memory": limits.memory,
    }
    with tempfile.TemporaryDirectory(prefix="mjcf_sandbox-") as name:
        worker = subprocess.Popen(
            [sys.executable, "-c", START, json.dumps(task)],
            cwd=name,
            env={**os.environ, "MUJOCO_GL": "disabled"},  # a worker renders nothing
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            _wait(worker, Path(name) / PROGRESS, limits.seconds, on_progress)
        finally:
            worker.kill()
            worker.wait()
        if worker.returncode:
            reason = Path(name) / REASON
            if reason.is_file():
                raise UntrustedFileError(reason.read_text(encoding="utf-8"))
            raise SandboxError(_reason(worker.returncode, limits))


def _wait(
    worker: subprocess.Popen[bytes],
    progress: Path,
    seconds: float,
    on_progress: Callable[[float], None],
) -> None:
    """Wait for the worker; raise `SandboxError` after too much time without progress."""
    share, moved = None, time.monotonic()
    while worker.poll() is None:
        if progress.exists() and (found := progress.stat().st_size / 1000) != share:
            share, moved = found, time.monotonic()
            on_progress(share)
        if time.monotonic() - moved > (STARTING if share is None else seconds):
            raise SandboxError(f"takes longer than {seconds:g} s to read")
        time.sleep(TICK)


def _reason(code: int, limits: Limits) -> str:
    """Reason why the worker failed, from its exit code."""
    if code == -getattr(signal, "SIGXCPU", 0):
        return f"takes longer than {limits.cpu} s to read"
    if code < 0:
        return f"crashes its reader ({signal.Signals(-code).name})"
    return f"makes its reader fail, or needs more than {limits.memory >> 20} MiB"

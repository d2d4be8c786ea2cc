"""A process of its own for work on a stranger's file, with limits of time and memory."""

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
"""The child finds modules where its parent does, and nowhere else."""
REASON, PROGRESS = "reason", "progress"
"""Files in the child's folder: why it refuses, and how far it is."""
STARTING = 60.0
"""How long its imports may take on a busy machine [s]."""
TICK = 0.02
"""How often the child is looked at [s]."""


@dataclass(frozen=True)
class Limits:
    """How much a child may take.

    Attributes:
        seconds: without any progress, after its imports [s].
        cpu: of all its threads together, after its imports [s]; None for as much as it likes.
        memory: beyond what its imports need [bytes].
    """

    seconds: float
    cpu: int | None
    memory: int


def run(
    module: str,
    arguments: Sequence[str],
    limits: Limits,
    tell: Callable[[float], None] = lambda share: None,
) -> None:
    """Call ``main(*arguments)`` of a module in a process of its own.

    It runs in an empty folder, and what it prints is lost. It tells its progress, and refuses its
    file, as `mjcf_sandbox.worker` says.

    Args:
        module: name of the module.
        arguments: paths must be absolute.
        limits: beyond which it is killed.
        tell: called with the share that is done, 0 to 1, whenever it changes.

    Raises:
        FenceError: it crashed or went beyond the limits.
        StrangeFileError: it refused the file.
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
        child = subprocess.Popen(
            [sys.executable, "-c", START, json.dumps(task)],
            cwd=name,
            env={**os.environ, "MUJOCO_GL": "disabled"},  # nothing is drawn there
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            _wait(child, Path(name) / PROGRESS, limits.seconds, tell)
        finally:
            child.kill()
            child.wait()
        if child.returncode:
            reason = Path(name) / REASON
            if reason.is_file():
                raise UntrustedFileError(reason.read_text(encoding="utf-8"))
            raise SandboxError(_reason(child.returncode, limits))


def _wait(
    child: subprocess.Popen[bytes], progress: Path, seconds: float, tell: Callable[[float], None]
) -> None:
    """Until the child ends; refused when it stands still for too long."""
    share, moved = None, time.monotonic()
    while child.poll() is None:
        if progress.exists() and (found := progress.stat().st_size / 1000) != share:
            share, moved = found, time.monotonic()
            tell(share)
        if time.monotonic() - moved > (STARTING if share is None else seconds):
            raise SandboxError(f"takes longer than {seconds:g} s to read")
        time.sleep(TICK)


def _reason(code: int, limits: Limits) -> str:
    """Why the child failed, by its exit code."""
    if code == -getattr(signal, "SIGXCPU", 0):
        return f"takes longer than {limits.cpu} s to read"
    if code < 0:
        return f"crashes its reader ({signal.Signals(-code).name})"
    return f"makes its reader fail, or needs more than {limits.memory >> 20} MiB"

"""Worker process of the sandbox: sets its limits, then does the work."""

from __future__ import annotations

import importlib
import math
import os
import sys
from pathlib import Path

from mjcf_sandbox.errors import UntrustedFileError
from mjcf_sandbox.sandbox import PROGRESS, REASON

if sys.platform != "win32":
    import resource


def main(module: str, arguments: list[str], cpu: int | None, memory: int) -> None:
    """Call ``main(*arguments)`` of a module; write its reason for the parent if it refuses a file.

    Args:
        module: name of the module.
        arguments: arguments of its ``main``.
        cpu: limit of CPU time [s]; None: no limit.
        memory: limit of memory beyond the present use [bytes].
    """
    reason = Path(REASON).resolve()
    work = importlib.import_module(module).main
    _limit(cpu, memory)
    report_progress(0.0)
    try:
        work(*arguments)
    except UntrustedFileError as error:
        reason.write_text(str(error), encoding="utf-8")
        sys.exit(1)


def report_progress(share: float) -> None:
    """Report the share of the work that is done, 0 to 1, as the size of a file in thousandths."""
    with Path(PROGRESS).open("ab") as file:
        file.write(b"." * (round(1000 * share) - os.fstat(file.fileno()).st_size))


def _limit(cpu: int | None, memory: int) -> None:
    """Set the system's limits of this process; Windows has none."""
    if sys.platform == "win32":
        return
    if cpu is not None:
        usage = resource.getrusage(resource.RUSAGE_SELF)
        seconds = math.ceil(usage.ru_utime + usage.ru_stime) + cpu
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if sys.platform == "linux":  # macOS refuses every limit of the address space
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        space = pages * resource.getpagesize() + memory
        resource.setrlimit(resource.RLIMIT_AS, (space, space))

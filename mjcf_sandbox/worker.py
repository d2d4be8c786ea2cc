"""What runs behind the fence: limits, then the work."""

from __future__ import annotations

import importlib
import math
import sys
from pathlib import Path

from mjcf_sandbox.errors import UntrustedFileError
from mjcf_sandbox.sandbox import PROGRESS, REASON

if sys.platform != "win32":
    import resource


def main(module: str, arguments: list[str], cpu: int | None, memory: int) -> None:
    """Call ``main(*arguments)`` of a module; what it refuses is written down for the parent."""
    reason = Path(REASON).resolve()
    work = importlib.import_module(module).main
    _limit(cpu, memory)
    tell(0.0)
    try:
        work(*arguments)
    except UntrustedFileError as error:
        reason.write_text(str(error), encoding="utf-8")
        sys.exit(1)


def tell(share: float) -> None:
    """How much is done, 0 to 1: the parent looks at the size of a file, in thousandths."""
    with Path(PROGRESS).open("ab") as file:
        file.write(b"." * (round(1000 * share) - file.tell()))


def _limit(cpu: int | None, memory: int) -> None:
    """Let the system end this process when it takes too much; Windows has no such limits."""
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

"""Signals that ask a process to end, raised as exceptions."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

ENDINGS = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that ask a process to end, besides SIGINT, which Python raises as an exception."""


@contextmanager
def endings_raised() -> Iterator[None]:
    """Let the first SIGTERM or SIGHUP raise SystemExit, unless the caller handles it.

    The exit code is 128 plus the number of the signal, as in a shell. Does nothing outside of the
    main thread, where Python handles no signals.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    replaced = [number for number in ENDINGS if signal.getsignal(number) is signal.SIG_DFL]

    def end(number: int, frame: FrameType | None) -> None:
        for other in replaced:
            signal.signal(other, signal.SIG_IGN)  # the robot is being stopped already
        raise SystemExit(128 + number)

    try:
        for number in replaced:
            signal.signal(number, end)
        yield
    finally:
        for number in replaced:
            signal.signal(number, signal.SIG_DFL)

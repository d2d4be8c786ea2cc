"""Short pauses of a control loop: by garbage collections, and by threads that compute in Python."""

from __future__ import annotations

import gc
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

SWITCH_INTERVAL = 0.5e-3
"""Time for which another thread may hold Python's lock while a control step waits for it [s].

Python's own value, 5 ms, is as long as a whole control step may take.
"""


class _Settings:
    """The process's settings, which are changed while at least one context is open."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._open = 0
        self._interval, self._frozen = 0.0, False

    def enter(self) -> None:
        """Change the settings, if no other context has."""
        with self._lock:
            self._open += 1
            if self._open > 1:
                return
            self._interval, self._frozen = sys.getswitchinterval(), gc.get_freeze_count() > 0
            gc.collect()
            gc.freeze()
            sys.setswitchinterval(min(self._interval, SWITCH_INTERVAL))

    def leave(self) -> None:
        """Restore the settings, if no other context is open."""
        with self._lock:
            self._open -= 1
            if self._open > 0:
                return
            sys.setswitchinterval(self._interval)
            if not self._frozen:
                gc.unfreeze()


_SETTINGS = _Settings()


@contextmanager
def short_pauses() -> Iterator[None]:
    """Keep the pauses of a control loop short within this context.

    All objects that exist now are left out of garbage collections: a full collection visits every
    object of the process, and takes about 50 ms with the packages that an agent imports. One is run
    now. Objects that are made within the context are collected as usual. Threads beside the loop,
    such as that of marker detection, yield Python's lock after `SWITCH_INTERVAL`.

    The settings are those of the process: contexts in several threads share them, from the entry
    of the first to the end of the last. If the caller has frozen objects before, all stay frozen.
    """
    _SETTINGS.enter()
    try:
        yield
    finally:
        _SETTINGS.leave()

"""Short pauses of a control loop: by garbage collections, and by threads that compute in Python."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager

SWITCH_INTERVAL = 0.5e-3
"""Time for which another thread may hold Python's lock while a control step waits for it [s].

Python's own value, 5 ms, is as long as a whole control step may take.
"""


@contextmanager
def short_pauses() -> Iterator[None]:
    """Keep the pauses of a control loop short within this context.

    All objects that exist now are left out of garbage collections: a full collection visits every
    object of the process, and takes about 100 ms with the packages that an agent imports. Objects
    that are made within the context are collected as usual. Threads beside the loop, such as that
    of marker detection, yield Python's lock after `SWITCH_INTERVAL`.
    """
    interval = sys.getswitchinterval()
    gc.collect()
    gc.freeze()
    sys.setswitchinterval(min(interval, SWITCH_INTERVAL))
    try:
        yield
    finally:
        sys.setswitchinterval(interval)
        gc.unfreeze()

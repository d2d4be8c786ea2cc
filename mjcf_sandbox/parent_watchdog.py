"""Parent watchdog: a worker process ends with its parent, even if the parent is killed."""

from __future__ import annotations

import multiprocessing
import os
import threading


def end_with_parent() -> None:
    """Start a thread that ends this worker process when its parent ends.

    Without it, a worker of a pool whose parent is killed waits for its next task for ever.
    """
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()

"""Worker processes end with the one that started them, even if that one was killed."""

from __future__ import annotations

import multiprocessing
import os
import threading


def end_with_parent() -> None:
    """Let this worker end as soon as its parent has; for the start of a worker.

    A worker of a pool whose parent was killed would wait for its next task for ever.
    """
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()

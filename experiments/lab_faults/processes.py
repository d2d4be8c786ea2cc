"""Processes of the experiment, which talk in lines of JSON."""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Collection
from contextlib import suppress
from types import TracebackType
from typing import Any

from experiments.harness.errors import ExperimentError

Event = dict[str, Any]


def raise_priority() -> None:
    """Raise the priority of this process, as for a control loop, where this user may."""
    with suppress(OSError, AttributeError):
        os.nice(-10)


class Host:
    """A process of this package, with the lines of its standard output and input.

    Args:
        module: of this package.
        arguments: of its command line.
        environment: variables beside those of this process.
    """

    def __init__(self, module: str, *arguments: str, **environment: str) -> None:
        self._name = module
        self._process = subprocess.Popen(
            [sys.executable, "-m", f"{__package__}.{module}", *arguments],
            env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))} | environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._events: queue.Queue[Event] = queue.Queue()
        threading.Thread(target=self._listen, daemon=True).start()

    def __enter__(self) -> Host:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._process.terminate()
        try:
            self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
        self._process.__exit__(kind, error, trace)

    def order(self, **order: Any) -> None:
        """Send a line."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(order) + "\n")
        self._process.stdin.flush()

    def wait_for(self, names: Collection[str], timeout: float) -> tuple[Event | None, list[Event]]:
        """Wait for one of some events.

        Args:
            names: of the events.
            timeout: longest wait [s].

        Returns:
            The event, or None if none came in time; and the events before it.

        Raises:
            ExperimentError: the process has ended.
        """
        before: list[Event] = []
        end = time.monotonic() + timeout
        while True:
            try:
                found = self._events.get(timeout=max(0.0, end - time.monotonic()))
            except queue.Empty:
                return None, before
            if found["event"] in names:
                return found, before
            if found["event"] == "gone":
                raise ExperimentError(f"The process {self._name} has ended; see above.")
            before.append(found)

    def _listen(self) -> None:
        assert self._process.stdout is not None
        with suppress(ValueError):  # closed while it was read
            for line in self._process.stdout:
                self._events.put(json.loads(line))
        self._events.put({"event": "gone"})

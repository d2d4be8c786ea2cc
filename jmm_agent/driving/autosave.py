"""Keeps a file of what an agent has learned, written beside the control loop."""

from __future__ import annotations

import logging
import os
import threading
from pathlib import Path
from types import TracebackType

from jmm_agent.agent import Agent
from jmm_agent.errors import AgentError
from jmm_agent.memory_file import AgentMemory, write_memory

_log = logging.getLogger(__name__)


class AutosaveError(AgentError):
    """What was learned cannot be written."""


class Autosave:
    """Within this context, a file holds what an agent has learned.

    A thread writes it whole after each control step in which something was learned, so that the
    loop does not wait for the disk. The context ends when the last write has.

    Args:
        agent: the agent.
        path: of the file, which `Agent.load` reads.

    Attributes:
        written: newest memory that is on the disk; None before the first.
    """

    def __init__(self, agent: Agent, path: str | os.PathLike[str]) -> None:
        self._agent, self._path = agent, path
        self._learned = agent.map, agent.vision.memory
        self._waiting: AgentMemory | None = None
        self.written: AgentMemory | None = None
        self._error: AutosaveError | None = None
        self._changed = threading.Condition()
        self._closed = False
        self._thread = threading.Thread(target=self._write, name="autosave", daemon=True)

    def __enter__(self) -> Autosave:
        path = Path(self._path).absolute()
        if path.parent.is_dir():
            _log.info("What the agent learns is kept in %s.", path)
        else:
            _log.warning(
                "What the agent learns is kept in %s; the folder %s does not exist and is made.",
                path,
                path.parent,
            )
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._wait()

    def finish(self) -> None:
        """Wait for the last write.

        Raises:
            AutosaveError: a write has failed.
        """
        self._wait()
        if self._error is not None:
            raise self._error

    def step(self) -> None:
        """Have the file written if the last control step has learned anything.

        Raises:
            AutosaveError: an earlier write has failed.
        """
        if self._error is not None:
            raise self._error
        learned = self._agent.map, self._agent.vision.memory
        if all(new is old for new, old in zip(learned, self._learned, strict=True)):
            return
        self._learned = learned
        with self._changed:
            self._waiting = self._agent.memory
            self._changed.notify()

    def _wait(self) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify()
        self._thread.join()

    def _write(self) -> None:
        """Write the newest memory whenever there is one, until the context ends."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting is not None or self._closed)
                memory, self._waiting = self._waiting, None
            if memory is None:
                return
            try:
                write_memory(self._path, memory, self._agent.nominal_map)
                self.written = memory
            except (OSError, ValueError) as error:
                self._error = AutosaveError(
                    f"What the agent has learned cannot be written to {os.fspath(self._path)} "
                    f"({error})."
                )
                return

"""Tasks on a Ray cluster; needs the extra ``[cluster]``.

A task may run on any node, and runs again on another one if its node dies. From a checkout the code
is sent to the nodes; an installed package must have the same version on every node. Results return
to the calling process, so the nodes need no shared folder.
"""

from __future__ import annotations

import logging
import socket
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from experiments.harness.common import ROOT
from experiments.harness.errors import ExperimentError

NOT_SENT = ["/docs", "/tests", "/experiments/figures", "/experiments/results"]
"""Folders that are not sent to the nodes, in addition to those that git ignores."""
TIMEOUT = 10.0
"""Longest wait for a connection [s]."""

Timed = Callable[[Callable[..., Any], tuple[Any, ...]], tuple[Any, float]]


def on_cluster(
    address: str, timed: Timed, work: Callable[..., Any], tasks: Mapping[str, tuple[Any, ...]]
) -> Iterator[tuple[str, Any, float]]:
    """Yield name, result and duration [s] of each task as it ends.

    Args:
        address: of the cluster in Ray's notation: "auto", "host:port" or "ray://host:port".
        timed: runs ``work`` with arguments; returns its result and duration.
        work: a function of a module.
        tasks: arguments by name of the task.

    Raises:
        ExperimentError: Ray is not installed, or no cluster answers at ``address``.
    """
    try:
        import ray
    except ImportError:
        raise ExperimentError(
            "A cluster needs Ray, which is not installed: pip install 'kengoro[cluster]'."
        ) from None
    _check_reachable(address)
    try:
        environment = _environment(ROOT)
        ray.init(address, runtime_env=environment, log_to_driver=False, logging_level=logging.ERROR)
    except ConnectionError as error:
        raise _no_answer(address, error) from None
    try:
        # Retry after the loss of a worker or node only, not after an exception of the task.
        remote = ray.remote(num_cpus=1, max_retries=-1, retry_exceptions=False)(timed)
        waiting = {remote.remote(work, arguments): name for name, arguments in tasks.items()}
        while waiting:
            [done], _ = ray.wait(list(waiting), num_returns=1)
            yield waiting.pop(done), *ray.get(done)
    finally:
        ray.shutdown()


def _check_reachable(address: str) -> None:
    """Raise within `TIMEOUT` where nothing answers; Ray itself would wait for minutes."""
    if address == "auto":
        return
    host, _, port = address.removeprefix("ray://").rpartition(":")
    try:
        socket.create_connection((host.strip("[]"), int(port)), TIMEOUT).close()
    except (OSError, ValueError) as error:
        raise _no_answer(address, error) from None


def _no_answer(address: str, error: Exception) -> ExperimentError:
    return ExperimentError(f"No Ray cluster answers at {address!r}: {error}.")


def _environment(root: Path) -> dict[str, Any]:
    """Runtime environment of the workers: the checkout, if there is one."""
    if not (root / "pyproject.toml").exists():
        return {}
    return {"working_dir": str(root), "excludes": NOT_SENT}

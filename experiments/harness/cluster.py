"""A Ray cluster that does the work of a sweep; extra ``[cluster]``.

Every task may run on any node, and again on another one if its node dies. In a checkout the code
is sent along; where the package is installed, every node needs the same version. Results come back
to whoever asked, so that nodes share no folder.
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
"""Beside what git ignores."""
TIMEOUT = 10.0
"""How long an address is waited for [s]."""

Timed = Callable[[Callable[..., Any], tuple[Any, ...]], tuple[Any, float]]


def on_cluster(
    address: str, timed: Timed, work: Callable[..., Any], tasks: Mapping[str, tuple[Any, ...]]
) -> Iterator[tuple[str, Any, float]]:
    """Name, result and time [s] of each task, in the order in which they end.

    Args:
        address: of the cluster, as Ray takes it: "auto", "host:port" or "ray://host:port".
        timed: runs ``work`` with arguments.
        work: a function of a module.
        tasks: arguments by name.

    Raises:
        ExperimentError: Ray is not installed, or no cluster answers at ``address``.
    """
    try:
        import ray
    except ImportError:
        raise ExperimentError(
            "A cluster needs Ray, which is not installed: pip install 'kengoro[cluster]'."
        ) from None
    _knock(address)
    try:
        environment = _environment(ROOT)
        ray.init(address, runtime_env=environment, log_to_driver=False, logging_level=logging.ERROR)
    except ConnectionError as error:
        raise _silent(address, error) from None
    try:
        # Only the loss of a worker or of its node is a reason to try again.
        remote = ray.remote(num_cpus=1, max_retries=-1, retry_exceptions=False)(timed)
        waiting = {remote.remote(work, arguments): name for name, arguments in tasks.items()}
        while waiting:
            [done], _ = ray.wait(list(waiting), num_returns=1)
            yield waiting.pop(done), *ray.get(done)
    finally:
        ray.shutdown()


def _knock(address: str) -> None:
    """Ray waits for minutes for a cluster that is not there."""
    if address == "auto":
        return
    host, _, port = address.removeprefix("ray://").rpartition(":")
    try:
        socket.create_connection((host.strip("[]"), int(port)), TIMEOUT).close()
    except (OSError, ValueError) as error:
        raise _silent(address, error) from None


def _silent(address: str, error: Exception) -> ExperimentError:
    return ExperimentError(f"No Ray cluster answers at {address!r}: {error}.")


def _environment(root: Path) -> dict[str, Any]:
    """What workers run in: the checkout, if there is one."""
    if not (root / "pyproject.toml").exists():
        return {}
    return {"working_dir": str(root), "excludes": NOT_SENT}

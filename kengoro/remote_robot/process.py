"""Starts a simulated robot in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from kengoro.errors import UsageError
from kengoro.remote_robot.client import RemoteRobot
from kengoro.remote_robot.token import VARIABLE, new_token


@contextmanager
def robot_process(
    task: str, seed: int | None, period: float | None = None
) -> Iterator[RemoteRobot]:
    """A simulated robot in a process of its own, and its driver.

    Args:
        task: of the environment, such as "Posture".
        seed: of the actual robot; None for the nominal model.
        period: control period of the robot's own clock [s]; None for a robot that waits for each
            command, which gives the same bits on every run.

    Raises:
        UsageError: the process of the robot ended at its start.
    """
    token = new_token()
    options = [] if seed is None else ["--seed", str(seed)]
    options += [] if period is None else ["--period", str(period)]
    # Not multiprocessing, which imports the caller's script again in the new process.
    process = subprocess.Popen(
        [sys.executable, "-m", __package__ or "", task, "--sessions", "1", *options],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path)), VARIABLE: token},
        stdout=subprocess.PIPE,
    )
    with process:
        assert process.stdout is not None
        port = process.stdout.readline()
        if not port:
            raise UsageError(f"The process of the robot ended at its start, with task {task!r}.")
        robot = RemoteRobot(int(port), token=token)
        try:
            yield robot
        finally:
            robot.stop()

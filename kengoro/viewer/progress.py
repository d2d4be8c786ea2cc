"""Progress bar and film of a robot's trial."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from rich import get_console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from kengoro.session import Session
from kengoro.viewer.video import Video

VIDEO_PERIOD = 0.2
"""Time between two frames of the film [s]; the film runs five times as fast as the robot."""

USUAL_TIME = 120.0
"""Simulated time that a trial usually takes [s]; the length of the bar."""

ProgressCallback = Callable[[str, float], None]
"""Called with the stage and the simulated time [s]."""


def film_and_progress(film: Video | None, progress: ProgressCallback) -> Callable[[Session], None]:
    """Make a callback for a session's steps that reports progress and adds frames to a film.

    Args:
        film: receives a frame of the agent's camera and one of the scene every `VIDEO_PERIOD`;
            None without a film.
        progress: called every `VIDEO_PERIOD`.

    Returns:
        The callback, for `Session`.
    """

    def watch(session: Session) -> None:
        steps = round(session.time / VIDEO_PERIOD, 6)
        if not steps.is_integer():
            return
        progress(session.stage, session.time)
        if film is not None:
            outside = session.env.render()
            frame = session.observation["frame"]
            film.add(frame, np.asarray(outside), session.stage, f"{session.time:5.1f} s")

    return watch


@contextmanager
def stage_bar(robot: str) -> Iterator[ProgressCallback]:
    """Show a bar with the stage of a trial and its simulated time; a line for each stage where
    there is no terminal.

    Args:
        robot: name of the robot, shown at the left.

    Yields:
        The callback that moves the bar.
    """
    if not get_console().is_terminal:
        printed: set[str] = set()

        def line(stage: str, at: float) -> None:
            if stage and stage not in printed:
                printed.add(stage)
                print(f"{robot} {stage}, {at:.0f} s simulated", flush=True)

        yield line
        return
    columns = (
        TextColumn(f"{robot} {{task.description}}"),
        BarColumn(),
        TextColumn("{task.completed:.0f} s simulated"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=get_console()) as bar:
        task = bar.add_task("starts", total=USUAL_TIME)
        yield lambda stage, at: bar.update(task, description=f"{stage:<33}", completed=at or None)
        bar.update(task, description=f"{'is done':<33}", completed=USUAL_TIME)


def no_progress(stage: str, time: float) -> None:
    """A `ProgressCallback` that shows nothing."""

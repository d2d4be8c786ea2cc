"""What a bystander is told while the can is grasped: the live bar, the video."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from rich import get_console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from kengoro.session import Session
from kengoro.viewer.video import Video

VIDEO_PERIOD = 0.2
"""Time between two pictures of the video [s]; it runs five times as fast as the robot."""

USUAL_TIME = 120.0
"""Time that a trial takes, roughly, for the bar [s of the robot's time]."""

Tell = Callable[[str, float], None]
"""(stage, simulated time [s])"""


def watcher(film: Video | None, tell: Tell) -> Callable[[Session], None]:
    """Passes on what the robot does, every `VIDEO_PERIOD`."""

    def watch(session: Session) -> None:
        steps = round(session.time / VIDEO_PERIOD, 6)
        if not steps.is_integer():
            return
        tell(session.stage, session.time)
        if film is not None:
            outside = session.env.render()
            frame = session.observation["frame"]
            film.add(frame, np.asarray(outside), session.stage, f"{session.time:5.1f} s")

    return watch


@contextmanager
def stage_bar(robot: str) -> Iterator[Tell]:
    """A bar that tells what the robot does and how much of its time has gone.

    Args:
        robot: how it is called.
    """
    columns = (
        TextColumn(f"{robot} {{task.description}}"),
        BarColumn(),
        TextColumn("{task.completed:.0f} s of its time"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=get_console()) as bar:
        task = bar.add_task("wakes up", total=USUAL_TIME)
        yield lambda stage, at: bar.update(task, description=f"{stage:<33}", completed=at or None)
        bar.update(task, description=f"{'is done':<33}", completed=USUAL_TIME)


def no_progress(stage: str, time: float) -> None:
    """A `Tell` for robots that work unseen."""

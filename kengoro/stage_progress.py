"""Progress of a command: a bar for each of its stages, or lines where there is no terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn


@contextmanager
def progress_of(stages: Sequence[str]) -> Iterator[Callable[[str, float, str], None]]:
    """Show how far stages are: a bar for each, or lines where there is no terminal.

    Yields:
        Function to call with a stage, the share that is done, and a short text.
    """
    console = Console()
    if not console.is_terminal:
        shown = dict.fromkeys(stages, -1)

        def line(stage: str, share: float, text: str) -> None:
            if (tenth := int(10.0 * share)) > shown[stage] or (share == 0.0 and text):
                shown[stage] = tenth
                print(f"{stage}: {share:.0%} {text}".rstrip(), flush=True)

        yield line
        return
    columns = (
        TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn(),
        TextColumn("{task.fields[text]}"),
    )  # fmt: skip
    with Progress(*columns, console=console) as bar:
        tasks = {name: bar.add_task(name, total=1.0, text="", start=False) for name in stages}

        def move(stage: str, share: float, text: str) -> None:
            bar.start_task(tasks[stage])
            bar.update(tasks[stage], completed=share, text=text)

        yield move

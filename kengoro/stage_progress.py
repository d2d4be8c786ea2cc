"""Progress of a command: a bar for each of its stages, or lines where there is no terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn


def _lines(stages: Sequence[str]) -> Callable[[str, float, str], None]:
    """The function that prints lines."""
    tenths, shares = dict.fromkeys(stages, -1), dict.fromkeys(stages, 0.0)
    printed: set[tuple[str, str]] = set()

    def line(stage: str, share: float, text: str) -> None:
        tenth, is_still = int(10.0 * share), share == shares[stage]
        is_new = bool(text) and (stage, text) not in printed
        if tenth > tenths[stage] or (is_still and is_new):
            tenths[stage] = max(tenth, tenths[stage])
            printed.add((stage, text))
            print(f"{stage}: {share:.0%} {text}".rstrip(), flush=True)
        shares[stage] = share

    return line


@contextmanager
def progress_of(stages: Sequence[str]) -> Iterator[Callable[[str, float, str], None]]:
    """Show how far stages are: a bar for each, or lines where there is no terminal.

    A line is printed for each tenth of a stage, and once for each text of a stage that has not
    moved since the call before, such as the one that names what is done next.

    Yields:
        Function to call with a stage, the share that is done, and a short text.
    """
    console = Console()
    if not console.is_terminal:
        yield _lines(stages)
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

"""`kengoro dataset`: grasps of robots that have learned, for those who train policies."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from kengoro.demonstrations.dataset import Plan, Progress, claim, make_datasets
from kengoro.demonstrations.minari import NAME
from kengoro.demonstrations.robot import MOST
from kengoro.errors import UsageError
from kengoro.stage_progress import progress_of
from kengoro.trained_maps import trained_map

STAGE = "grasps"


@dataclass(frozen=True)
class Args:
    """Grasps of robots that have learned, as a LeRobot and as a Minari data set.

    Each robot learns once, as in `kengoro demo`; then it grasps the can at new positions. A stopped
    command goes on with the robots that are missing.

    Attributes:
        robots: seeds of the actual robots, as A-B or A.
        episodes: number of grasps in all; each robot makes the same number.
        out: folder of both data sets.
        jobs: number of processes; the data do not depend on it.
    """

    robots: str = "0-19"
    episodes: int = 200
    out: Path = Path("out/dataset")
    jobs: int = 1


def main(args: Args) -> None:
    """Make the data sets, and print what is in them."""
    console = Console()
    plan = plan_of(args)
    claim(args.out, plan)
    with console.status("Training the map of the nominal model (half a minute, once) ..."):
        trained_map()
    with progress_of((STAGE,)) as show:
        found = make_datasets(plan, args.out, _counted(show, args.episodes), args.jobs)
    lifted = sum(episode.lifted for robot in found for episode in robot.episodes)
    steps = sum(len(episode) for robot in found for episode in robot.episodes)
    console.print(
        f"The can was lifted in {lifted} of {args.episodes} episodes, {steps} control steps.\n"
        f"LeRobot: {args.out / 'lerobot'}\n"
        f"Minari: {NAME} with MINARI_DATASETS_PATH={args.out / 'minari'}",
        highlight=False,
        soft_wrap=True,
    )


def plan_of(args: Args) -> Plan:
    """What the data sets hold.

    Raises:
        UsageError: an argument is out of its range.
    """
    match = re.fullmatch(r"(\d+)(?:-(\d+))?", args.robots)
    first, last = (int(match[1]), int(match[2] or match[1])) if match else (0, -1)
    if last < first:
        raise UsageError(f"Robots are {args.robots!r}; give one such as 3 or a range such as 0-9.")
    count = last - first + 1
    if args.episodes < 1:
        raise UsageError(f"Episodes are {args.episodes}, but at least 1 is needed.")
    if args.episodes % count:
        raise UsageError(
            f"Episodes are {args.episodes}, but must be a multiple of the {count} robots."
        )
    if args.episodes // count > MOST:
        raise UsageError(f"A robot can make at most {MOST} episodes.")
    if args.jobs < 1:
        raise UsageError(f"Jobs are {args.jobs}, but at least 1 is needed.")
    return Plan(tuple(range(first, last + 1)), args.episodes // count)


def _counted(show: Callable[[str, float, str], None], episodes: int) -> Progress:
    """Progress by episodes, shown as that of a stage."""
    done = 0.0

    def progress(text: str, by: float) -> None:
        nonlocal done
        done += by
        show(STAGE, done / episodes, text)

    return progress

"""What both kinds of learning share: seeds of episodes, and how a run goes.

The can's position follows from an episode's seed. Judged episodes are never learned from.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from kengoro.demonstrations.robot import episode_seed

ROWS = 67
"""Longest duration of an episode in periods of the camera; the agent takes 65 to 67."""
LEARNED = 10**8
"""Seeds of episodes to learn from begin here; those of `episode_seed` are smaller."""
MOST = 10**4
"""Most episodes to learn from of a seed of the training."""


def judged(robot: int | None, count: int) -> list[int]:
    """Seeds of judged episodes, which those of `clone-grasp` are, too.

    Args:
        robot: seed of the actual robot; None: the drawing.
        count: their number.
    """
    return [episode_seed(robot, number) for number in range(count)]


def demonstrated(seed: int, number: int) -> int:
    """Seed of an episode to learn from, of a seed of the training."""
    return LEARNED + MOST * seed + number


class Run(NamedTuple):
    """Where and how to run.

    Attributes:
        out: folder of the results.
        key: identifies the code that results depend on.
        jobs: number of parallel processes.
        cache: folder of trained maps.
    """

    out: Path
    key: str
    jobs: int
    cache: Path | None


Learned = tuple[dict[int, dict[str, Any]], float]
"""Results by seed, and the duration of all tasks [s].

Entries of a result: ``at``, the number of demonstrations or rows after which the policy was judged;
``lifted``, whether the can was lifted in each episode on the drawing, for each of them; ``robots``,
the same at the end by robot. Policies by camera have ``cans``, too: ``seen`` and ``errors`` of
`Lifts` by robot, and on the drawing.
"""

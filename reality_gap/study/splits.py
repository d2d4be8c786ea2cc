"""Splits: which readings serve to fit parameters, to select candidates, and to report the gain.

A log is cut into blocks of 0.25 s, or of a third of the time between two restarts, so that the
error of each state that replays begin in shows in the readings that it is inferred from. The blocks
take the roles fit, fit, selection, report in turn. Whole episodes would separate the splits more
strictly, but an event that happens once, such as an external push, lies in one episode only; it
could then be fitted or reported, not both. A cause has few parameters and a block has hundreds of
readings, so that little information leaks from one block to the next.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reality_gap.study.measurements import BLOCK, Measured
from reality_gap.types import Ints

FIT, SELECT, REPORT = 0, 1, 2
TURN = (FIT, FIT, SELECT, REPORT)
"""Roles of successive blocks."""


def split(measured: Measured) -> NDArray[np.int64]:
    """Return the role of each reading, shape (n,): `FIT`, `SELECT` or `REPORT`."""
    return np.array(TURN)[turn(measured)]


def turn(measured: Measured) -> Ints:
    """Return the position of each reading's block in `TURN`, shape (n,)."""
    block = np.floor(measured.time / measured.block).astype(int) + measured.episode
    return np.asarray(block % len(TURN))


def blocks(measured: Measured) -> Ints:
    """Return the number of the block of each reading, from 0 on, shape (n,)."""
    block = np.column_stack([measured.episode, np.floor(measured.time / measured.block)])
    return np.unique(block, axis=0, return_inverse=True)[1].ravel()


def hidden_block(episode: int, time: float, length: float = BLOCK) -> tuple[float, float] | None:
    """Return begin and end of the block at a time if it is of the report split [s].

    None for a time before the episode.

    Args:
        episode: index of the episode.
        time: time from the first command of the episode [s].
        length: of a block [s].
    """
    block = int(np.floor(time / length))
    if time < 0.0 or TURN[(block + episode) % len(TURN)] != REPORT:
        return None
    return block * length, (block + 1) * length

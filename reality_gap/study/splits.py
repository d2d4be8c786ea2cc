"""Splits: which readings serve to fit parameters, to select candidates, and to report the gain.

A log is cut into blocks of `BLOCK` seconds. The blocks take the roles fit, fit, selection, report
in turn. Whole episodes would separate the splits more strictly, but an event that happens once,
such as an external push, lies in one episode only; it could then be fitted or reported, not both.
A cause has few parameters and a block has hundreds of readings, so that little information leaks
from one block to the next.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reality_gap.study.measurements import Measured
from reality_gap.types import Ints

FIT, SELECT, REPORT = 0, 1, 2
TURN = (FIT, FIT, SELECT, REPORT)
"""Roles of successive blocks."""
BLOCK = 0.25
"""Length of a block [s]."""


def split(measured: Measured) -> NDArray[np.int64]:
    """Return the role of each reading, shape (n,): `FIT`, `SELECT` or `REPORT`."""
    return np.array(TURN)[turn(measured)]


def turn(measured: Measured) -> Ints:
    """Return the position of each reading's block in `TURN`, shape (n,)."""
    block = np.floor(measured.time / BLOCK).astype(int) + measured.episode
    return np.asarray(block % len(TURN))


def blocks(measured: Measured) -> Ints:
    """Return the number of the block of each reading, from 0 on, shape (n,)."""
    block = np.column_stack([measured.episode, np.floor(measured.time / BLOCK)])
    return np.unique(block, axis=0, return_inverse=True)[1].ravel()


def hidden_block(episode: int, time: float) -> tuple[float, float] | None:
    """Return begin and end of the block at a time if it is of the report split [s].

    None for a time before the episode.

    Args:
        episode: index of the episode.
        time: time from the first command of the episode [s].
    """
    block = int(np.floor(time / BLOCK))
    if time < 0.0 or TURN[(block + episode) % len(TURN)] != REPORT:
        return None
    return block * BLOCK, (block + 1) * BLOCK

"""Which readings serve to fit, to choose among rivals, and to report.

A log is cut into short blocks of time that take turns: fit, fit, choose, report. Whole episodes
would part the readings more strictly, but what happens once (a push, a wire that gives) lies in
one episode only, and could then be fitted or reported, never both. Causes have a handful of
parameters and blocks hundreds of readings, so that little leaks from one to the next.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reality_gap.study.measurements import Measured

FIT, CHOOSE, REPORT = 0, 1, 2
TURN = (FIT, FIT, CHOOSE, REPORT)
BLOCK = 0.25
"""Length of a block [s]."""


def split(measured: Measured) -> NDArray[np.int64]:
    """The role of each reading (n,): `FIT`, `CHOOSE` or `REPORT`."""
    block = np.floor(measured.time / BLOCK).astype(int) + measured.episode
    return np.array(TURN)[block % len(TURN)]

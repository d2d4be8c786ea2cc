"""What hooks add to numbers of the model at every step, on top of what stands there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reality_gap.types import Floats


class Extra:
    """Something added to cells of one of the model's arrays; several may add to the same cell.

    Args:
        values: the model's array (n,), such as ``model.tendon_frictionloss``.
        cells: an index into it, or several (k,), each once.
    """

    def __init__(self, values: Floats, cells: int | NDArray[np.int64]) -> None:
        self._values, self._cells = values, cells
        self._added: float | Floats = 0.0

    def write(self, amount: float | Floats) -> None:
        """Let there be ``amount`` (one number, or (k,)) more than without, until the next call."""
        self._values[self._cells] += amount - self._added
        self._added = amount

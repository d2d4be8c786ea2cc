"""Fast access to entries of MuJoCo arrays that are read in each step."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from kengoro_env.types import Floats

Index = slice | NDArray[np.int64]


def index_of(numbers: NDArray[np.int64]) -> Index:
    """Index of entries of an array: a slice, which is faster, if they are consecutive."""
    if len(numbers) and np.all(np.diff(numbers) == 1):
        return slice(int(numbers[0]), int(numbers[-1]) + 1)
    return numbers


def reader(array: Floats, index: Index) -> Callable[[], Floats]:
    """A function that copies the entries at ``index`` of the last axis of an array.

    The copies are contiguous, so that sums have the same bits for one robot and for many.
    """
    if isinstance(index, slice):
        return array[..., index].copy
    take: Callable[..., Floats] = array.take
    return partial(take, index, -1)

"""Entries of MuJoCo's arrays that are read in each step."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from kengoro_env.types import Floats

Index = slice | NDArray[np.int64]


def index_of(numbers: NDArray[np.int64]) -> Index:
    """An index of entries of an array: a slice, which is faster, where one follows the other."""
    if len(numbers) and np.all(np.diff(numbers) == 1):
        return slice(int(numbers[0]), int(numbers[-1]) + 1)
    return numbers


def reader(array: Floats, index: Index) -> Callable[[], Floats]:
    """What reads the entries at ``index`` of the last axis of an array that lives on: a copy.

    It lies side by side in memory, so that sums over it have the same bits for one and for many.
    """
    if isinstance(index, slice):
        return array[..., index].copy
    take: Callable[..., Floats] = array.take
    return partial(take, index, -1)

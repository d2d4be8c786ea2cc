"""Model overrides: amounts that hooks add to numbers of the model during a replay."""

from __future__ import annotations

import numpy as np

from reality_gap.types import Floats, Ints


class ModelOffset:
    """An amount on top of the values in one of the model's arrays.

    Several offsets may act on the same entry.

    Args:
        values: the model's array, shape (n,), such as ``model.tendon_frictionloss``.
        entries: index of an entry, or of several entries, shape (k,), each once.
    """

    def __init__(self, values: Floats, entries: int | Ints) -> None:
        self._values, self._entries = values, _indices(entries)
        self._added: float | Floats = 0.0

    def set(self, amount: float | Floats) -> None:
        """Replace the previous amount by ``amount``, a number or an array of shape (k,)."""
        self._values[self._entries] += amount - self._added
        self._added = amount


def _indices(entries: int | Ints) -> slice | Ints:
    """Return entries as a slice if they follow each other, which is faster in each step."""
    many = np.atleast_1d(np.asarray(entries))
    if len(many) and np.array_equal(many, many[0] + np.arange(len(many))):
        return slice(int(many[0]), int(many[0]) + len(many))
    return many

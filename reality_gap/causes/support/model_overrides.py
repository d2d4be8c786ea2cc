"""Model overrides: amounts that hooks add to numbers of the model during a replay."""

from __future__ import annotations

from reality_gap.types import Floats, Ints


class ModelOffset:
    """An amount on top of the values in one of the model's arrays.

    Several offsets may act on the same entry.

    Args:
        values: the model's array, shape (n,), such as ``model.tendon_frictionloss``.
        entries: index of an entry, or of several entries, shape (k,), each once.
    """

    def __init__(self, values: Floats, entries: int | Ints) -> None:
        self._values, self._entries = values, entries
        self._added: float | Floats = 0.0

    def set(self, amount: float | Floats) -> None:
        """Replace the previous amount by ``amount``, a number or an array of shape (k,)."""
        self._values[self._entries] += amount - self._added
        self._added = amount

"""Checks of numbers, seeds, masks and options that users give."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from kengoro_env.errors import ArgumentError
from kengoro_env.types import Bools, Floats


def whole(name: str, value: object, least: int, most: int | None = None) -> int:
    """A whole number of Python or NumPy, as an int.

    Args:
        name: name of the value in the error message.
        value: the value.
        least: smallest valid value.
        most: largest valid value; None: any.

    Raises:
        ArgumentError: it is not a whole number, or is out of range.
    """
    above = f"{least} or more" if most is None else f"from {least} to {most}"
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise ArgumentError(f"{name} must be a whole number, {above}, got {value!r}")
    number = int(value)
    if number < least or (most is not None and number > most):
        raise ArgumentError(f"{name} must be {above}, got {number}")
    return number


def real_numbers(value: object) -> Floats | None:
    """A value as a new array of float64; None: its entries are not real numbers, or are masked.

    Texts, truth values and other objects are no numbers, even where NumPy would convert them.
    """
    if _has_none_of_numbers(value):
        return None
    try:
        array: np.ndarray[Any, Any] = np.asarray(value)
        return array.astype(float) if array.dtype.kind in "iuf" else None
    except (TypeError, ValueError, RuntimeError):  # RuntimeError: a tensor that has a gradient
        return None


def _has_none_of_numbers(value: object) -> bool:
    """Whether a value, or an entry of its lists, is a truth value or masked."""
    if isinstance(value, list | tuple):
        return any(_has_none_of_numbers(part) for part in value)
    return isinstance(value, bool | np.bool_ | np.ma.MaskedArray)


def described(value: object) -> str:
    """A value in an error message: itself, or kind and dtype of an array."""
    if isinstance(value, np.ndarray):
        return f"a {type(value).__name__} of {value.dtype}"
    return repr(value)


def seed_or_none(seed: object) -> int | None:
    """Seed of an episode as an int; None: a random one.

    Raises:
        ArgumentError: it is not a whole number, or is negative.
    """
    return None if seed is None else whole("seed", seed, 0)


def seeds_of_many(seed: object, count: int) -> list[int | None]:
    """Seeds of ``count`` environments.

    Args:
        seed: seed of the first environment, to which each other adds its index; or a sequence of
            ``count`` seeds; None: random ones.
        count: number of environments.

    Raises:
        ArgumentError: an entry is not a seed, or there is another number of them.
    """
    if isinstance(seed, Sequence | np.ndarray) and not isinstance(seed, str | bytes):
        if np.ndim(seed) != 1 or len(seed) != count:
            raise ArgumentError(
                f"seed must be a whole number or have an entry for each of {count} environments, "
                f"got {seed!r}"
            )
        return [seed_or_none(each) for each in seed]
    first = seed_or_none(seed)
    return [None if first is None else first + i for i in range(count)]


def checked_mask(mask: object, count: int) -> Bools:
    """Which of ``count`` environments to reset (count,) bool.

    Raises:
        ArgumentError: it has another shape or other values than bools, or is nowhere True.
    """
    try:
        array: np.ndarray[Any, Any] = np.array(mask)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != (count,) or array.dtype != np.bool_:
        raise ArgumentError(
            f"reset_mask must be True or False for each of {count} environments, got {mask!r}"
        )
    if not array.any():
        raise ArgumentError("reset_mask must be True for one environment or more, it is all False")
    return array


def checked_mapping(options: object) -> dict[str, Any]:
    """Options of a reset as a new dict; None: none.

    Raises:
        ArgumentError: they are no dict.
    """
    if options is None:
        return {}
    if not isinstance(options, dict):
        raise ArgumentError(f"options must be a dict of values by name, got {options!r}")
    return dict(options)

"""Plain numbers of the arguments of cameras and markers, or one sentence about what they are."""

from __future__ import annotations

from numbers import Integral, Real
from reprlib import repr as short
from typing import Any, TypeGuard

import numpy as np

from jmm_agent.errors import AgentError


def is_whole(value: object) -> bool:
    """Whether a value is a whole number of Python or NumPy."""
    return isinstance(value, Integral) and not isinstance(value, bool)


def is_real(value: object) -> TypeGuard[Real]:
    """Whether a value is a real number, and not a truth value."""
    return isinstance(value, Real) and not isinstance(value, bool | np.bool_)


def whole(value: object, name: str) -> int:
    """A whole number; one like 640.0 is one.

    Args:
        value: the number.
        name: of the number, for the message.

    Raises:
        AgentError: the value is none.
    """
    number = _float(value) if is_real(value) else float("nan")
    if not number.is_integer():
        raise AgentError(f"{name} is {short(value)}; it must be a whole number.")
    return int(number)


def real(value: object, name: str) -> float:
    """A real number, which may be infinite or NaN.

    Args:
        value: the number.
        name: of the number, for the message.

    Raises:
        AgentError: the value is none.
    """
    if not is_real(value):
        raise AgentError(f"{name} is {short(value)}; it must be a number.")
    return _float(value)


def reals(values: Any, name: str) -> tuple[float, ...]:
    """Real numbers of a flat sequence or array.

    Args:
        values: the numbers.
        name: of the numbers, for the message.

    Raises:
        AgentError: they are none, or nested.
    """
    try:
        flat = tuple(values)
        return tuple(real(value, name) for value in flat)
    except (TypeError, AgentError):
        raise AgentError(f"{name} is {short(values)}; it must be a flat list of numbers.") from None


def _float(value: Real) -> float:
    """A real number; infinity for one that is too large."""
    try:
        return float(value)
    except OverflowError:
        return float("inf")

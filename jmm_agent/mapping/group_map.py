"""Network of one group of muscles (Kawaharazuka et al. 2018, sec. II-A).

It has one hidden layer of sigmoids. The layers are in rad and mm as in the paper; all methods use
rad and m.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats, Ints

METRES = 1e-3
"""Metres per millimetre."""
LARGEST = 1e30
"""Largest number of a map, and largest inverse of `scale`: none of their products overflows."""
ARRAYS = ("joint_index", "muscle_index", "centre", "scale", "W1", "b1", "W2", "b2")
"""Names of the arrays of a `GroupMap`."""


class MappingError(AgentError):
    """Arrays or postures that do not fit a map."""


class Layers(NamedTuple):
    """Layers of a network: all that training and learning change.

    Attributes:
        W1: weights of the hidden layer (H, n_in).
        b1: offsets of the hidden layer (H,).
        W2: weights of the output layer (k, H) [mm].
        b2: offsets of the output layer (k,) [mm].
    """

    W1: Floats
    b1: Floats
    W2: Floats
    b2: Floats


@dataclass(frozen=True, eq=False)
class GroupMap:
    """The network of one group: l [mm] = W2 sigmoid(W1 (q - centre) / scale + b1) + b2.

    Attributes:
        name: of the group.
        joint_index: indices of its inputs among all joints (n_in,).
        muscle_index: indices of its outputs among all muscles (k,).
        centre: middle of the inputs' limits (n_in,) [rad].
        scale: half range of the inputs' limits (n_in,) [rad].
        W1: weights of the hidden layer (H, n_in).
        b1: offsets of the hidden layer (H,).
        W2: weights of the output layer (k, H) [mm].
        b2: offsets of the output layer (k,) [mm].

    All arrays are read-only, those of numbers float64.

    Raises:
        MappingError: shapes do not fit together, or a number is not finite, or beyond `LARGEST`.
    """

    name: str
    joint_index: Ints
    muscle_index: Ints
    centre: Floats
    scale: Floats
    W1: Floats
    b1: Floats
    W2: Floats
    b2: Floats

    def __post_init__(self) -> None:
        for field in ARRAYS:
            kind = np.intp if field.endswith("index") else np.float64
            object.__setattr__(self, field, _frozen(getattr(self, field), kind))
        n, k, h = self.joint_index.size, self.muscle_index.size, self.b1.size
        shapes = ((n,), (k,), (n,), (n,), (h, n), (h,), (k, h), (k,))
        for field, shape in zip(ARRAYS, shapes, strict=True):
            array = getattr(self, field)
            if array.shape != shape:
                raise MappingError(
                    f"Group {self.name!r}: {field} has shape {array.shape}, but {shape} fits."
                )
            if not (np.abs(array) <= LARGEST).all():
                raise MappingError(
                    f"Group {self.name!r}: {field} has a number that is not finite, or beyond "
                    f"{LARGEST:g}."
                )
        if not (self.scale >= 1.0 / LARGEST).all():
            raise MappingError(f"Group {self.name!r}: scale must be {1.0 / LARGEST:g} or more.")

    def __reduce__(self) -> tuple[type[GroupMap], tuple[Any, ...]]:
        """Copies and pickles have read-only arrays, too."""
        return GroupMap, (self.name, *(getattr(self, field) for field in ARRAYS))

    @property
    def layers(self) -> Layers:
        """The layers; their arrays are read-only."""
        return Layers(self.W1, self.b1, self.W2, self.b2)

    def hidden(self, q: Floats) -> Floats:
        """Activities of the hidden units.

        Args:
            q: postures of all joints (B, n) [rad].

        Returns:
            Activities (B, H) in (0, 1).
        """
        return sigmoid((q[:, self.joint_index] - self.centre) @ self.inner.T + self.b1)

    def lengths(self, q: Floats) -> Floats:
        """Lengths of the group's muscles.

        Args:
            q: postures of all joints (B, n) [rad].

        Returns:
            Lengths (B, k) [m] relative to q = 0.
        """
        return METRES * (self.hidden(q) @ self.W2.T + self.b2)

    @cached_property
    def inner(self) -> Floats:
        """Hidden weights (H, n_in) [1/rad]."""
        return self.W1 / self.scale

    def output_jacobian(self, hidden: Floats) -> Floats:
        """Jacobian of the group's lengths by its inputs.

        Args:
            hidden: activities of the hidden units (B, H).

        Returns:
            Jacobian (B, k, n_in) [m/rad].
        """
        slope = METRES * hidden * (1.0 - hidden)
        if len(slope) == 1:
            return ((self.W2 * slope) @ self.inner)[None]
        pairs = self.W2.T[:, :, None] * self.inner[:, None, :]
        h, k, n = pairs.shape
        return (slope @ pairs.reshape(h, k * n)).reshape(-1, k, n)

    def torque_slope(self, hidden: Floats, tensions: Floats) -> Floats:
        """How the torques of tensions change with the group's inputs, by its moment arms.

        Args:
            hidden: activities of the hidden units (B, H).
            tensions: of the group's muscles (B, k) [N].

        Returns:
            Second derivatives of sum(lengths * tensions) by the inputs (B, n_in, n_in) [N m/rad].
        """
        bend = METRES * hidden * (1.0 - hidden) * (1.0 - 2.0 * hidden) * (tensions @ self.W2)
        h, n = self.inner.shape
        pairs = self.inner[:, :, None] * self.inner[:, None, :]
        return (bend @ pairs.reshape(h, n * n)).reshape(-1, n, n)


def sigmoid(z: NDArray[Any], out: NDArray[Any] | None = None) -> NDArray[Any]:
    """Logistic function, without overflow.

    Args:
        z: floats of any precision.
        out: array of the result, which may be ``z`` itself; a new one if left out.
    """
    result = np.negative(z, out=out)
    np.minimum(result, 80.0, out=result)
    np.exp(result, out=result)
    result += 1.0
    return np.divide(1.0, result, out=result)


def _frozen(array: Floats, kind: type) -> np.ndarray:
    """The array itself if it is read-only already, else a read-only copy."""
    array = np.asarray(array, dtype=kind)
    if array.flags.writeable:
        array = array.copy()
        array.setflags(write=False)
    return array

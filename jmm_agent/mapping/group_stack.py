"""All groups of a map side by side, for one posture.

A control step evaluates the map at one posture, and small NumPy calls then take most of the time.
Hidden units, lengths and moment arms of all groups are kept in one array each, so that only the
products of the layers need a call for each group. The bits are those of `GroupMap`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import accumulate, pairwise

import numpy as np

from jmm_agent.mapping.group_map import METRES, GroupMap, sigmoid
from jmm_agent.types import Floats


class GroupStack:
    """The networks of all groups (module docstring).

    Args:
        groups: the networks.
        muscles: number of muscles, m.
        joints: number of joints, n.
    """

    def __init__(self, groups: Sequence[GroupMap], muscles: int, joints: int) -> None:
        self._shape = muscles, joints
        self._inner = [group.inner for group in groups]
        self._outer = [group.W2 for group in groups]
        self._units = _slices(group.b1.size for group in groups)
        self._inputs = _slices(group.joint_index.size for group in groups)
        self._outputs = _slices(group.muscle_index.size for group in groups)
        self._joints = _joined([group.joint_index for group in groups], int)
        self._muscles = _joined([group.muscle_index for group in groups], int)
        self._centre = _joined([group.centre for group in groups])
        self._b1 = _joined([group.b1 for group in groups])
        self._b2 = _joined([group.b2 for group in groups])
        entries = [g.muscle_index[:, None] * joints + g.joint_index for g in groups]
        self._entries = _joined([entry.ravel() for entry in entries], int)

    def hidden(self, q: Floats) -> Floats:
        """Activities (1, H) of the hidden units of all groups.

        Args:
            q: joint angles (n,) [rad].
        """
        inputs = q[self._joints] - self._centre
        result = np.empty((1, self._b1.size))
        for units, joints, inner in zip(self._units, self._inputs, self._inner, strict=True):
            np.matmul(inputs[None, joints], inner.T, out=result[:, units])
        result += self._b1
        return sigmoid(result, out=result)

    def lengths(self, hidden: Floats) -> Floats:
        """Muscle lengths (m,) [m].

        Args:
            hidden: activities (1, H) as `hidden` returns them.
        """
        stacked = np.empty((1, self._b2.size))
        for units, muscles, outer in zip(self._units, self._outputs, self._outer, strict=True):
            np.matmul(hidden[:, units], outer.T, out=stacked[:, muscles])
        stacked += self._b2
        stacked *= METRES
        lengths = np.empty(self._shape[0])
        lengths[self._muscles] = stacked[0]
        return lengths

    def jacobian(self, hidden: Floats) -> Floats:
        """Muscle Jacobian (m, n) [m/rad].

        Args:
            hidden: activities (1, H) as `hidden` returns them.
        """
        slope = METRES * hidden * (1.0 - hidden)
        blocks = [
            ((outer * slope[:, units]) @ inner).ravel()
            for units, inner, outer in zip(self._units, self._inner, self._outer, strict=True)
        ]
        jacobian = np.zeros(self._shape)
        jacobian.ravel()[self._entries] = _joined(blocks)
        return jacobian


def _slices(sizes: Iterable[int]) -> list[slice]:
    """Slices of the parts of an array that have these sizes."""
    return [slice(*ends) for ends in pairwise(accumulate(sizes, initial=0))]


def _joined(arrays: Sequence[np.ndarray], kind: type = float) -> np.ndarray:
    return np.concatenate([np.empty(0, dtype=kind), *arrays])

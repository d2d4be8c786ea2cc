"""Feed-forward of tensions: by how much commands are shorter than the muscles that pull.

A motor pulls with T_bias + K_stiff (l - l_target), so a posture that needs tensions T is held at
its own lengths l only if l_target = l - (T - T_bias) / K_stiff. The nominal model knows T at the
ends of a movement; between them the difference is interpolated. Without it a robot sags until its
muscles pull enough, and one with few muscles may leave the posture for another balance.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jmm_agent.statics import Hold
from jmm_agent.trajectory import Trajectory
from jmm_agent.types import Floats


class FeedForward(NamedTuple):
    """Stretches along a trajectory.

    Attributes:
        stretches: by how much commands are shorter than the muscles at each point (K, m) [m].
        target: joint angles (n,) [rad] at the last point.
    """

    stretches: Floats
    target: Floats

    @classmethod
    def none(cls, muscles: int, target: Floats) -> FeedForward:
        """No stretch.

        Args:
            muscles: number of muscles, m.
            target: joint angles (n,) [rad].
        """
        return cls(np.zeros((1, muscles)), target)

    @classmethod
    def along(cls, begin: Floats, holds: Sequence[Hold], target: Floats) -> FeedForward:
        """Stretches of a trajectory.

        Args:
            begin: stretches at its beginning (m,) [m].
            holds: of the postures that it passes.
            target: joint angles (n,) [rad] at its end.
        """
        return cls(np.array([begin, *(hold.stretch for hold in holds)]), target)

    def at(self, trajectory: Trajectory, time: float) -> Floats:
        """Stretches (m,) [m]; none on a trajectory to another target.

        Args:
            trajectory: the present one.
            time: now [s].
        """
        if not np.array_equal(trajectory.points[-1], self.target):
            return np.zeros(self.stretches.shape[1])
        last = len(self.stretches) - 1
        position = max(0.0, last - trajectory.remaining(time))
        first = min(int(position), max(0, last - 1))
        before, after = self.stretches[first], self.stretches[min(first + 1, last)]
        return np.asarray(before + (position - first) * (after - before))

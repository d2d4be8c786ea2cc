"""Feed-forward of tensions: by how much commands are shorter than the map's lengths.

A motor pulls with T_bias + K (l - l_target), so a posture that needs tensions T is held only if

    l_target = l(theta, T) - (T - T_bias) / K.

Tensions follow from the map as learned so far (`TensionDistribution`), at some points of each
movement; between them they are interpolated. Without them a robot sags until its muscles pull
enough, and one with few muscles may leave the posture for another balance.
"""

from __future__ import annotations

import numpy as np

from jmm_agent.guard.faults import MotorControl
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.tension_distribution import TensionDistribution
from jmm_agent.trajectory import Trajectory
from jmm_agent.types import Floats

BETWEEN = 4
"""Number of points in each straight line of a movement at which tensions are computed."""


class FeedForward:
    """Tensions along a movement, and what they stretch.

    Args:
        distribution: tensions of a posture.
    """

    def __init__(self, distribution: TensionDistribution) -> None:
        self.distribution = distribution
        self.reset()

    def reset(self) -> None:
        """Forget the movement."""
        self._points: Floats | None = None
        self._map: JointMuscleMap | None = None
        self._low = np.empty(0)
        self._loads = self.distribution.loads
        self._known: dict[int, Floats] = {}
        self._now: Floats | None = None

    def tensions(
        self, jmm: JointMuscleMap, motors: MotorControl, trajectory: Trajectory, time: float
    ) -> Floats:
        """Tensions (m,) [N] at a point of a movement.

        They are computed anew for another movement, which they begin with those of now, and for
        another map, load or stiffness: at two points of it, so that no control step takes long.

        Args:
            jmm: the joint-muscle mapping as learned so far.
            motors: gains and limit.
            trajectory: the movement.
            time: now [s].
        """
        moved = trajectory.points is not self._points
        low = self.distribution.low(jmm, motors)
        loads = self.distribution.loads
        same = jmm is self._map and loads is self._loads and np.array_equal(low, self._low)
        if moved or not same:
            self._known = {0: self._now} if moved and self._now is not None else {}
            self._points, self._map = trajectory.points, jmm
            self._low, self._loads = low, loads
        last = len(trajectory.points) - 1
        position = BETWEEN * float(np.clip(last - trajectory.remaining(time), 0.0, last))
        first = min(int(position), BETWEEN * last - 1)
        before, after = (self._at(first + more, motors, trajectory.points) for more in (0, 1))
        self._now = before + (position - first) * (after - before)
        return self._now

    def _at(self, number: int, motors: MotorControl, points: Floats) -> Floats:
        """Tensions (m,) [N] at a numbered point of the movement."""
        if number not in self._known:
            first = min(number // BETWEEN, len(points) - 2)
            share = number / BETWEEN - first
            q = points[first] + share * (points[first + 1] - points[first])
            assert self._map is not None
            self._known[number] = self.distribution.at(self._map, motors, q).tensions
        return self._known[number]


def stretch(jmm: JointMuscleMap, motors: MotorControl, tensions: Floats) -> Floats:
    """By how much a command is shorter than f(theta), so that muscles pull (m,) [m].

    Args:
        jmm: the joint-muscle mapping; its tendons stretch, too.
        motors: gains and limit.
        tensions: that hold the posture (m,) [N].
    """
    return np.asarray((tensions - motors.bias) / motors.gains + jmm.stretch(tensions))

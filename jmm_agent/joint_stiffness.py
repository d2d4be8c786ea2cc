"""Stiffness of joints from that of muscles, and muscles from wanted joints.

A muscle pulls through its motor, with K_stiff, and its tendon, with a compliance c, in series.
Loads and tensions that stay as they are add a part, mostly negative:

    K_q = G' diag(1 / (1 / K_stiff + c)) G  +  sum_i T_i dG_i/dq - dtau/dq.

The stiffness of a joint is what a push at this joint alone shows, while the others yield as they
do: k_j = 1 / (K_q^-1)_jj. It is not linear in K_stiff, and wanted ones are found by Gauss-Newton
steps, each a linear least-squares problem within the limits of K_stiff.
"""

from __future__ import annotations

from collections.abc import Mapping
from ctypes import c_int
from typing import NamedTuple

import daqp
import numpy as np

from jmm_agent.types import Floats

NEAR = 0.05
"""Difference from a wanted stiffness that counts as reached, as a share of it [1]."""
KEEP = 0.01
"""Weight of the distance from the present K_stiff, as a share of it, beside wanted joints [1]."""
STEPS = 30
"""Largest number of Gauss-Newton steps."""


class PostureStiffness(NamedTuple):
    """What a posture's stiffness consists of.

    Attributes:
        arms: moment arms of the muscles that pull (m, n) [m/rad]; 0 for the others.
        rest: stiffness of loads and of tensions that stay (n, n) [N m/rad].
        compliance: of the tendons (m,) [m/N].
    """

    arms: Floats
    rest: Floats
    compliance: Floats

    def matrix(self, stiffness: Floats) -> Floats:
        """K_q (n, n) [N m/rad] at K_stiff (m,) [N/m]."""
        return self._matrix(self.in_series(stiffness))

    def in_series(self, stiffness: Floats) -> Floats:
        """Stiffness of motor and tendon (m,) [N/m] at K_stiff (m,) [N/m]."""
        return np.asarray(1.0 / (1.0 / stiffness + self.compliance))

    def joints(self, stiffness: Floats) -> Floats:
        """Stiffness of each joint (n,) [N m/rad] at K_stiff (m,) [N/m].

        It is 0 where the posture is not stable: then joints leave it by themselves.
        """
        matrix = self.matrix(stiffness)
        if not is_stable(matrix):
            return np.zeros(len(matrix))
        return np.asarray(1.0 / np.diag(np.linalg.inv(matrix)))

    def muscles_for(self, wanted: Mapping[int, float], start: Floats, limits: Floats) -> Floats:
        """K_stiff (m,) [N/m] that bring joints nearest to a wanted stiffness.

        Args:
            wanted: stiffness by the number of the joint [N m/rad].
            start: present K_stiff (m,) [N/m], from which it differs as little as possible.
            limits: lowest and highest K_stiff [N/m].
        """
        joints, goal = np.array(list(wanted)), np.array(list(wanted.values()))
        low, high = (self.in_series(np.full(len(start), limit)) for limit in limits)
        usual = self.in_series(start)
        series = np.clip(usual, low, high)
        if not is_stable(self._matrix(series)):
            series = high.copy()
        cost = self._cost(series, usual, joints, goal)
        for _ in range(STEPS):
            if not is_stable(self._matrix(series)):
                break
            change = self._step(series, usual, joints, goal, low, high)
            for _ in range(10):
                tried = np.clip(series + change, low, high)
                better = self._cost(tried, usual, joints, goal)
                if better < cost:
                    break
                change = 0.5 * change
            else:
                break
            done = cost - better < 1e-9 * cost
            series, cost = tried, better
            if done:
                break
        return np.clip(1.0 / (1.0 / series - self.compliance), *limits)

    def _matrix(self, series: Floats) -> Floats:
        return np.asarray(self.rest + (self.arms.T * series) @ self.arms)

    def _cost(self, series: Floats, usual: Floats, joints: Floats, goal: Floats) -> float:
        """What the steps make smaller; infinite where the posture is not stable."""
        matrix = self._matrix(series)
        if not is_stable(matrix):
            return np.inf
        found = 1.0 / np.diag(np.linalg.inv(matrix))[joints]
        away = (series - usual) / usual
        return float(np.sum((found / goal - 1.0) ** 2) + KEEP**2 * np.sum(away**2))

    def _step(
        self,
        series: Floats,
        usual: Floats,
        joints: Floats,
        goal: Floats,
        low: Floats,
        high: Floats,
    ) -> Floats:
        """Change of the stiffness in series (m,) [N/m] by a Gauss-Newton step."""
        inverse = np.linalg.inv(self._matrix(series))
        found = 1.0 / np.diag(inverse)[joints]
        # dk_j / ds_i = (k_j G_i K_q^-1 e_j)^2
        slopes = (self.arms @ inverse[:, joints]).T ** 2 * found[:, None] ** 2
        rows = np.vstack([slopes * usual / goal[:, None], KEEP * np.eye(len(series))])
        right = np.concatenate([1.0 - found / goal, -KEEP * (series - usual) / usual])
        x, _, flag, _ = daqp.solve(
            rows.T @ rows,
            -rows.T @ right,
            np.empty((0, len(series))),
            (high - series) / usual,
            (low - series) / usual,
            np.zeros(len(series), dtype=c_int),
        )
        return np.asarray(usual * x if flag > 0 else np.zeros_like(series))


class Stiffness(NamedTuple):
    """What `Agent.set_stiffness` asked of the motors.

    Attributes:
        muscles: K_stiff of each muscle (m,) [N/m].
        joints: stiffness of each joint at the target posture [N m/rad]; empty if loads are unknown.
        wanted: of joints [N m/rad]; empty if muscles were asked for.
        stable: whether the muscles hold the target posture against small displacements; None if
            unknown.
    """

    muscles: Floats
    joints: dict[str, float]
    wanted: dict[str, float]
    stable: bool | None

    @property
    def missed(self) -> str:
        """What was not reached, in a sentence; empty if all was."""
        if self.stable is False:
            return (
                "The posture is not stable with this stiffness: tensions and gravity bend the "
                "joints more than the muscles resist."
            )
        away = {
            joint: value
            for joint, value in self.wanted.items()
            if abs(self.joints[joint] - value) > NEAR * value
        }
        if not away:
            return ""
        parts = [
            f"joint {joint!r} has {self.joints[joint]:.3g} N m/rad, not {value:.3g}"
            for joint, value in away.items()
        ]
        return f"Within the limits of the muscles {'; '.join(parts)}."


def is_stable(matrix: Floats) -> bool:
    """Whether a stiffness (n, n) [N m/rad] opposes every displacement."""
    return bool(np.linalg.eigvalsh(matrix)[0] > 0.0)

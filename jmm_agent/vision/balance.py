"""Balance of the tensions and loads of a robot at rest, as evidence of its joint angles.

At rest the torques G' T of the muscles, with the map's Jacobian G and the measured tensions T, are
the torques tau that the nominal model needs to hold the posture: gravity, and springs of joints.
Friction takes a share of each muscle's torque, and a tension sensor has an offset, so the standard
deviation of a joint's error is

    s_j^2 = sum_m (share G_mj T_m)^2 + noise^2.

The errors have Student's t distribution instead of a Gaussian one, because friction and a joint
that leans on something give rows that are far off. A stop pushes a joint back with a torque that no
muscle shows; a row that is off in that direction counts as balanced.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from jmm_agent.errors import AgentError, positive
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.types import Floats

TELLING = 0.2
"""Mean square of loads and of the torques of tensions, in standard deviations of the balance, below
which both are too small to tell whether they balance [1]."""
DIFFERENCE = 1e-4
"""Change of a joint angle by which the slope of the balance is taken [rad]."""


class Loads(Protocol):
    """Torques that a nominal model needs to hold a posture, such as `kengoro_env`'s nominal arm."""

    def gravity(self, posture: Floats) -> Floats:
        """Torques of gravity and springs on the joints (n,) [N m].

        Args:
            posture: joint angles (n,) [rad].
        """


@dataclass(frozen=True)
class BalanceOptions:
    """How far tensions and loads of a robot at rest may disagree.

    Attributes:
        share: of each muscle's torque, standard deviation: friction and errors of moment arms [1].
        noise: standard deviation of a joint's torque beside that [N m].
        freedom: degrees of freedom of Student's t distribution of the errors.
        stop_margin: a joint this close to its stop may be held by it [rad].
        rests: number of newest rests without an observation that are remembered; 0: none.
        blind: number of such rests from which on the map is corrected before the hand is seen; 0:
            never.

    Raises:
        AgentError: a number is out of range.
    """

    share: float = 0.5
    noise: float = 0.3
    freedom: float = 4.0
    stop_margin: float = 0.03
    rests: int = 10
    blind: int = 5

    def __post_init__(self) -> None:
        positive("BalanceOptions", noise=self.noise, freedom=self.freedom)
        if not 0.0 <= self.share < np.inf:
            raise AgentError(f"BalanceOptions: share is {self.share}, but must be at least 0.")
        if self.rests < 0 or self.blind < 0 or self.blind > self.rests > 0:
            raise AgentError(
                f"BalanceOptions: rests is {self.rests} and blind is {self.blind}, but both must "
                "be at least 0, and blind at most rests."
            )


class Balance:
    """Rows of the balance.

    Args:
        jmm: the nominal map.
        loads: of the nominal model.
        limits: lowest and highest angle of each joint (n, 2) [rad].
        options: how far it may be off.
    """

    def __init__(
        self, jmm: JointMuscleMap, loads: Loads, limits: Floats, options: BalanceOptions
    ) -> None:
        self._map, self._loads, self._options = jmm, loads, options
        self._low = limits[:, 0] + options.stop_margin
        self._high = limits[:, 1] - options.stop_margin

    def cost(self, q: Floats, tensions: Floats) -> float:
        """Twice the negative log-likelihood of a rest.

        Args:
            q: joint angles (n,) [rad].
            tensions: measured (m,) [N].
        """
        arms = self._map.jacobian(q)
        tensions = np.maximum(tensions, 0.0)
        missed, variance = self._missed(arms, q, tensions), self._variance(arms, tensions)
        freedom = self._options.freedom
        likelihood = (freedom + 1.0) * np.log1p(missed**2 / (freedom * variance))
        return float(np.sum(likelihood * self._counts(q, missed)))

    def normal_equations(self, q: Floats, tensions: Floats) -> tuple[Floats, Floats]:
        """Gauss-Newton matrix (n, n) and gradient (n,) of a rest, half those of `cost`.

        Args:
            q: joint angles (n,) [rad].
            tensions: measured (m,) [N].
        """
        moves, tensions = DIFFERENCE * np.eye(len(q)), np.maximum(tensions, 0.0)
        points = np.vstack([q + moves, q - moves, q[None]])
        arms = self._map.jacobian(points)
        missed = np.array(
            [self._missed(arm, point, tensions) for arm, point in zip(arms, points, strict=True)]
        )
        count, freedom = len(q), self._options.freedom
        slope = (missed[:count] - missed[count:-1]).T / (2.0 * DIFFERENCE)
        here, variance = missed[-1], self._variance(arms[-1], tensions)
        weight = (freedom + 1.0) / (freedom * variance + here**2)
        weight = weight * self._counts(q, here)
        return (slope.T * weight) @ slope, slope.T @ (weight * here)

    def scale(self, angles: Floats, tensions: Sequence[Floats | None]) -> float:
        """Loads over the torques of the tensions, by least squares over all rests [1].

        It is 1 but for noise if tensions and loads are in the units and signs of the model. It is
        NaN where both are too small to tell.

        Args:
            angles: joint angles (K, n) [rad].
            tensions: measured (m,) [N], of each; None: unknown.
        """
        shared = own = loads = 0.0
        rows = 0
        for q, measured in zip(angles, tensions, strict=True):
            if measured is None:
                continue
            pulled, arms = np.maximum(measured, 0.0), self._map.jacobian(q)
            torques, load = pulled @ arms, self._loads.gravity(q)
            weight = 1.0 / self._variance(arms, pulled)
            shared += float(np.sum(weight * torques * load))
            own += float(np.sum(weight * torques**2))
            loads += float(np.sum(weight * load**2))
            rows += len(q)
        if loads == 0.0 or max(loads, own) <= TELLING * rows:
            return np.nan
        return shared / own if own > 0.0 else 0.0

    def _missed(self, arms: Floats, q: Floats, tensions: Floats) -> Floats:
        return tensions @ arms - self._loads.gravity(q)

    def _variance(self, arms: Floats, tensions: Floats) -> Floats:
        share, noise = self._options.share, self._options.noise
        return np.asarray(np.sum((share * arms * tensions[:, None]) ** 2, axis=0) + noise**2)

    def _counts(self, q: Floats, missed: Floats) -> Floats:
        """0 for a joint at a stop that pushes with the missing torque (n,) [N m], else 1 (n,)."""
        held = (q <= self._low) & (missed > 0.0) | (q >= self._high) & (missed < 0.0)
        return np.asarray(~held, dtype=float)

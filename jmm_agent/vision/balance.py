"""Balance of the tensions and loads of a robot at rest, as evidence of its joint angles.

At rest the torques G' T of the muscles, with the map's Jacobian G and the measured tensions T, are
the torques tau that the nominal model needs to hold a posture: gravity, and springs of joints. The
nominal moment arms are wrong by some E, because attachments lie elsewhere than drawn. That is the
largest error, and nearly the same at all rests. So joint j misses at rest k

    r_kj = sum_m (G_mj(theta_k) + E_mj) T_km - tau_j(theta_k),    E_mj ~ N(0, arm^2),

with a standard deviation of sqrt(noise^2 + sum_m (share G_mj T_km)^2) by friction and offsets of
tension sensors. The errors r have Student's t distribution instead of a Gaussian one, because a
joint that leans on something gives a row that is far off. A stop pushes a joint back with a torque
that no muscle shows; a row that is off in that direction counts as balanced. For given angles the
likeliest E is found by reweighted least squares.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from jmm_agent.errors import AgentError, positive
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.types import Floats

TELLING = 0.2
"""Mean square of loads and of the torques of tensions, in standard deviations of the balance, below
which both are too small to tell whether they balance [1]."""
DIFFERENCE = 1e-4
"""Change of a joint angle by which the slope of the loads is taken [rad]."""
STEPS = 20
"""Largest number of steps of the reweighted least squares."""
SAME = 1e-5
"""Change of the moment arms' errors, in their standard deviations, that ends these steps [1]."""


class Loads(Protocol):
    """Torques that a nominal model needs to hold a posture, such as `kengoro_env`'s nominal arm."""

    @property
    def acceleration(self) -> Floats:
        """Acceleration of gravity in the world's axes (3,) [m/s^2]."""

    def gravity(self, posture: Floats) -> Floats:
        """Torques of gravity and springs on the joints (n,) [N m].

        Args:
            posture: joint angles (n,) [rad].
        """


@dataclass(frozen=True)
class BalanceOptions:
    """How far tensions and loads of a robot at rest may disagree.

    Attributes:
        arm: standard deviation of the error of a moment arm, the same at all rests [m].
        share: of each muscle's torque, standard deviation: friction [1].
        noise: standard deviation of a joint's torque beside both [N m].
        freedom: degrees of freedom of Student's t distribution of the errors.
        stop_margin: a joint this close to its stop may be held by it [rad].
        rests: number of newest rests without an observation that are remembered; 0: none.
        blind: number of such rests from which on the map is corrected before the hand is seen; 0:
            never.

    Raises:
        AgentError: a number is out of range.
    """

    arm: float = 0.006
    share: float = 0.3
    noise: float = 0.3
    freedom: float = 4.0
    stop_margin: float = 0.03
    rests: int = 10
    blind: int = 5

    def __post_init__(self) -> None:
        positive("BalanceOptions", noise=self.noise, freedom=self.freedom)
        for name, value in (("arm", self.arm), ("share", self.share)):
            if not 0.0 <= value < np.inf:
                raise AgentError(f"BalanceOptions: {name} is {value}, but must be at least 0.")
        if self.rests < 0 or self.blind < 0 or self.blind > self.rests > 0:
            raise AgentError(
                f"BalanceOptions: rests is {self.rests} and blind is {self.blind}, but both must "
                "be at least 0, and blind at most rests."
            )


class _Rows(NamedTuple):
    """Rows of K rests.

    Attributes:
        missed: torques of tensions minus loads, with the nominal moment arms (K, n) [N m].
        variance: of these (K, n) [N^2 m^2].
        pulls: by how much a standard deviation of a moment arm changes them (n, K, m) [N m].
        at_stop: 1 at a joint's upper stop, -1 at its lower one, else 0 (K, n).
    """

    missed: Floats
    variance: Floats
    pulls: Floats
    at_stop: Floats


class _Balanced(NamedTuple):
    """Rows with the likeliest errors of moment arms.

    Attributes:
        cost: twice the negative log-likelihood.
        missed: with these moment arms (K, n) [N m].
        weight: of each row (K, n) [N^-2 m^-2]; 0 for a joint that its stop holds.
    """

    cost: float
    missed: Floats
    weight: Floats


class Balance:
    """Rows of the balance.

    Args:
        jmm: the nominal map.
        loads: of the nominal model; they depend on the posture alone.
        limits: lowest and highest angle of each joint (n, 2) [rad].
        options: how far it may be off.
    """

    def __init__(
        self, jmm: JointMuscleMap, loads: Loads, limits: Floats, options: BalanceOptions
    ) -> None:
        self._map, self._loads, self._options = jmm, loads, options
        self._known: dict[bytes, Floats] = {}
        self._low = limits[:, 0] + options.stop_margin
        self._high = limits[:, 1] - options.stop_margin
        self._arms = np.zeros((len(jmm.joints), len(jmm.muscles)))
        for group in jmm.groups:
            self._arms[np.ix_(group.joint_index, group.muscle_index)] = options.arm

    def cost(self, angles: Floats, tensions: Floats) -> float:
        """Twice the negative log-likelihood of rests, but for a constant.

        Args:
            angles: joint angles (K, n) [rad].
            tensions: measured (K, m) [N].
        """
        return self._balanced(self._rows(angles, np.maximum(tensions, 0.0))).cost

    def normal_equations(self, angles: Floats, tensions: Floats) -> tuple[Floats, Floats]:
        """Gauss-Newton matrix (K, n, K, n) and gradient (K, n) of rests, half those of `cost`.

        Args:
            angles: joint angles (K, n) [rad].
            tensions: measured (K, m) [N].
        """
        pulled = np.maximum(tensions, 0.0)
        rows = self._rows(angles, pulled)
        found, slopes = self._balanced(rows), self._slopes(angles, pulled)
        information = _information(rows, found.weight)
        matrix = np.einsum("kja,jkl,ljb->kalb", slopes, information, slopes, optimize=True)
        return matrix, np.einsum("kja,kj->ka", slopes, found.weight * found.missed)

    def mass(self, angles: Floats, tensions: Floats, weights: Floats) -> tuple[float, float]:
        """Mass of a load that the robot holds at some of the rests, and its standard deviation.

        The errors of moment arms are unknown, too; rests without the load determine most of them.

        Args:
            angles: joint angles (K, n) [rad].
            tensions: measured (K, m) [N].
            weights: torques of a load of 1 kg on the joints, as those of `Loads.gravity`, 0 at
                rests without it (K, n) [N m/kg].

        Returns:
            Mass and standard deviation [kg]; 0 and infinite if the weights are all 0.
        """
        rows, mass, spread = self._rows(angles, np.maximum(tensions, 0.0)), 0.0, np.inf
        for _ in range(STEPS):
            here = rows._replace(missed=rows.missed - mass * weights)
            information = _information(here, self._balanced(here).weight)
            known = float(np.einsum("kj,jkl,lj->", weights, information, weights))
            if known <= 0.0:
                return 0.0, np.inf
            change = float(np.einsum("kj,jkl,lj->", weights, information, here.missed)) / known
            mass, spread = mass + change, known**-0.5
            if abs(change) < SAME * spread:
                break
        return mass, spread

    def scale(self, angles: Floats, tensions: Floats) -> float:
        """Loads over the torques of the tensions, by least squares over all rests [1].

        It is 1 but for noise if tensions and loads are in the units and signs of the model. It is
        NaN where both are too small to tell.

        Args:
            angles: joint angles (K, n) [rad].
            tensions: measured (K, m) [N].
        """
        if len(angles) == 0:
            return np.nan
        pulled, arms = np.maximum(tensions, 0.0), self._map.jacobian(angles)
        torques = np.einsum("km,kmj->kj", pulled, arms)
        loads = np.array([self._loads.gravity(q) for q in angles])
        weight = 1.0 / self._variance(arms, pulled)
        own, least = np.sum(weight * torques**2), TELLING * torques.size
        if not loads.any() or max(np.sum(weight * loads**2), own) <= least:
            return np.nan
        return float(np.sum(weight * torques * loads) / own) if own > 0.0 else 0.0

    def _missed(self, arms: Floats, q: Floats, tensions: Floats) -> Floats:
        return tensions @ arms - self._loads.gravity(q)

    def _variance(self, arms: Floats, tensions: Floats) -> Floats:
        share, noise = self._options.share, self._options.noise
        return np.asarray(np.sum((share * arms * tensions[..., None]) ** 2, axis=-2) + noise**2)

    def _rows(self, angles: Floats, tensions: Floats) -> _Rows:
        """Rows of rests at angles (K, n) [rad] with tensions (K, m) [N] of at least 0."""
        arms = self._map.jacobian(angles)
        rests = zip(arms, angles, tensions, strict=True)
        missed = np.array([self._missed(*rest) for rest in rests]).reshape(angles.shape)
        at_stop = np.where(angles >= self._high, 1.0, 0.0) - (angles <= self._low)
        pulls = self._arms[:, None] * tensions
        return _Rows(missed, self._variance(arms, tensions), pulls, at_stop)

    def _balanced(self, rows: _Rows) -> _Balanced:
        """The rows with the likeliest errors of moment arms."""
        freedom, missed = self._options.freedom, rows.missed
        joints, _, muscles = rows.pulls.shape
        errors, turned = np.zeros((joints, muscles)), rows.pulls.transpose(0, 2, 1)
        weight = 1.0 / rows.variance
        for _ in range(STEPS):
            weighted = turned * weight.T[:, None]
            pull = np.einsum("jmk,kj->jm", weighted, rows.missed)
            moved = -np.linalg.solve(np.eye(muscles) + weighted @ rows.pulls, pull[..., None])
            change, errors = np.abs(moved[..., 0] - errors).max(), moved[..., 0]
            missed = rows.missed + np.einsum("jkm,jm->kj", rows.pulls, errors)
            free = rows.at_stop * missed >= 0.0
            weight = free * (freedom + 1.0) / (freedom * rows.variance + missed**2)
            if change < SAME:
                break
        likelihood = (freedom + 1.0) * np.log1p(missed**2 / (freedom * rows.variance))
        cost = float(np.sum(free * likelihood) + np.sum(errors**2))
        return _Balanced(cost, missed, weight)

    def _slopes(self, angles: Floats, tensions: Floats) -> Floats:
        """How the rows change with the angles (K, n, n) [N m/rad]; moment arms' errors do not."""
        loads = np.array([self._load_slope(q) for q in angles])
        return self._map.torque_slope(angles, tensions) - loads

    def _load_slope(self, q: Floats) -> Floats:
        """See `load_slope`; kept, because problems are compared at the same postures."""
        posture = q.tobytes()
        if posture not in self._known:
            if len(self._known) >= KEPT:
                self._known.clear()
            self._known[posture] = load_slope(self._loads, q)
        return self._known[posture]

    def __getstate__(self) -> dict[str, object]:
        return {**self.__dict__, "_known": {}}


def load_slope(loads: Loads, q: Floats) -> Floats:
    """How the loads change with the joint angles (n, n) [N m/rad].

    Args:
        loads: torques of the nominal model.
        q: joint angles (n,) [rad].
    """
    moves = DIFFERENCE * np.eye(len(q))
    changes = [loads.gravity(q + move) - loads.gravity(q - move) for move in moves]
    return np.array(changes).T / (2.0 * DIFFERENCE)


def _information(rows: _Rows, weight: Floats) -> Floats:
    """Inverse covariance of each joint's rows, with unknown moment arms (n, K, K) [N^-2 m^-2].

    Args:
        rows: of K rests.
        weight: of each row (K, n) [N^-2 m^-2].
    """
    weighted = weight.T[:, :, None] * rows.pulls
    inner = np.eye(rows.pulls.shape[2]) + rows.pulls.transpose(0, 2, 1) @ weighted
    explained = weighted @ np.linalg.solve(inner, weighted.transpose(0, 2, 1))
    return weight.T[:, :, None] * np.eye(weight.shape[0]) - explained


KEPT = 500
"""Number of postures whose slopes of the loads are kept."""

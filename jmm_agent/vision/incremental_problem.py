"""Costs of the incremental fit: of all observations, and of the newest while others are held.

Within a fit, networks, kinematics and kernel rows of a posture are computed again only if it has
moved. A group of muscles only enters the blocks of the joints that it spans.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jmm_agent.mapping.group_map import METRES
from jmm_agent.mapping.prior import UNKNOWN, GroupKernel, MapPrior, without_unknown
from jmm_agent.types import Floats, Ints
from jmm_agent.vision.marker_observation import (
    MarkerObservation,
    ObservationWeights,
    PoseResidual,
    residual_of,
)
from jmm_agent.vision.observation_fit import ObservationFitOptions


class Row(NamedTuple):
    """What belongs to one observation at a posture.

    Attributes:
        residual: of the measured pose (6,) [m, rad].
        slope: its Jacobian (6, n).
        lengths: by the nominal map (m,) [m].
        jacobian: of the lengths (m, n) [m/rad].
        features: of the prior (1 + H,) [m], for each group.
    """

    residual: Floats
    slope: Floats
    lengths: Floats
    jacobian: Floats
    features: tuple[Floats, ...]


class Rows:
    """Rows of observations, kept within a fit.

    Args:
        prior: prior of the map's error.
        marker_residual: residual of the marker's pose at a posture.
    """

    def __init__(self, prior: MapPrior, marker_residual: PoseResidual) -> None:
        self._prior, self._marker_residual = prior, marker_residual
        self._kept: dict[tuple[int, bytes], Row] = {}

    def at(self, observations: Sequence[MarkerObservation], angles: Floats) -> list[Row]:
        """Rows of K observations at angles (K, n) [rad]."""
        keys = [(id(found), q.tobytes()) for found, q in zip(observations, angles, strict=True)]
        new = [k for k, key in enumerate(keys) if key not in self._kept]
        if new:
            fresh = self._computed([observations[k] for k in new], angles[new])
            self._kept |= {keys[k]: row for k, row in zip(new, fresh, strict=True)}
        return [self._kept[key] for key in keys]

    def _computed(self, observations: Sequence[MarkerObservation], angles: Floats) -> list[Row]:
        jmm = self._prior.map
        lengths = np.empty((len(angles), len(jmm.muscles)))
        jacobian = np.zeros((*lengths.shape, len(jmm.joints)))
        features = []
        for rank, group in enumerate(jmm.groups):
            hidden = group.hidden(angles)
            lengths[:, group.muscle_index] = METRES * (hidden @ group.W2.T + group.b2)
            block = group.output_jacobian(hidden)
            jacobian[:, group.muscle_index[:, None], group.joint_index] = block
            features.append(self._prior.features(rank, hidden))
        return [
            Row(
                *residual_of(found, self._marker_residual, q),
                lengths[k],
                jacobian[k],
                tuple(group[k] for group in features),
            )
            for k, (found, q) in enumerate(zip(observations, angles, strict=True))
        ]


class IncrementalProblem:
    """Cost of joint angles (K, n) [rad] of all observations; see `ObservationProblem`.

    Args:
        observations: K observations.
        rows: kept within the fit.
        prior: prior of the map's error.
        options: noise levels.
        elongated: number of elongations of each muscle since each observation (K, m).

    Attributes:
        weights: weights of the measured poses and joint angles.
    """

    def __init__(
        self,
        observations: Sequence[MarkerObservation],
        rows: Rows,
        prior: MapPrior,
        options: ObservationFitOptions,
        elongated: Floats,
    ) -> None:
        self._observations, self._rows, self._prior = observations, rows, prior
        lengths = np.array([found.lengths for found in observations])
        self._lengths, self._elongated = without_unknown(lengths, elongated)
        self._joints = [group.joint_index for group in prior.map.groups]
        self._group = group_of_muscle(prior)
        self._newest: tuple[Floats, Sequence[GroupKernel]] | None = None
        self.weights = ObservationWeights(
            observations, options.position_noise, options.rotation_noise, options.joint_noise
        )

    def rows(self, angles: Floats) -> list[Row]:
        """Rows of all observations at angles (K, n) [rad]."""
        return self._rows.at(self._observations, angles)

    def kernels(self, angles: Floats) -> Sequence[GroupKernel]:
        """Kernels at angles (K, n) [rad]."""
        if self._newest is None or not np.array_equal(self._newest[0], angles):
            features = zip(*(row.features for row in self.rows(angles)), strict=True)
            stacked = [np.array(group) for group in features]
            kernels = self._prior.groups(angles, elongated=self._elongated, rows=stacked)
            self._newest = angles, kernels
        return self._newest[1]

    def missed(self, angles: Floats) -> Floats:
        """Lengths (K, m) [m] minus those of the nominal map at angles (K, n) [rad]."""
        return self._lengths - np.array([row.lengths for row in self.rows(angles)])

    def cost(self, angles: Floats) -> tuple[float, Floats]:
        """Cost at angles (K, n) [rad], and the residuals of the poses (K, 6) [m, rad]."""
        residuals = np.array([row.residual for row in self.rows(angles)])
        cost, missed = self.weights.cost(angles, residuals), self.missed(angles)
        for kernel in self.kernels(angles):
            own = missed[:, kernel.muscles]
            cost += float(np.sum(own * kernel.whiten(own)))
        return cost, residuals

    def normal_equations(self, angles: Floats) -> tuple[Floats, Floats]:
        """Gauss-Newton matrix (K n, K n) and gradient (K n,) at angles (K, n) [rad]."""
        count, joints = angles.shape
        rows, missed = self.rows(angles), self.missed(angles)
        jacobian = np.array([row.jacobian for row in rows])
        matrix, gradient = np.zeros((count, joints, count, joints)), np.zeros((count, joints))
        for k, (q, row) in enumerate(zip(angles, rows, strict=True)):
            own, pull = self.weights.normal_equations(k, q, row.residual, row.slope)
            matrix[k, :, k, :] += own
            gradient[k] += pull
        for kernel in self.kernels(angles):
            arms = jacobian[:, kernel.muscles]  # (K, muscles, n)
            gradient -= np.einsum("kmi,km->ki", arms, kernel.whiten(missed[:, kernel.muscles]))
            information = kernel.whiten(np.eye(count))
            crossed = self._joints[self._group[kernel.muscles[0]]]
            for i in crossed:
                for j in crossed:
                    matrix[:, i, :, j] += information * (arms[:, :, i] @ arms[:, :, j].T)
        size = count * joints
        return matrix.reshape(size, size), gradient.ravel()


class NewestProblem:
    """Cost of the joint angles (1, n) [rad] of the newest observation, while the others are held.

    Args:
        others: problem of the K - 1 others, K > 1.
        angles: their angles (K - 1, n) [rad].
        newest: the newest observation.
        rows: kept within the fit.
        prior: prior of the map's error.
        options: noise levels.
    """

    def __init__(
        self,
        others: IncrementalProblem,
        angles: Floats,
        newest: MarkerObservation,
        rows: Rows,
        prior: MapPrior,
        options: ObservationFitOptions,
    ) -> None:
        self._newest, self._rows, self._noise = newest, rows, prior.options.noise
        self._kernels, missed = others.kernels(angles), others.missed(angles)
        self._group, self._prior = group_of_muscle(prior), prior
        self._weighed = [kernel.whiten(missed[:, kernel.muscles]) for kernel in self._kernels]
        self.weights = ObservationWeights(
            [newest], options.position_noise, options.rotation_noise, options.joint_noise
        )

    def cost(self, angles: Floats) -> tuple[float, Floats]:
        """Cost at angles (1, n) [rad], and the residual of the pose (1, 6) [m, rad]."""
        (row,) = self._rows.at([self._newest], angles)
        cost = self.weights.cost(angles, row.residual[None])
        missed, variance = self._predicted(row)
        return cost + float(np.sum(missed**2 / variance)), row.residual[None]

    def normal_equations(self, angles: Floats) -> tuple[Floats, Floats]:
        """Gauss-Newton matrix (n, n) and gradient (n,) at angles (1, n) [rad]."""
        (row,) = self._rows.at([self._newest], angles)
        matrix, gradient = self.weights.normal_equations(0, angles[0], row.residual, row.slope)
        missed, variance = self._predicted(row)
        scaled = row.jacobian / variance[:, None]
        return matrix + row.jacobian.T @ scaled, gradient - scaled.T @ missed

    def _predicted(self, row: Row) -> tuple[Floats, Floats]:
        """Lengths (m,) [m] minus those predicted by the others, and the variance of that [m^2]."""
        missed = self._newest.lengths - row.lengths
        variance = np.full(len(missed), np.inf)  # of muscles that are left out
        for kernel, weighed in zip(self._kernels, self._weighed, strict=True):
            rank = int(self._group[kernel.muscles[0]])
            own = self._prior.completed(rank, row.features[rank][None], kernel.muscles)[0]
            shared = kernel.features @ own
            missed[kernel.muscles] -= shared @ weighed
            variance[kernel.muscles] = own @ own + self._noise**2 - shared @ kernel.whiten(shared)
        unknown = np.isnan(missed)
        return np.where(unknown, 0.0, missed), np.where(unknown, UNKNOWN, variance)


def group_of_muscle(prior: MapPrior) -> Ints:
    """Rank of the group of each muscle (m,)."""
    group = np.empty(len(prior.map.muscles), dtype=np.intp)
    for rank, one in enumerate(prior.map.groups):
        group[one.muscle_index] = rank
    return group

"""Gaussian prior of a map's error before anything was learned.

The map is corrected in its output layers only: delta(theta) = D phi(theta) with the features
phi = (1, centred hidden activities), scaled such that over typical postures the offset of a
muscle's length has the standard deviation `offset`, and its change with posture `shape`. All
muscles of a group share the kernel phi(theta)' phi(theta'). Each permanent elongation of a muscle
adds one unknown number of standard deviation `elongation` to all lengths that were measured before
it, at any posture. A zeroing of all lengths at another posture does the same for all muscles at
once, with the standard deviation `zeroing`; it counts as `MapPrior.zeroing_share` elongations.
Muscles may be left out, because they do not follow the joints, or have larger errors than others.

Where it is known how a length changes if a point of attachment of its muscle is displaced
(`PointWeights`), delta has a part for that, too: D = D_1 + s_p u W with independent standard normal
numbers u, a displacement of standard deviation s_p (`points`) of each point along each axis. That
says much more of what is usual than D_1 alone, which allows any smooth function.

A length that is NaN is unknown: its muscle was out of use, see `jmm_agent.muscles_in_use`. It
counts as one with infinitely many elongations since, which tells nothing (`without_unknown`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from jmm_agent.errors import AgentError, positive
from jmm_agent.mapping.group_map import METRES, GroupMap
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.types import Floats, Ints

UNKNOWN = 1e12
"""Variance of a length that tells nothing [m^2]."""


def without_unknown(lengths: Floats, elongated: Floats | None) -> tuple[Floats, Floats | None]:
    """Lengths of which each can be calculated with, and elongations that leave out the unknown.

    Args:
        lengths: measured (K, m) [m]; NaN where a muscle was out of use.
        elongated: number of elongations of each muscle since each posture (K, m); None: none.

    Returns:
        Lengths (K, m) [m] with 0 in place of NaN, and elongations (K, m) that are infinite there;
        both as they are if no length is unknown.
    """
    unknown = np.isnan(lengths)
    if not unknown.any():
        return lengths, elongated
    since = np.zeros(lengths.shape) if elongated is None else elongated
    return np.where(unknown, 0.0, lengths), np.where(unknown, np.inf, since)


def with_unknown(lengths: Floats, muscle: int) -> Floats:
    """Lengths (..., m) [m], in which that of a muscle is unknown.

    Args:
        lengths: measured (..., m) [m].
        muscle: its number.
    """
    lengths = lengths.copy()
    lengths[..., muscle] = np.nan
    return lengths


@dataclass(frozen=True)
class PriorOptions:
    """Standard deviations of the nominal model's errors and of elongations.

    Attributes:
        offset: of a muscle's length over all postures, because lengths are zeroed by hand [m].
        shape: of the change of a length with posture, because points of attachment differ [m].
        noise: of what the map cannot follow: friction, stretch, play [m].
        elongation: of one permanent elongation of a muscle [m].
        zeroing: of the change of a length when all lengths are zeroed anew [m].
        zero_posture: of each joint angle at which the lengths were zeroed [rad]. 0: it is not
            estimated, and `offset` holds for what it does to the lengths.
        zeroed_offset: of a muscle's length over all postures, once the posture is known at which
            the lengths were zeroed [m].
        zeroed_shape: `shape`, where the zero posture and the widths are learned [m].
        points: of the displacement of a point of attachment along each axis, where it is known
            what that does to the lengths [m].
        remaining_shape: `zeroed_shape`, where that is known, of what displacements leave [m].

    Raises:
        AgentError: one of the last five is out of range.
    """

    offset: float = 0.025
    shape: float = 0.005
    noise: float = 0.001
    elongation: float = 0.02
    zeroing: float = 0.012
    zero_posture: float = 0.25
    zeroed_offset: float = 0.003
    zeroed_shape: float = 0.0025
    points: float = 0.004
    remaining_shape: float = 0.0005

    def __post_init__(self) -> None:
        positive(
            "PriorOptions",
            zeroed_offset=self.zeroed_offset,
            zeroed_shape=self.zeroed_shape,
            points=self.points,
            remaining_shape=self.remaining_shape,
        )
        if not 0.0 <= self.zero_posture < np.inf:
            raise AgentError(
                f"PriorOptions: zero_posture is {self.zero_posture} rad, but must be at least 0."
            )


PointWeights = tuple[Floats, ...]
"""For each group of muscles, how the change of a length with the centred activities of the H hidden
units depends on the displacements of the muscle's points, P numbers in all (muscles, H, P) [1]."""


class GroupKernel:
    """Kernel at K postures plus noise, factorised, of muscles that share it.

    Args:
        muscles: indices of the muscles, which are of one group and were elongated at the same
            times.
        features: phi (K, F) [m], see `MapPrior.completed`.
        noise: standard deviation of each length (K,) [m].
        elongation: covariance (K, K) of the elongation of such a muscle since each posture [m^2].
        units: number of features of the shape, H, after that of the offset.
        product: of the features with themselves, Phi Phi' (K, K) [m^2].

    Attributes:
        muscles: as given.
        features: as given.
        elongation: as given.
        units: as given.
    """

    def __init__(
        self,
        muscles: Ints,
        features: Floats,
        noise: Floats,
        elongation: Floats,
        units: int,
        product: Floats,
    ) -> None:
        self.muscles, self.features, self.units = muscles, features, units
        self.elongation = elongation
        self._factor = cho_factor(product + elongation + np.diag(noise**2))

    @property
    def log_det(self) -> float:
        """Logarithm of the determinant of the covariance [m^2]."""
        return 2.0 * float(np.log(np.diag(self._factor[0])).sum())

    def whiten(self, residual: Floats) -> Floats:
        """(Phi Phi' + elongation + noise^2)^-1 residual, for residuals (K, ...) [m]."""
        return cho_solve(self._factor, residual)


class MapPrior:
    """Prior of the error of a map that was trained on the nominal model.

    Args:
        nominal_map: the map before learning, from which every correction is counted.
        postures: typical postures (N, n) [rad], N > 1, which set the scale of `shape`.
        options: standard deviations.
        points: what displaced points do to the lengths; None: it is unknown.

    Attributes:
        map: the nominal map.
        options: as given.
        points: as given.
        factors: errors of each muscle's map, in standard deviations of the others (m,) [1];
            infinite for a muscle that is left out of all kernels; None: all are alike.
        drifted: covariance of what each length has drifted since the first K postures of a kernel
            (K, K) [m^2]; None: lengths do not drift.

    Raises:
        AgentError: the postures do not differ in the joints of some group.
    """

    factors: Floats | None = None
    drifted: Floats | None = None

    def __init__(
        self,
        nominal_map: JointMuscleMap,
        postures: Floats,
        options: PriorOptions,
        points: PointWeights | None = None,
    ) -> None:
        self.map, self.options, self.points = nominal_map, options, points
        self._centres = []
        self._spreads = []
        for group in nominal_map.groups:
            hidden = group.hidden(postures)
            centre = hidden.mean(axis=0)
            spread = np.sqrt(np.mean(np.sum((hidden - centre) ** 2, axis=1)))
            if spread == 0.0:
                raise AgentError("Prior: typical postures must differ in the joints of each group.")
            self._centres.append(centre)
            self._spreads.append(float(spread))

    @property
    def zeroing_share(self) -> float:
        """Number of elongations as which a zeroing of all lengths counts; variances add up."""
        return (self.options.zeroing / self.options.elongation) ** 2

    def zeroed(self, zero: Floats, offset: float, shape: float, points: float) -> MapPrior:
        """Prior of the same robot, once it is known where its lengths were zeroed.

        Its map is relative to that posture.

        Args:
            zero: joint angles (n,) [rad] at which the lengths were zeroed.
            offset: standard deviation of a muscle's length over all postures [m].
            shape: standard deviation of the change of a length with posture [m].
            points: standard deviation of the displacement of a point [m].
        """
        found, shift = copy(self), self.map.lengths(zero) / METRES
        layers = {g.name: (g.W2, g.b2 - shift[g.muscle_index]) for g in self.map.groups}
        found.map = self.map.with_output_layers(layers)
        found.options = replace(self.options, offset=offset, shape=shape, points=points)
        return found

    def with_factors(self, factors: Floats | None) -> MapPrior:
        """The same prior, with other `factors`."""
        found = copy(self)
        found.factors = None if factors is None or (factors == 1.0).all() else factors
        return found

    def with_drift(self, drifted: Floats | None) -> MapPrior:
        """The same prior, with other `drifted`."""
        if drifted is self.drifted:
            return self
        found = copy(self)
        found.drifted = drifted
        return found

    def groups(
        self,
        postures: Floats,
        noise: Floats | None = None,
        elongated: Floats | None = None,
        rows: Sequence[Floats] | None = None,
    ) -> Sequence[GroupKernel]:
        """Kernels of all muscles, in the map's order.

        There is one for each group, or for each muscle if displaced points are known; elongations
        that not all muscles of a group had divide it, too.

        Args:
            postures: (K, n) [rad].
            noise: standard deviation of the lengths at each posture (K,) [m]; the prior's if left
                out.
            elongated: number of elongations of each muscle since each posture (K, m), infinite
                where a length is unknown; none if left out.
            rows: features (K, 1 + H) [m] of each group at the postures; computed if left out.
        """
        spread = np.full(len(postures), self.options.noise) if noise is None else noise
        kernels = []
        for rank, group in enumerate(self.map.groups):
            muscles = group.muscle_index
            features = self.features(rank, group.hidden(postures)) if rows is None else rows[rank]
            units = features.shape[1] - 1
            history = (
                np.zeros((len(postures), len(muscles)))
                if elongated is None
                else elongated[:, muscles]
            )
            product = features @ features.T
            for times, alike in _histories(history):
                elongation = self._elongation(times)
                for factor, own in self._sharing(muscles[alike]):
                    phi, full = self._completed(rank, features, product, own)
                    phi, full = factor * phi, factor**2 * full
                    kernels.append(GroupKernel(own, phi, spread, elongation, units, full))
        return kernels

    def completed(self, rank: int, features: Floats, muscles: Ints) -> Floats:
        """Features of muscles that share them, with those of their displaced points.

        Args:
            rank: of their group in the map.
            features: of the group (K, 1 + H) [m], see `features`.
            muscles: indices of the muscles; one if points are displaced.

        Returns:
            Features (K, 1 + H + P) [m]; as they are if points are not known.
        """
        return self._completed(rank, features, np.zeros(1), muscles)[0]

    def _completed(
        self, rank: int, features: Floats, product: Floats, muscles: Ints
    ) -> tuple[Floats, Floats]:
        """`completed`, and the product of these features with themselves (K, K) [m^2]."""
        if self.points is None:
            return features, product
        points = features[:, 1:] @ self._point_weights(rank, muscles)
        return np.hstack([features, points]), product + points @ points.T

    def _point_weights(self, rank: int, muscles: Ints) -> Floats:
        """Features of a muscle's displaced points by those of its shape (H, P) [1]."""
        assert self.points is not None
        (own,) = np.flatnonzero(self.map.groups[rank].muscle_index == muscles[0])
        return self.options.points / self._scale(rank) * self.points[rank][own]

    def _elongation(self, times: Floats) -> Floats:
        """Covariance (K, K) [m^2] of the elongation of a muscle since each posture."""
        finite = np.where(np.isfinite(times), times, 0.0)
        covariance = self.options.elongation**2 * np.minimum.outer(finite, finite)
        unknown = np.flatnonzero(np.isinf(times))
        covariance[unknown, unknown] = UNKNOWN
        if self.drifted is not None:
            count = len(self.drifted)
            covariance[:count, :count] += self.drifted
        return np.asarray(covariance)

    def _sharing(self, muscles: Ints) -> Iterator[tuple[float, Ints]]:
        """Factors, and muscles of a group that share them and their features.

        None for muscles that are left out.
        """
        own = np.ones(len(muscles)) if self.factors is None else self.factors[muscles]
        for factor in np.unique(own[np.isfinite(own)]).tolist():
            alike = muscles[own == factor]
            for one in [alike] if self.points is None else alike[:, None]:
                yield factor, one

    def spread(self, pairs: Floats, noise: Floats, q: Floats) -> Floats:
        """Standard deviation of the lengths at a posture (m,) [m], after pairs were learned.

        Args:
            pairs: their postures (K, n) [rad].
            noise: standard deviation of the lengths of each (K,) [m].
            q: joint angles (n,) [rad].
        """
        found = np.full(len(self.map.muscles), np.inf)
        postures, count = np.vstack([pairs, q]), len(pairs)
        for rank, group in enumerate(self.map.groups):
            features = self.features(rank, group.hidden(postures))
            for factor, own in self._sharing(group.muscle_index):
                phi = factor * self.completed(rank, features, own)
                crossed = phi @ phi[count]
                variance = crossed[count]
                if count:
                    rows = phi[:count]
                    learned = GroupKernel(own, rows, noise, np.zeros(1), 0, rows @ rows.T)
                    variance -= crossed[:count] @ learned.whiten(crossed[:count])
                found[own] = np.sqrt(max(float(variance), 0.0))
        return found

    def corrected(self, postures: Floats, lengths: Floats, noise: Floats) -> JointMuscleMap:
        """The map with the smallest change of output layers that explains pairs.

        Args:
            postures: (K, n) [rad].
            lengths: muscle lengths (K, m) [m]; NaN where unknown.
            noise: standard deviation of the lengths of each pair (K,) [m].
        """
        lengths, elongated = without_unknown(lengths, None)
        residual = lengths - self.map.lengths(postures)
        kernels = self.groups(postures, noise, elongated)
        layers: dict[str, tuple[Floats, Floats]] = {}
        for rank, group in enumerate(self.map.groups):
            change = self._change(kernels, rank, residual)
            layers[group.name] = self._layer(rank, group, change)
        return self.map.with_output_layers(layers)

    def _change(self, kernels: Sequence[GroupKernel], rank: int, residual: Floats) -> Floats:
        """Change (1 + H, k) [mm] of the features' weights; 0 for muscles that are left out."""
        group = self.map.groups[rank]
        muscles, units = group.muscle_index, group.W2.shape[1]
        change = np.zeros((1 + units, len(muscles)))
        for kernel in kernels:
            own = np.isin(muscles, kernel.muscles)
            if own.any():
                white = kernel.features.T @ kernel.whiten(residual[:, kernel.muscles])
                factor = 1.0 if self.factors is None else self.factors[kernel.muscles[0]]
                change[:, own] = factor * white[: 1 + units] / METRES
                if self.points is not None:
                    points = self._point_weights(rank, kernel.muscles) @ white[1 + units :]
                    change[1:, own] += factor * points / METRES
        return change

    def features(self, rank: int, hidden: Floats) -> Floats:
        """Features of a group.

        Args:
            rank: of the group in the map.
            hidden: activities of its hidden units (K, H).

        Returns:
            Features (K, 1 + H) [m].
        """
        shape = self._scale(rank) * (hidden - self._centres[rank])
        return np.hstack([np.full((len(hidden), 1), self.options.offset), shape])

    def _scale(self, rank: int) -> float:
        """Length by which a hidden unit of a group changes the lengths [m]."""
        return self.options.shape / self._spreads[rank]

    def _layer(self, rank: int, group: GroupMap, change: Floats) -> tuple[Floats, Floats]:
        """Output layer of a group for a change (1 + H, k) [mm] of the features' weights."""
        weights = self._scale(rank) * change[1:].T
        offset = self.options.offset * change[0] - weights @ self._centres[rank]
        return group.W2 + weights, group.b2 + offset


def _histories(elongated: Floats) -> Iterator[tuple[Floats, Ints]]:
    """Different columns (K,) of ``elongated`` (K, k), and the indices of those like each."""
    if not elongated.any():
        yield np.zeros(len(elongated)), np.arange(elongated.shape[1])
        return
    columns, kind = np.unique(elongated, axis=1, return_inverse=True)
    for number, column in enumerate(columns.T):
        yield column, np.flatnonzero(kind.ravel() == number)

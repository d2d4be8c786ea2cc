"""Joint angles from muscle lengths: extended Kalman filter (Kawaharazuka et al. 2018, sec. II-D).

The paper predicts by how much the wires moved and corrects by how long they are:

    theta_k|k-1 = theta_k-1 + B (l_k - l_k-1) + w_k,     B = inverse of G(theta)        (state)
    l_k         = f(theta_k) + e_k                                              (observation)

Both use the same measured l_k, hence the same noise e_k, and l_k-1 brings e_k-1 along. Whoever
takes them for independent counts one measurement twice. Augment the state by the last noise:
(theta_k-1, e_k-1). Given l_k-1 = f(theta_k-1) + e_k-1 the noise is known as soon as theta is:
its estimate is the residual r_k-1 = l_k-1 - f(theta_k-1|k-1) and its error is -G eps_k-1, where
eps = theta - estimate. So the augmented filter needs no larger state. With v_k the motion
and w_k what a straight step misses of a curved map:

    theta_k|k-1 = theta_k-1|k-1 + B (l_k - l_k-1 + r_k-1)
                = theta_k-1|k-1 + B (l_k - f(theta_k-1|k-1))
    eps_k|k-1   = (1 - B G)(eps_k-1 + v_k) - B e_k + w_k
    P_k|k-1     = (1 - B G)(P_k-1 + V)(1 - B G)' + B R B' + Q
    cov(eps_k|k-1, e_k) = -B R = M
    S = G P G' + G M + M' G' + R,   K = (P G' + M) S^-1,   P_k = P - K (G P + M')

(filterpy's `update_correlated`). B = V G' (G V G' + R)^-1 is the inverse of G for wires with noise
R and joints that move by V in a step; it stays bounded where wires lose sight of a joint. Lengths
are divided by their noise and rotated into the range of G (n numbers, for the filter) and its
complement (m - n numbers, "the wires contradict each other"). No movement of the joints reaches
the complement, so there the innovation is N(0, 1) whatever the motion: it is what the normalised
innovation squared (NIS) is taken of, with m - n degrees of freedom.
"""

from __future__ import annotations

from collections import deque
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from filterpy.kalman import KalmanFilter
from numpy.typing import ArrayLike, NDArray
from scipy.special import gammaincinv

from jmm_agent.kalman_filter_options import EstimatorError, EstimatorOptions
from jmm_agent.mapping.length_map import LengthMap
from jmm_agent.types import Floats

DOUBTED_NOISE = 1e4
"""Noise of a length that is not believed, in units of the encoder's."""


class Estimate(NamedTuple):
    """One estimate: `q` (n,) [rad], `covariance` (n, n) [rad^2], `nis` with `dof` (0: no check)."""

    q: Floats
    covariance: Floats
    nis: float
    dof: int


class Consistency(NamedTuple):
    """Mean NIS over the window, the band it lies in if map and noise are right, and whether."""

    value: float
    low: float
    high: float
    consistent: bool


class _Linearised(NamedTuple):
    """The map near a posture, divided by the encoder noise: lengths (m,), G = basis @ reduced."""

    lengths: Floats
    basis: Floats
    reduced: Floats


class JointEstimator:
    """Extended Kalman filter over n joints and m stacked muscles (module docstring).

    Args:
        length_map: the map f, of all groups stacked or of some muscles.
        limits: lowest and highest angle of each joint, shape (n, 2) [rad].
        options: noise and limits.
        q: start, shape (n,) [rad]; zeros if left out.

    Raises:
        EstimatorError: shapes do not fit, or something is not finite.
    """

    def __init__(
        self,
        length_map: LengthMap,
        limits: ArrayLike,
        options: EstimatorOptions | None = None,
        q: ArrayLike | None = None,
    ) -> None:
        box = np.array(limits, dtype=float)
        if box.ndim != 2 or box.shape[1] != 2 or not (box[:, 0] <= box[:, 1]).all():
            raise EstimatorError("Estimator: limits must be n pairs (lowest, highest) in rad.")
        self.options = options or EstimatorOptions()
        self._map = length_map
        self._low = box[:, 0] - self.options.limit_margin
        self._high = box[:, 1] + self.options.limit_margin
        self._nis: deque[float] = deque(maxlen=self.options.window)
        self._noise = np.array(self.options.encoder_noise)
        self._doubted = 0
        self.reset(np.zeros(len(box)) if q is None else q)

    @property
    def q(self) -> Floats:
        """Current estimate, shape (n,) [rad]."""
        return self._filter.x[:, 0].copy()

    @property
    def covariance(self) -> Floats:
        """Covariance of the current estimate, shape (n, n) [rad^2]."""
        return self._filter.P.copy()

    @property
    def lengths(self) -> Floats:
        """Muscle lengths (m,) [m] that the map expects at the current estimate."""
        return self._here.lengths * self._noise

    @property
    def consistency(self) -> Consistency | None:
        """Whether measured lengths agree with the map within the noise, over the last updates.

        None before the first update, and where there are no more muscles than joints.
        """
        if not self._nis or self._dof == 0:
            return None
        low, high = _band(len(self._nis), self._dof, self.options.confidence)
        value = float(np.mean(self._nis))
        return Consistency(value, low, high, low <= value <= high)

    def reset(self, q: ArrayLike, covariance: ArrayLike | None = None) -> None:
        """Start anew at `q` (n,) [rad] with `covariance` (n, n) [rad^2], or with `initial_std`.

        Raises:
            EstimatorError: wrong shape, not finite, or a covariance that is none.
        """
        n = self._low.size
        start = np.array(q, dtype=float)
        spread = (
            self.options.initial_std**2 * np.eye(n)
            if covariance is None
            else np.array(covariance, dtype=float)
        )
        if start.shape != (n,) or not np.isfinite(start).all():
            raise EstimatorError(f"Estimator: q must be {n} finite angles in rad.")
        if spread.shape != (n, n) or not np.isfinite(spread).all():
            raise EstimatorError(f"Estimator: covariance must be a finite {n} x {n} matrix.")
        if not np.allclose(spread, spread.T) or np.linalg.eigvalsh(spread)[0] < 0:
            raise EstimatorError("Estimator: covariance must be symmetric, with no negative axis.")
        start = np.clip(start, self._low, self._high)
        self._here = self._linearise(start)
        self._count_freedom()
        rank = self._here.basis.shape[1]
        self._filter = KalmanFilter(dim_x=n, dim_z=rank)
        self._filter.x, self._filter.P = start[:, None], spread
        self._filter.R = np.eye(rank)
        self._nis.clear()

    def set_map(self, length_map: LengthMap) -> None:
        """Use another map of the same muscles from now on; calls `invalidate`.

        Raises:
            EstimatorError: the map does not fit; the old one stays.
        """
        old, self._map = self._map, length_map
        try:
            self.invalidate()
        except EstimatorError:
            self._map = old
            raise

    def invalidate(self) -> None:
        """The map has changed: be less sure of the estimate, by `invalidation_std`."""
        here = self._linearise(self._filter.x[:, 0])
        if here.basis.shape != self._here.basis.shape:
            raise EstimatorError("Estimator: the new map has another number of muscles.")
        self._here = here
        self._filter.P = self._filter.P + self.options.invalidation_std**2 * np.eye(self._low.size)
        self._nis.clear()

    def doubt(self, muscles: NDArray[np.bool_]) -> None:
        """Leave the lengths of some muscles (m,) out of the estimate, until called again.

        Raises:
            EstimatorError: wrong shape; the same muscles are doubted as before.
        """
        if muscles.shape != self._here.lengths.shape:
            raise EstimatorError(f"Estimator: doubts must be of shape {self._here.lengths.shape}.")
        noise = self.options.encoder_noise * np.where(muscles, DOUBTED_NOISE, 1.0)
        if np.array_equal(noise, np.broadcast_to(self._noise, noise.shape)):
            return
        self._noise, self._doubted = noise, int(muscles.sum())
        self._here = self._linearise(self._filter.x[:, 0])
        self._count_freedom()
        self._nis.clear()

    def _count_freedom(self) -> None:
        """Degrees of freedom that the joints leave to the lengths that are believed."""
        muscles, joints = self._here.basis.shape
        self._dof = max(0, muscles - self._doubted - joints)

    def update(self, lengths: ArrayLike, dt: float) -> Estimate:
        """Take measured muscle lengths (m,) [m], `dt` [s] after the last ones.

        Raises:
            EstimatorError: wrong shape, not finite, `dt` not positive, or a map that gives no
                usable numbers; the estimate stays what it was.
        """
        measured = np.asarray(lengths, dtype=float)
        m = self._here.lengths.size
        if measured.shape != (m,) or not np.isfinite(measured).all():
            raise EstimatorError(f"Estimator: lengths must be {m} finite numbers in m.")
        if not 0 < dt < np.inf:
            raise EstimatorError(f"Estimator: dt is {dt} s, but must be positive and finite.")
        before = self._filter.x, self._filter.P
        try:
            return self._step(measured / self._noise, dt)
        except (EstimatorError, np.linalg.LinAlgError) as error:
            self._filter.x, self._filter.P = before
            raise EstimatorError(f"Estimator: update refused, estimate kept: {error}") from error

    def _step(self, measured: Floats, dt: float) -> Estimate:
        """One step of the filter on lengths in units of their noise."""
        kalman, here = self._filter, self._here
        rank, n = here.reduced.shape
        variance = self.options.motion_noise**2 * dt
        outer = here.reduced @ here.reduced.T
        inverse = np.linalg.solve(variance * outer + np.eye(rank), variance * here.reduced).T
        kept = np.eye(n) - inverse @ here.reduced
        change = here.basis.T @ (measured - here.lengths)
        noise = variance * kept @ kept.T + inverse @ inverse.T
        noise += self.options.process_noise**2 * dt * np.eye(n)
        kalman.predict(F=kept, B=inverse, u=change[:, None] + here.reduced @ kalman.x, Q=noise)
        kalman.x = np.clip(kalman.x, self._low[:, None], self._high[:, None])

        there = self._linearise(kalman.x[:, 0])
        innovation = measured - there.lengths
        seen = there.basis.T @ innovation
        kalman.M = -inverse @ (here.basis.T @ there.basis)
        column = seen[:, None] + there.reduced @ kalman.x
        predicted = kalman.x
        kalman.update_correlated(column, H=there.reduced)
        kalman.P = 0.5 * (kalman.P + kalman.P.T)
        kalman.x = self._into_limits(kalman.x[:, 0], kalman.P)[:, None]
        if not (np.isfinite(kalman.x).all() and np.isfinite(kalman.P).all()):
            raise EstimatorError("the filter's numbers are not finite.")

        moved = there.basis @ (there.reduced @ (kalman.x - predicted)[:, 0])
        self._here = there._replace(lengths=there.lengths + moved)
        nis = float(np.sum((innovation - there.basis @ seen) ** 2))
        self._nis.append(nis)
        return Estimate(self.q, self.covariance, nis, self._dof)

    def _linearise(self, q: Floats) -> _Linearised:
        """The map and its range at `q`, in units of the encoder noise."""
        lengths, jacobian = self._map.lengths_and_jacobian(q)
        if lengths.ndim != 1 or jacobian.shape != (lengths.size, q.size):
            raise EstimatorError(
                f"the map gives shapes {lengths.shape} and {jacobian.shape} for {q.size} joints."
            )
        if not (np.isfinite(lengths).all() and np.isfinite(jacobian).all()):
            raise EstimatorError("the map gives lengths or moment arms that are not finite.")
        basis, reduced = np.linalg.qr(jacobian / self._noise[..., None])
        return _Linearised(lengths / self._noise, basis, reduced)

    def _into_limits(self, q: Floats, covariance: Floats) -> Floats:
        """The likeliest posture inside the box: the other joints follow by the covariance."""
        outside = (q < self._low) | (q > self._high)
        if not outside.any():
            return q
        bound = np.clip(q, self._low, self._high)
        rows = covariance[:, outside]
        shift = np.linalg.lstsq(rows[outside], (bound - q)[outside], rcond=None)[0]
        return np.clip(q + rows @ shift, self._low, self._high)


@lru_cache(maxsize=4096)
def _band(count: int, dof: int, confidence: float) -> tuple[float, float]:
    """Band of the mean of `count` chi-squared numbers with `dof` degrees of freedom."""
    half = 0.5 * count * dof
    tail = 0.5 * (1.0 - confidence)
    return (
        float(2.0 * gammaincinv(half, tail) / count),
        float(2.0 * gammaincinv(half, 1.0 - tail) / count),
    )

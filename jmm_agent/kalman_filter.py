"""Joint angles from muscle lengths: extended Kalman filter (Kawaharazuka et al. 2018, sec. II-D).

The paper predicts with the change of the muscle lengths and corrects with the lengths:

    theta_k|k-1 = theta_k-1 + B (l_k - l_k-1) + w_k,     B = inverse of G(theta)        (state)
    l_k         = f(theta_k) + e_k                                              (observation)

Both use the same measured l_k, hence the same noise e_k, and l_k-1 contains e_k-1. A filter that
takes them as independent counts one measurement twice. Augment the state by the last noise:
(theta_k-1, e_k-1). Given l_k-1 = f(theta_k-1) + e_k-1, theta determines the noise: its estimate
is the residual r_k-1 = l_k-1 - f(theta_k-1|k-1), and the error of this estimate is -G eps_k-1,
where eps = theta - estimate. So the augmented filter needs no larger state. With the motion v_k,
and w_k for the error of a linear step on a curved map:

    theta_k|k-1 = theta_k-1|k-1 + B (l_k - l_k-1 + r_k-1)
                = theta_k-1|k-1 + B (l_k - f(theta_k-1|k-1))
    eps_k|k-1   = (1 - B G)(eps_k-1 + v_k) - B e_k + w_k
    P_k|k-1     = (1 - B G)(P_k-1 + V)(1 - B G)' + B R B' + Q
    cov(eps_k|k-1, e_k) = -B R = M
    S = G P G' + G M + M' G' + R,   K = (P G' + M) S^-1,   P_k = P - K (G P + M')

(filterpy's `update_correlated`). B = V G' (G V G' + R)^-1 is the inverse of G for muscles with
noise R and joints that move by V in a step; it stays bounded where the moment arms of a joint
vanish. Lengths are divided by their noise and rotated into the range of G (n numbers, for the
filter) and its complement (m - n numbers, by which the muscles contradict each other). No movement
of the joints reaches the complement, so the innovation is N(0, 1) there for any motion. The
normalised innovation squared (NIS) is computed in the complement, with m - n degrees of freedom.
Measured joint angles correct the result once more (`JointEncoders`).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from filterpy.kalman import KalmanFilter
from numpy.typing import ArrayLike, NDArray
from scipy.special import gammaincinv

from jmm_agent.joint_encoders import JointEncoders
from jmm_agent.kalman_filter_options import EstimatorError, EstimatorOptions
from jmm_agent.map_consistency import Consistency, consistency_of
from jmm_agent.mapping.length_map import LengthMap
from jmm_agent.types import Floats

Spread = Callable[[Floats], Floats]
"""Joint angles (n,) [rad] -> standard deviations of the lengths by a map (m,) [m]."""
DOUBTED_NOISE = 1e4
"""Noise of a length that is in doubt, in units of the encoder noise."""


class Estimate(NamedTuple):
    """One estimate.

    Attributes:
        q: joint angles (n,) [rad].
        covariance: of the joint angles (n, n) [rad^2].
        nis: normalised innovation squared.
        dof: its degrees of freedom; 0 if there are no more muscles than joints.
    """

    q: Floats
    covariance: Floats
    nis: float
    dof: int


class _Linearised(NamedTuple):
    """The map near a posture, divided by the encoder noise: lengths (m,), G = basis @ reduced.

    The posture (n,) [rad] and the muscle Jacobian (m, n) [m/rad] there are as they are.
    """

    lengths: Floats
    basis: Floats
    reduced: Floats
    jacobian: Floats
    q: Floats


class JointEstimator:
    """Extended Kalman filter over n joints and m stacked muscles (module docstring).

    Args:
        length_map: the map f.
        limits: lowest and highest angle of each joint (n, 2) [rad].
        options: noise levels and limits.
        q: joint angles at the start (n,) [rad]; zeros if left out.

    Attributes:
        options: as given, or the defaults.
        joint_encoders: compares measured joint angles with the lengths.
        spread: how far lengths of the map may be off, for `consistency`; None: it is right.

    Raises:
        EstimatorError: shapes do not fit, or a number is not finite.
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
        self._identity = np.eye(len(box))
        self._nis: deque[float] = deque(maxlen=self.options.window)
        self._residuals: deque[Floats] = deque(maxlen=self.options.window)
        self.spread: Spread | None = None
        self._noise = np.array(self.options.encoder_noise)
        self._doubted = 0
        self.joint_encoders = JointEncoders(box[:, 0], box[:, 1], self.options)
        self.reset(np.zeros(len(box)) if q is None else q)

    @property
    def q(self) -> Floats:
        """Estimated joint angles (n,) [rad]."""
        return self._filter.x[:, 0].copy()

    @property
    def covariance(self) -> Floats:
        """Covariance of the estimate (n, n) [rad^2]."""
        return self._filter.P.copy()

    @property
    def lengths(self) -> Floats:
        """Muscle lengths (m,) [m] by the map at the estimate."""
        return self._here.lengths * self._noise

    @property
    def jacobian(self) -> Floats:
        """Muscle Jacobian (m, n) [m/rad] by the map, at `jacobian_at`."""
        return self._here.jacobian.copy()

    @property
    def jacobian_at(self) -> Floats:
        """Joint angles (n,) [rad] before the last correction, at which the map was linearised."""
        return self._here.q.copy()

    @property
    def consistency(self) -> Consistency | None:
        """Consistency of the lengths of the last updates with the map.

        Where it is known how far the map may be off (`spread`), see `jmm_agent.map_consistency`.
        Otherwise the map counts as right, and the mean NIS is compared with its chi-squared band.
        None before the first update, and if there are no more muscles than joints.
        """
        if not self._nis or self._dof == 0:
            return None
        if self.spread is not None:
            noise = self.options.encoder_noise / np.sqrt(len(self._residuals))
            std = np.hypot(self.spread(self.q), noise)
            std = np.where(self._noise > self.options.encoder_noise, np.inf, std)
            mean = np.mean(self._residuals, axis=0)
            return consistency_of(mean, self._here.jacobian, std, self.options.confidence)
        low, high = _band(len(self._nis), self._dof, self.options.confidence)
        value = float(np.mean(self._nis))
        return Consistency(value, low, high, low <= value <= high)

    def reset(self, q: ArrayLike, covariance: ArrayLike | None = None) -> None:
        """Start again at a posture.

        Args:
            q: joint angles (n,) [rad]; clipped into the limits.
            covariance: of the joint angles (n, n) [rad^2]; that of `initial_std` if left out.

        Raises:
            EstimatorError: wrong shape, not finite, or not a covariance.
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
        self._forget()
        self.joint_encoders.reset()

    def set_map(self, length_map: LengthMap) -> None:
        """Use another map of the same muscles, and `invalidate` the estimate.

        Args:
            length_map: the map f.

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
        """Widen the covariance by `invalidation_std`, because the map has changed.

        Raises:
            EstimatorError: the map has another number of muscles, or returns unusable numbers.
        """
        here = self._linearise(self._filter.x[:, 0])
        if here.basis.shape != self._here.basis.shape:
            raise EstimatorError("Estimator: the new map has another number of muscles.")
        self._here = here
        self._filter.P = self._filter.P + self.options.invalidation_std**2 * np.eye(self._low.size)
        self._forget()

    def doubt(self, muscles: NDArray[np.bool_]) -> None:
        """Leave the lengths of some muscles out of the estimate, until the next call.

        Args:
            muscles: which muscles (m,).

        Raises:
            EstimatorError: wrong shape; nothing is changed.
        """
        if muscles.shape != self._here.lengths.shape:
            raise EstimatorError(f"Estimator: doubts must be of shape {self._here.lengths.shape}.")
        if not self._doubted and not muscles.any():
            return
        noise = self.options.encoder_noise * np.where(muscles, DOUBTED_NOISE, 1.0)
        if np.array_equal(noise, np.broadcast_to(self._noise, noise.shape)):
            return
        self._noise, self._doubted = noise, int(muscles.sum())
        self._here = self._linearise(self._filter.x[:, 0])
        self._count_freedom()
        self._forget()

    def _forget(self) -> None:
        """Forget earlier updates, of which consistency is judged."""
        self._nis.clear()
        self._residuals.clear()

    def _count_freedom(self) -> None:
        """Count the degrees of freedom that the joints leave to the lengths without doubt."""
        muscles, joints = self._here.basis.shape
        self._dof = max(0, muscles - self._doubted - joints)

    def update(self, lengths: ArrayLike, dt: float, joint_angles: Floats | None = None) -> Estimate:
        """Update the estimate with measured lengths, and with measured joint angles.

        Args:
            lengths: measured muscle lengths (m,) [m].
            dt: time since the last ones [s].
            joint_angles: measured joint angles (n,) [rad], NaN where there is no encoder; None:
                none.

        Raises:
            EstimatorError: wrong shape, not finite, `dt` not positive, or a map that returns
                unusable numbers; the estimate is unchanged.
        """
        measured = np.asarray(lengths, dtype=float)
        m = self._here.lengths.size
        if measured.shape != (m,) or not np.isfinite(measured).all():
            raise EstimatorError(f"Estimator: lengths must be {m} finite numbers in m.")
        if not 0 < dt < np.inf:
            raise EstimatorError(f"Estimator: dt is {dt} s, but must be positive and finite.")
        angles = self.joint_encoders.checked(joint_angles)
        before = self._filter.x, self._filter.P
        try:
            return self._step(measured / self._noise, dt, angles)
        except (EstimatorError, np.linalg.LinAlgError) as error:
            self._filter.x, self._filter.P = before
            raise EstimatorError(f"Estimator: update refused, estimate kept: {error}") from error

    def _step(self, measured: Floats, dt: float, angles: Floats | None) -> Estimate:
        """One step of the filter on lengths in units of their noise, and joint angles [rad]."""
        kalman, here = self._filter, self._here
        rank = len(here.reduced)
        variance = self.options.motion_noise**2 * dt
        outer = here.reduced @ here.reduced.T
        inverse = np.linalg.solve(variance * outer + np.eye(rank), variance * here.reduced).T
        kept = self._identity - inverse @ here.reduced
        change = here.basis.T @ (measured - here.lengths)
        noise = variance * kept @ kept.T + inverse @ inverse.T
        noise += self.options.process_noise**2 * dt * self._identity
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
        if angles is not None:
            q, kalman.P = self.joint_encoders.correct(kalman.x[:, 0], kalman.P, angles)
            kalman.x = q[:, None]
        kalman.x = self._into_limits(kalman.x[:, 0], kalman.P)[:, None]
        if not (np.isfinite(kalman.x).all() and np.isfinite(kalman.P).all()):
            raise EstimatorError("the filter's numbers are not finite.")

        moved = there.basis @ (there.reduced @ (kalman.x - predicted)[:, 0])
        self._here = there._replace(lengths=there.lengths + moved)
        nis = float(np.sum((innovation - there.basis @ seen) ** 2))
        self._nis.append(nis)
        self._residuals.append((measured - self._here.lengths) * self._noise)
        return Estimate(self.q, self.covariance, nis, self._dof)

    def _linearise(self, q: Floats) -> _Linearised:
        """The map and its range at q (n,) [rad], in units of the encoder noise."""
        lengths, jacobian = self._map.lengths_and_jacobian(q)
        if lengths.ndim != 1 or jacobian.shape != (lengths.size, q.size):
            raise EstimatorError(
                f"the map returns shapes {lengths.shape} and {jacobian.shape} for {q.size} joints."
            )
        if not (np.isfinite(lengths).all() and np.isfinite(jacobian).all()):
            raise EstimatorError("the map returns lengths or moment arms that are not finite.")
        basis, reduced = np.linalg.qr(jacobian / self._noise[..., None])
        return _Linearised(lengths / self._noise, basis, reduced, jacobian, q)

    def _into_limits(self, q: Floats, covariance: Floats) -> Floats:
        """The likeliest posture in the limits; the other joints follow by the covariance."""
        outside = (q < self._low) | (q > self._high)
        if not outside.any():
            return q
        bound = np.clip(q, self._low, self._high)
        rows = covariance[:, outside]
        shift = np.linalg.lstsq(rows[outside], (bound - q)[outside], rcond=None)[0]
        return np.clip(q + rows @ shift, self._low, self._high)


@lru_cache(maxsize=4096)
def _band(count: int, dof: int, confidence: float) -> tuple[float, float]:
    """Band of the mean of ``count`` chi-squared numbers with ``dof`` degrees of freedom."""
    half = 0.5 * count * dof
    tail = 0.5 * (1.0 - confidence)
    return (
        float(2.0 * gammaincinv(half, tail) / count),
        float(2.0 * gammaincinv(half, 1.0 - tail) / count),
    )

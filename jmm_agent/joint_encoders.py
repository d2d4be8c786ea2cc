"""Joint encoders in the joint estimator: measured angles of some joints correct the estimate.

The errors of joint encoders are independent of those of the muscle lengths, so that measured angles
y = H theta + e, a row of H for each joint with an encoder, are a second correction after that by
the lengths:

    K = P H' (H P H' + s^2 I)^-1,   theta += K (y - H theta)
    P = (1 - K H) P (1 - K H)' + s^2 K K'

The joints without encoder follow by the covariance. The filter believes map and encoders. Where
both differ for long, one of them is wrong: the map before it is learned, the encoder's zero after.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from jmm_agent.kalman_filter_options import EstimatorError, EstimatorOptions
from jmm_agent.types import Floats

OUTSIDE = 0.5
"""A measured angle this far outside its joint's limits is not used [rad]."""


class JointEncoders:
    """Corrects joint angles with measured ones, and compares them with the muscle lengths.

    Args:
        low: lowest angle of each joint (n,) [rad].
        high: highest angle of each joint (n,) [rad].
        options: noise and thresholds.
    """

    def __init__(self, low: Floats, high: Floats, options: EstimatorOptions) -> None:
        self._low, self._high, self._options = low - OUTSIDE, high + OUTSIDE, options
        self._missed: deque[Floats] = deque(maxlen=options.window)

    def reset(self) -> None:
        """Forget earlier differences, as at the start of an episode."""
        self._missed.clear()

    def checked(self, measured: Floats | None) -> Floats | None:
        """A copy of the measured angles (n,) [rad]; None where no joint has one.

        Args:
            measured: angles (n,) [rad], NaN where there is none; None: none.

        Raises:
            EstimatorError: wrong shape, or infinite.
        """
        if measured is None:
            return None
        try:
            angles = np.array(measured, dtype=float)
        except (TypeError, ValueError):
            raise EstimatorError("Estimator: joint angles must be numbers in rad.") from None
        if angles.shape != self._low.shape or np.isinf(angles).any():
            raise EstimatorError(
                f"Estimator: joint angles must be {self._low.size} angles in rad, NaN for a joint "
                f"without encoder, got shape {angles.shape}."
            )
        return None if np.isnan(angles).all() else angles

    def usable(self, measured: Floats | None) -> Floats | None:
        """The measured angles (n,) [rad] without those far outside the limits."""
        if measured is None:
            return None
        inside = (measured >= self._low) & (measured <= self._high)
        return np.where(inside, measured, np.nan) if inside.any() else None

    def correct(self, q: Floats, covariance: Floats, measured: Floats) -> tuple[Floats, Floats]:
        """Joint angles (n,) [rad] and their covariance (n, n) after the correction.

        Args:
            q: joint angles (n,) [rad] by the muscle lengths.
            covariance: of the joint angles (n, n) [rad^2].
            measured: as `checked` returns it.
        """
        missed = measured - q
        self._missed.append(missed)
        used = np.flatnonzero((measured >= self._low) & (measured <= self._high))
        variance = self._options.joint_noise**2
        rows = covariance[used]
        gain = np.linalg.solve(rows[:, used] + variance * np.eye(len(used)), rows).T
        kept = np.eye(len(q))
        kept[:, used] -= gain
        corrected = kept @ covariance @ kept.T + variance * gain @ gain.T
        return q + gain @ missed[used], 0.5 * (corrected + corrected.T)

    @property
    def differences(self) -> Floats:
        """Mean difference (n,) [rad] of each encoder from the angle by the lengths; NaN: none."""
        none = np.full(self._low.shape, np.nan)
        if not self._missed:
            return none
        missed = np.array(self._missed)
        return np.where(np.isnan(missed).any(axis=0), none, missed.mean(axis=0))

    @property
    def contradicted(self) -> np.ndarray:
        """Joints (n,) whose encoders have contradicted the lengths over a whole window."""
        if len(self._missed) < self._options.window:
            return np.zeros(self._low.shape, dtype=bool)
        return np.abs(self.differences) > self._options.joint_tolerance

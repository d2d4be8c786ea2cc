"""Delay of a camera, estimated from how the marker moves in frames and by the muscle lengths.

Let y_i be the marker's position in a frame with the stamp s_i, and p(t) where the estimated joint
angles expect it. A wrong map moves and turns p as a whole, nearly the same along one movement, so
that over the N frames of a movement

    y_i = b R p(s_i - d) + c + noise,

with a rotation R, a scale b and an offset c of its own. Their least squares have a closed form
(Kabsch, Umeyama): with centred positions as rows of Y and P_d and the singular values sigma of
Y' P_d, signed so that R is a rotation, the remaining squares are

    E(d) = |Y|^2 - (sum sigma)^2 / |P_d|^2.

The delay minimises the sum over movements of (3 N - 7) / 2 log E(d), a negative log-likelihood with
the noise of each movement left free, so that a movement with a bad fit has little weight. Its
variance is the larger of the inverse curvature and the jackknife over movements.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from jmm_agent.types import Floats

STEP = 0.005
"""Distance of the delays that are compared [s]."""
AROUND = 3
"""Steps to each side through which a parabola is laid around the least cost."""
EVEN = 1.0
"""Curvature of a cost that shows no delay [1/s^2]."""
BELOW = 0.03
"""How far below zero delays are compared, so that a small one is not at the end [s]."""
AVERAGED = 0.1
"""Time over which expected positions are averaged [s].

Without that, noise would favour delays at which positions between two steps are averaged."""
FEWEST_FRAMES = 4
"""Least number of frames of a movement."""
FREE = 3.5
"""Half the number of parameters of R, b and c."""
FEWEST_MOVEMENTS = 3
"""Least number of movements of an estimate."""
ENOUGH = 6
"""Movements after which a delay that can be used is not estimated any further."""
MOST_MOVEMENTS = 12
"""Newest movements that are kept."""
MOTION = 5.0
"""Least size of a movement, in standard deviations of the marker's position."""
LONGEST_MOVEMENT = 5.0
"""A movement that takes longer is cut here [s]."""
TINY = 1e-12
"""Squares of expected positions that count as none [m^2]."""
PRECISE = 0.02
"""Standard deviation from which on a delay is used [s]."""
FINEST = 0.002
"""Standard deviation of a delay from any number of movements [s], because of the averages."""


class DelayEstimate(NamedTuple):
    """Delay of a camera as estimated so far.

    Attributes:
        delay: [s]; NaN if there is none.
        std: its standard deviation [s]; NaN if there is none.
        movements: number of movements that it is estimated from.
        reason: why it is not used; empty if it is.
    """

    delay: float
    std: float
    movements: int
    reason: str


class DelayEstimator:
    """Estimates the delay of a camera from movements of the marker (module docstring).

    Args:
        longest: longest delay that is considered [s].
        noise: standard deviation of the marker's position [m].
        early: how far stamps may be ahead of their frames [s]. If they may be, movements must begin
            and end at rest: the hand stays where it was expected first and last.
        step: distance of the delays that are compared [s].
    """

    def __init__(
        self, longest: float, noise: float, early: float = 0.0, step: float = STEP
    ) -> None:
        self._delays = np.arange(-max(early, BELOW), longest + step, step)
        self._noise, self._early, self._step = noise, early, step
        self._costs: deque[Floats] = deque(maxlen=MOST_MOVEMENTS)
        self._estimate = self._evaluated()
        self.reset()

    def reset(self) -> None:
        """Forget the present movement, but not what was found from earlier ones."""
        self._track: deque[tuple[float, Floats]] = deque()
        self._frames: list[tuple[float, Floats]] = []

    def expect(self, time: float, position: Floats) -> None:
        """Add where the marker is expected.

        Args:
            time: of the estimate [s].
            position: of the marker in the camera (3,) [m].
        """
        self._track.append((time, position))
        span = self._delays[-1] + LONGEST_MOVEMENT
        while time - self._track[0][0] > span + 1.0:
            self._track.popleft()
        if self._frames and time - self._frames[0][0] > LONGEST_MOVEMENT:
            self.end_movement()

    def add_frame(self, stamp: float, position: Floats) -> None:
        """Add where a frame shows the marker.

        Args:
            stamp: time with which the frame came [s].
            position: of the marker in the camera (3,) [m].
        """
        self._frames.append((stamp, position))

    def end_movement(self) -> None:
        """Evaluate the frames since the last movement, as when the hand has come to rest."""
        frames, self._frames = self._frames, []
        if not self._track:
            return
        times, expected = self._averaged()
        used = [
            (stamp, position)
            for stamp, position in frames
            if self._early or (times[0] <= stamp - self._delays[-1] and stamp + BELOW <= times[-1])
        ]
        if len(used) < FEWEST_FRAMES:
            return
        seen = np.array([position for _, position in used])
        late = np.array([stamp for stamp, _ in used]) - self._delays[:, None]  # (D, N)
        shifted = np.stack([np.interp(late, times, column) for column in expected.T], axis=-1)
        least = MOTION * self._noise
        moved = _size(shifted) >= least
        # Far from the delay the hand may have been at rest, which explains no motion.
        if _size(seen) >= least and (moved.any() if self._early else moved.all()):
            shifted = shifted * moved[:, None, None]
            squares = _remaining_squares(seen, shifted) + len(used) * (0.01 * self._noise) ** 2
            self._costs.append((1.5 * len(used) - FREE) * np.log(squares))
            self._estimate = self._evaluated()

    @property
    def estimate(self) -> DelayEstimate:
        """The delay as estimated so far."""
        return self._estimate

    @property
    def precise(self) -> bool:
        """Whether more movements would not make the estimate much better."""
        return len(self._costs) >= ENOUGH and not self._estimate.reason

    def _averaged(self) -> tuple[Floats, Floats]:
        """Times (T,) [s] and expected positions (T, 3) [m], both averaged over some steps."""
        times = np.array([time for time, _ in self._track])
        expected = np.array([position for _, position in self._track])
        if len(times) < 2:
            return times, expected
        period = float(np.median(np.diff(times)))
        steps = min(max(round(AVERAGED / period), 1), len(times))
        windows = np.lib.stride_tricks.sliding_window_view(times, steps)
        positions = np.lib.stride_tricks.sliding_window_view(expected, steps, axis=0)
        return windows.mean(axis=1), positions.mean(axis=2)

    def _evaluated(self) -> DelayEstimate:
        """The delay by the movements that are kept."""
        count = len(self._costs)
        if count < FEWEST_MOVEMENTS:
            reason = f"{count} movements were seen in frames, and {FEWEST_MOVEMENTS} are needed"
            return DelayEstimate(np.nan, np.nan, count, reason)
        total = np.sum(self._costs, axis=0)
        delay, curvature = self._minimum(total)
        others = np.array([self._minimum(total - cost)[0] for cost in self._costs])
        jackknife = (count - 1) / count * float(np.sum((others - others.mean()) ** 2))
        std = float(np.hypot(np.sqrt(max(1.0 / curvature, jackknife)), FINEST))
        reason = ""
        if delay >= self._delays[-2]:
            reason = f"the delay is {self._delays[-1]:g} s or longer, more than `longest` allows"
        elif std > PRECISE:
            reason = f"its standard deviation of {1e3 * std:.0f} ms is above {1e3 * PRECISE:.0f} ms"
        return DelayEstimate(delay, std, count, reason)

    def _minimum(self, cost: Floats) -> tuple[float, float]:
        """Delay of the least cost (D,) [s], and its curvature there [1/s^2], by a parabola."""
        delays = self._delays
        k = int(np.argmin(cost))
        near = slice(max(k - AROUND, 0), k + AROUND + 1)
        curvature, slope, _ = np.polyfit(delays[near] - delays[k], cost[near], 2)
        if curvature <= 0.0:
            return float(delays[k]), EVEN
        shift = np.clip(-0.5 * slope / curvature, -self._step, self._step)
        delay = float(np.clip(delays[k] + shift, -self._early, delays[-1]))
        return delay, max(2.0 * float(curvature), EVEN)


def _size(positions: Floats) -> Floats:
    """Largest distance (...) [m] of positions (..., N, 3) [m] from their mean."""
    away = positions - positions.mean(axis=-2, keepdims=True)
    return np.asarray(np.linalg.norm(away, axis=-1).max(axis=-1))


def _remaining_squares(seen: Floats, expected: Floats) -> Floats:
    """E(d) (D,) [m^2] of positions (N, 3) against expected ones (D, N, 3)."""
    y = seen - seen.mean(axis=0)
    p = expected - expected.mean(axis=1, keepdims=True)
    products = np.einsum("ni,dnj->dij", y, p)
    sigma = np.linalg.svd(products, compute_uv=False)
    sigma[:, 2] *= np.sign(np.linalg.det(products))
    rest = np.sum(y**2) - np.sum(sigma, axis=1) ** 2 / np.maximum(np.sum(p**2, axis=(1, 2)), TINY)
    return np.maximum(rest, 0.0)

"""Clock of a camera: when its frames were exposed, although they are stamped when they arrive.

A frame with the stamp s was exposed from s - delay - exposure to s - delay. The delay is given, or
estimated while the hand moves (`DelayEstimator`).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats
from jmm_agent.vision.camera_delay import DelayEstimate, DelayEstimator

FEWEST_POSITIONS = 5
"""Least number of expected positions from which that speed is known."""
MOST_FRAMES = 20
"""Newest frames whose stamps are kept, because the marker is found in them later."""
DRIFT = 0.4
"""Time over which the speed of the hand at rest is measured [s]."""


@dataclass(frozen=True)
class CameraClock:
    """When frames were exposed, by the time with which they come.

    Attributes:
        delay: from the end of the exposure to ``frame_time`` [s]; None: estimated from movements.
            Until it is known the longest one is assumed.
        exposure: time for which the shutter is open [s].
        jitter: how much longer the delay of a single frame may be [s].
        longest: longest delay that an estimate may have [s].
        blur: how far the marker may move during the exposure of a frame that is learned from, as a
            share of the standard deviation of its position [1].

    Raises:
        AgentError: a number is negative or not finite, or the longest delay or the blur is zero.
    """

    delay: float | None = 0.0
    exposure: float = 0.0
    jitter: float = 0.0
    longest: float = 0.3
    blur: float = 0.3

    def __post_init__(self) -> None:
        for name in ("delay", "exposure", "jitter", "longest", "blur"):
            value = getattr(self, name)
            least = np.nextafter(0.0, 1.0) if name in ("longest", "blur") else 0.0
            if value is not None and not least <= value < np.inf:
                kind = "positive" if least else "not negative"
                raise AgentError(f"CameraClock: {name} is {value}; it must be finite and {kind}.")


class ExposureClock:
    """Exposure times of frames, and whether the hand was at rest in them.

    Args:
        clock: delay and exposure of the camera.
        noise: standard deviation of the marker's position [m].

    Attributes:
        estimator: estimates the delay; None if it is given.
        followed: middle of the exposure of the newest frame of which `add_frame` was told [s].
    """

    def __init__(self, clock: CameraClock, noise: float) -> None:
        self._clock, self._noise = clock, noise
        self.estimator = DelayEstimator(clock.longest, noise) if clock.delay is None else None
        self.reset()

    def reset(self) -> None:
        """Forget all frames, as at the start of an episode, but not the delay."""
        self._stamp = self._middle = self.followed = -np.inf
        self._stamps: dict[float, float] = {}
        self._half, self._refused = 0.0, False
        self._positions: deque[tuple[float, Floats]] = deque()
        if self.estimator is not None:
            self.estimator.reset()

    def map_changed(self) -> None:
        """Forget expected positions: those of another map cannot be compared with the next ones."""
        self._positions.clear()
        if self.estimator is not None:
            self.estimator.reset()

    @property
    def delay(self) -> DelayEstimate:
        """The delay, as given or as estimated so far."""
        if self.estimator is None:
            return DelayEstimate(float(self._clock.delay or 0.0), 0.0, 0, "")
        return self.estimator.estimate

    @property
    def follows(self) -> bool:
        """Whether `expect` must be called in each step."""
        return self._clock.exposure > 0.0 or self.estimating

    @property
    def estimating(self) -> bool:
        """Whether `add_frame` must be called with each new frame."""
        return self.estimator is not None and not self.estimator.precise

    def middle(self, stamp: float) -> float:
        """Middle of the exposure of the newest frame [s].

        Args:
            stamp: time with which the frame came [s].
        """
        if stamp != self._stamp:
            found = self.delay
            delay = self._clock.longest if found.reason else found.delay
            spread = 0.0 if found.reason else 2.0 * found.std
            self._half = 0.5 * self._clock.exposure + self._clock.jitter + spread
            self._stamp, self._middle = stamp, stamp - delay - 0.5 * self._clock.exposure
            self._stamps[self._middle] = stamp
            while len(self._stamps) > MOST_FRAMES:
                del self._stamps[next(iter(self._stamps))]
            self._refused = False
        return self._middle

    def add_frame(self, middle: float, position: Floats) -> None:
        """Add where a frame shows the marker; a frame that was added before is left out.

        Args:
            middle: of its exposure, as `middle` returned it [s].
            position: of the marker in the camera (3,) [m].
        """
        if self.estimator is not None and middle > self.followed and middle in self._stamps:
            self.estimator.add_frame(self._stamps[middle], position)
            self.followed = middle

    def end_movement(self) -> None:
        """Evaluate the last movement, when the hand has come to rest."""
        if self.estimating and self.estimator is not None:
            self.estimator.end_movement()

    def expect(self, time: float, position: Floats) -> None:
        """Add where the marker is expected in a control step.

        Args:
            time: of the step [s].
            position: of the marker in the camera (3,) [m].
        """
        self._positions.append((time, position))
        while time - self._positions[0][0] > DRIFT:
            self._positions.popleft()
        if self.estimator is not None:
            self.estimator.expect(time, position)

    @property
    def begin(self) -> float:
        """Earliest time at which the exposure of the newest frame may have begun [s]."""
        return self._middle - self._half

    def in_rest(self, since: float) -> bool:
        """Whether the newest frame was exposed during a rest from its first moment on.

        Args:
            since: time from which the lengths have been at rest [s].
        """
        return self.begin >= since and not self._refused

    def refuse(self) -> None:
        """Count the newest frame as exposed in no rest."""
        self._refused = True

    def blurred(self) -> bool | None:
        """Whether the hand still moves too fast for the exposure; None if that is not known yet."""
        if self._clock.exposure == 0.0:
            return False
        times = np.array([time for time, _ in self._positions])
        if len(times) < FEWEST_POSITIONS or times[-1] - times[0] < 0.5 * DRIFT:
            return None
        positions = np.array([position for _, position in self._positions])
        times = times - times.mean()
        speed = np.linalg.norm(times @ positions) / (times @ times)
        return bool(speed * self._clock.exposure > self._clock.blur * self._noise)

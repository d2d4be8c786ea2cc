"""Feedback of the posture: at rest, commands move until the estimated posture is the target.

Dry friction F leaves a muscle of stiffness K anywhere within F / K of its command, on the side from
which it came: 0.2 mm for 5 N at 30 N/mm, and 1.7 mm at 3 N/mm. Loads that the model does not know
move it, too, and a joint that soft muscles hardly hold leaves its posture altogether. The muscle
lengths show all this. With the error e = theta - theta_est of the target posture theta at rest, the
command is that of theta + c,

    c -> share e + gain (integral of e)    within `FOLLOWS`;    c -> 0    within `FADES` in a
                                                                          movement.

Corrections are joint angles, so that no muscle pulls against another where the map is wrong. They
are no larger than some angle, nor than the range of the joint, which may be a short slide's: what
holds the arm is pulled no harder than that. Feedback acts against a push as friction does, slowly:
the arm is soft at once and stiff after seconds. An arm with little damping may swing by it: both
gains halve as long as swings do not decay.

Kawaharazuka et al. 2018 send the map's lengths and leave what remains; feedback is ours.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np

from jmm_agent.errors import positive
from jmm_agent.types import Floats

_log = logging.getLogger(__name__)

FOLLOWS = 0.1
"""Time in which a correction follows the error at rest [s]."""
FADES = 0.5
"""Time in which a correction fades in a movement [s]."""
SWING = 0.02
"""Least error at the end of a half swing that counts [rad], or as a share of a joint's range."""
DECAYS = 0.8
"""Share of a half swing below which the next one decays [1]."""
SWINGS = 3
"""Half swings in a row that do not decay, after which gains halve."""


@dataclass(frozen=True)
class FeedbackOptions:
    """Feedback of the posture.

    Attributes:
        share: of the error that is added at once [1].
        gain: speed at which the rest is added, over the error [1/s].
        most: largest correction of a joint [rad]; [m] of one that slides.

    Raises:
        AgentError: a number is not positive.
    """

    share: float = 1.0
    gain: float = 1.0
    most: float = 0.3

    def __post_init__(self) -> None:
        positive("FeedbackOptions", share=self.share, gain=self.gain, most=self.most)


class PostureFeedback:
    """Correction of the posture that is commanded.

    Args:
        joints: number of joints, n.
        options: gains and limit.
        ranges: of the joints (n,) [rad]; no correction is larger. None: unknown.

    Attributes:
        options: as given; may be replaced at any time. None: corrections fade, and none follows.
        correction: what is added to the joint angles that are commanded (n,) [rad].
        factor: of the gains, halved when the arm swings, until an episode begins [1].
    """

    def __init__(
        self, joints: int, options: FeedbackOptions | None, ranges: Floats | None = None
    ) -> None:
        self.options = options
        self._ranges = np.full(joints, np.inf) if ranges is None else ranges
        self.correction, self._sum = np.zeros(joints), np.zeros(joints)
        self.factor, self._swings = 1.0, _Swings(self._ranges)

    def reset(self) -> None:
        """Begin without a correction."""
        self.correction, self._sum = np.zeros_like(self._sum), np.zeros_like(self._sum)
        self.factor, self._swings = 1.0, _Swings(self._ranges)

    def advance(self, passed: float, error: Floats | None) -> None:
        """Go on by a control step.

        Args:
            passed: time since the step before [s].
            error: target minus estimated joint angles (n,) [rad]; None in a movement, or while
                the estimate is not believed.
        """
        options = self.options
        if error is None or options is None:
            fading = np.exp(-passed / FADES)
            self.correction, self._sum = fading * self.correction, fading * self._sum
            self._swings = _Swings(self._ranges)
            return
        if self._swings.go_on(error):
            self.factor *= 0.5
            _log.warning("The arm swings by feedback of the posture: its gains are halved.")
        most = np.minimum(options.most, self._ranges)
        self._sum = np.clip(self._sum + self.factor * passed * options.gain * error, -most, most)
        wanted = np.clip(self._sum + self.factor * options.share * error, -most, most)
        self.correction = wanted + np.exp(-passed / FOLLOWS) * (self.correction - wanted)


class _Swings:
    """Watches whether the errors of joints swing about zero, and do not decay.

    Args:
        ranges: of the joints (n,) [rad].
    """

    def __init__(self, ranges: Floats) -> None:
        self._least = SWING * np.minimum(1.0, ranges)
        self._side, self._peak, self._last = (np.zeros(len(ranges)) for _ in range(3))
        self._count = np.zeros(len(ranges), dtype=int)

    def go_on(self, error: Floats) -> bool:
        """Whether a joint has swung several times without decay, anew.

        Args:
            error: of the joints (n,) [rad].
        """
        turned = error * self._side < 0.0
        least = self._least
        lasting = (self._last > least) & (self._peak > np.maximum(least, DECAYS * self._last))
        self._count = np.where(turned, np.where(lasting, self._count + 1, 0), self._count)
        self._last = np.where(turned, self._peak, self._last)
        self._peak = np.where(turned, np.abs(error), np.maximum(self._peak, np.abs(error)))
        self._side = np.where(error == 0.0, self._side, np.sign(error))
        if self._count.max(initial=0) < SWINGS:
            return False
        self._count[:] = 0
        return True

"""State of the arm after the estimation of one control step, as a guard receives it."""

from __future__ import annotations

from typing import NamedTuple

from jmm_agent.types import Floats
from jmm_agent.vision.hand_finder import FrameFinder


class ArmState(NamedTuple):
    """What the agent knows of the arm in one control step.

    Attributes:
        q: estimated joint angles (n,) [rad].
        jacobian: muscle Jacobian (m, n) [m/rad] by the map ...
        jacobian_at: ... at these joint angles (n,) [rad], close to the estimate.
        observations: number of marker observations that the map was learned from.
        hand_is_free: whether the hand neither holds nor touches anything.
        finder: finds the hand in frames; None for an agent without a camera.
    """

    q: Floats
    jacobian: Floats
    jacobian_at: Floats
    observations: int
    hand_is_free: bool
    finder: FrameFinder | None

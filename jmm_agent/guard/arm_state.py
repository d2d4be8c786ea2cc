"""State of the arm after the estimation of one control step, as a guard receives it."""

from __future__ import annotations

from typing import NamedTuple

from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.types import Floats
from jmm_agent.vision.hand_marker import FrameMarkers


class ArmState(NamedTuple):
    """What the agent knows of the arm in one control step.

    Attributes:
        q: estimated joint angles (n,) [rad].
        map: the joint-muscle mapping as learned so far.
        observations: number of marker observations that the map was learned from.
        hand_is_free: whether the hand neither holds nor touches anything.
        marker: finds the hand's marker in frames; None for an agent without a camera.
    """

    q: Floats
    map: JointMuscleMap
    observations: int
    hand_is_free: bool
    marker: FrameMarkers | None

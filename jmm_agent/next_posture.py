"""The next look at the hand: candidates for it, what is known when it is chosen, and the result."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from jmm_agent.command_limits import CommandLimits
from jmm_agent.errors import AgentError
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.types import Floats
from jmm_agent.updaters.forecast import Forecast
from jmm_agent.updaters.vision_memory import VisionMemory
from jmm_agent.vision.observation_fit import ObservationFitOptions

CANDIDATES = 48
"""Number of typical postures that are candidates if none are given."""


class NextPosture(NamedTuple):
    """A posture at which to look at the hand, and why.

    Attributes:
        posture: joint angles (n,) [rad].
        duration: least time of the movement to it within the limits of the commands [s].
        in_view: probability that the hand is seen [1]; 1 where it is not seen by a camera.
        before: root mean square of the hand's error that is unknown now [m].
        after: the same after the look, if the hand is seen [m].
        left_out: number of candidates that were left out, by reason.
        reason: why this posture, in one sentence.
    """

    posture: Floats
    duration: float
    in_view: float
    before: float
    after: float
    left_out: dict[str, int]
    reason: str


class PlannerModel(NamedTuple):
    """What is known of robot and camera.

    Attributes:
        forecast: of the Vision Updater, which has the posterior of the robot's lengths.
        kinematics: of the arm.
        typical: postures (N, n) [rad] that are candidates if none are given.
        shows: whether a frame shows the hand at a pose in the camera's frame (4, 4); None:
            no camera sees it.
        frames: frame of the hand, such as its marker's site, and of the camera; None: world.
        noise: of the hand's poses.
    """

    forecast: Forecast
    kinematics: ArmKinematics
    typical: Floats
    shows: Callable[[Floats], bool] | None
    frames: tuple[str, str | None]
    noise: ObservationFitOptions


class PlannerState(NamedTuple):
    """State of the agent when it asks where to look.

    Attributes:
        map: as learned so far.
        memory: of the Vision Updater.
        here: joint angles (n,) [rad] at which the movement begins.
        distance: from the last learned posture within which nothing is learned, L2 norm [rad].
        stop_margin: a pair with a joint this close to its stop is not learned [rad].
        limits: of the commands.
    """

    map: JointMuscleMap
    memory: VisionMemory
    here: Floats
    distance: float
    stop_margin: float
    limits: CommandLimits


def some_of(postures: Floats, turn: int, most: int = CANDIDATES) -> Floats:
    """Every so many of postures (N, n) [rad], at most ``most``; others in each turn.

    Args:
        postures: (N, n) [rad].
        turn: number of the choice.
        most: largest number of postures.
    """
    stride = -(-len(postures) // most)
    return np.array(postures[turn % stride :: stride])


def checked_candidates(candidates: ArrayLike, joints: Sequence[str]) -> Floats:
    """Candidates as finite angles (C, n) [rad].

    Raises:
        AgentError: they are not finite angles of all joints, or there are none.
    """
    try:
        array = np.atleast_2d(np.asarray(candidates, dtype=float))
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.ndim != 2 or array.shape[1] != len(joints) or not len(array):
        raise AgentError(
            f"Agent: candidates for a look must be joint angles of shape (C, {len(joints)}), got "
            f"shape {array.shape}."
        )
    if not np.isfinite(array).all():
        raise AgentError("Agent: candidates for a look must be finite joint angles [rad].")
    return array

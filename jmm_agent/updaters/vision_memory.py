"""What the Vision Updater remembers, and the result of one observation."""

from __future__ import annotations

from typing import NamedTuple

from jmm_agent.mapping.learner import Pairs
from jmm_agent.types import Floats
from jmm_agent.updaters.assignment import Assignment
from jmm_agent.updaters.rest_fitter import RestMemory
from jmm_agent.vision.hand_error import HandErrors
from jmm_agent.vision.marker_observation import MarkerObservation
from jmm_agent.vision.observation_prediction import ObservationPrediction


class EpisodeStart(NamedTuple):
    """What was remembered when an episode began.

    Attributes:
        newest: number of observations that were remembered since.
        elongated: `VisionMemory.elongated` of those before (K, m), as believed then.
    """

    newest: int
    elongated: Floats


class VisionMemory(NamedTuple):
    """What the Vision Updater remembers of K marker observations, the newest last.

    Attributes:
        observations: the observations.
        commands: lengths that were commanded (m,) [m], for each.
        sound: whether no muscle was saturated, for each.
        angles: fitted joint angles (K, n) [rad].
        elongated: number of permanent elongations of each muscle since each observation (K, m); a
            zeroing of all lengths counts as `MapPrior.zeroing_share`.
        pairs: the pairs that they make.
        start: what was remembered when the episode began; None once it is known whether lengths
            were zeroed anew then.
        zeroings: number of zeroings that were noticed.
        rests: what is known from all rests.
        assignment: which muscle each channel is; all lengths are in its order.
    """

    observations: list[MarkerObservation]
    commands: list[Floats]
    sound: list[bool]
    angles: Floats
    elongated: Floats
    pairs: Pairs
    start: EpisodeStart | None = None
    zeroings: int = 0
    rests: RestMemory = RestMemory()
    assignment: Assignment = Assignment()


class Rested(NamedTuple):
    """What was learned from a rest in which the hand was not seen.

    Attributes:
        angles: joint angles (n,) [rad].
        moved: as `Seen.moved`.
    """

    angles: Floats
    moved: bool


class Seen(NamedTuple):
    """Result of one marker observation.

    Attributes:
        angles: joint angles by vision (n,) [rad], theta_ik.
        error: theta_est - theta_ik (n,) [rad], the paper's joint error.
        learned: whether the map was moved.
        reason: why it was not moved; empty if it was.
        zeroed: whether it showed that all lengths were zeroed anew.
        detail: how far the measured pose is from that of ``angles``, if that is the reason.
        moved: whether it showed that the lengths were zeroed at quite another posture than was
            believed. Angles that were estimated before are then wrong.
        predicted: what was expected before it was learned; None if nothing was learned from it, or
            if each observation is fitted alone.
        hand_error: expected errors of the hand with the map before the update and after it; None if
            the update was not judged.
    """

    angles: Floats
    error: Floats
    learned: bool
    reason: str
    zeroed: bool = False
    detail: str = ""
    moved: bool = False
    predicted: ObservationPrediction | None = None
    hand_error: HandErrors | None = None

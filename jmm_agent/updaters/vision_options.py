"""Options of the Vision Updater."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, get_args

from jmm_agent.errors import AgentError
from jmm_agent.vision.balance import BalanceOptions
from jmm_agent.vision.camera_unknowns import CameraPrior
from jmm_agent.vision.hold_out import HoldOutOptions
from jmm_agent.vision.observation_fit import ObservationFitOptions
from jmm_agent.vision.pose_errors import JointPrior

HandKind = Literal["marker", "seen"]
"""How frames show the hand, see `VisionOptions`."""
PairLengths = Literal["min", "l_target", "l"]
"""Lengths of a pair, see `VisionOptions`."""


@dataclass(frozen=True)
class VisionOptions:
    """Options of the Vision Updater (sec. III-C).

    Attributes:
        hand: how frames show the hand: by the marker on it, or itself ("seen"), found by a
            `HandDetector`.
        distance: least distance from the posture of the last update, L2 norm [rad].
        unexpected: probability of a right pose that is as far from where it is expected as one that
            is not believed, for hands that are seen without a marker [1], see
            `jmm_agent.updaters.unexpected_poses`; 0: all are believed.
        threshold: C, the largest ||theta_ik - theta_est||_2 that is believed [rad].
        lengths: lengths of a pair: l_target as in the paper, l, or min(l, l_target). None: l if
            commands have a feed-forward of tensions (`AgentOptions.feed_forward`), which then tend
            to what is measured, else min(l, l_target).
        noise: standard deviation of a pair's lengths [m].
        saturation: a pair with a tension above this is not learned [N].
        stop_margin: a pair with a joint this close to its stop is not learned [rad].
        position_residual: an observation that the fit misses by more than this distance is dropped
            [m].
        rotation_residual: an observation that the fit misses by more than this angle is dropped
            [rad].
        fit: what is fitted together: observations, lengths and tensions of all rests, and the
            posture at which the lengths were zeroed ("rests"); observations and lengths only, all
            at once ("together") or the newest first ("incremental", several times faster, with the
            same minimum within the tolerances of the fit); or each observation alone, as in the
            paper ("alone"). An observation that is only evaluated moves no other one of "rests" and
            "incremental".
        balance: how far tensions and loads may disagree, and how many rests without an observation
            are remembered, if rests are fitted.
        camera: standard deviations of the camera's errors, which are unknowns of the fit of rests.
        joints: the same of the places and axes of the drawing's joints, as long as observations do
            not show other ones.
        misplaced: the usual ones of a drawing whose bones do not fit, here bones that are 5 mm and
            axes that are 3 deg off; observations decide between multiples of them.
        observations: options of the fit.
        hold_out: which observations are held out, to undo updates that make the map worse; None:
            none.
        zeroing_recent: number of first observations of an episode, or since a muscle seemed to be
            elongated within it, among which it is looked whether all lengths were zeroed anew; 0:
            it is not looked for.
        zeroing_least: least number of earlier observations for that.
        zeroing_evidence: logarithm of the Bayes factor from which on it is believed. Over eight
            actual robots (seeds 0-7) that were not zeroed anew it was -8 or less.

    Raises:
        AgentError: the hand is neither "marker" nor "seen", or a probability is none.
    """

    hand: HandKind = "marker"
    distance: float = 0.15
    unexpected: float = 1e-4
    threshold: float = 2.0
    lengths: PairLengths | None = None
    noise: float = 0.001
    saturation: float = 450.0
    stop_margin: float = 0.005
    position_residual: float = 0.02
    rotation_residual: float = 0.06
    fit: Literal["rests", "together", "incremental", "alone"] = "rests"
    balance: BalanceOptions = field(default_factory=BalanceOptions)
    camera: CameraPrior = field(default_factory=CameraPrior)
    joints: JointPrior = field(default_factory=JointPrior)
    misplaced: JointPrior = field(default_factory=lambda: JointPrior(0.003, 0.035))
    observations: ObservationFitOptions = field(default_factory=ObservationFitOptions)
    hold_out: HoldOutOptions | None = None
    zeroing_recent: int = 6
    zeroing_least: int = 5
    zeroing_evidence: float = 0.0

    def __post_init__(self) -> None:
        if self.hand not in get_args(HandKind):
            raise AgentError(
                f"VisionOptions: hand is {self.hand!r}, but must be 'marker' or 'seen'."
            )
        if not 0.0 <= self.unexpected < 1.0:
            raise AgentError(
                f"VisionOptions: unexpected is {self.unexpected}, but must be at least 0 and "
                "below 1."
            )

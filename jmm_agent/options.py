"""Options of the agent and of its parts."""

from __future__ import annotations

from dataclasses import dataclass, field

from jmm_agent.kalman_filter_options import EstimatorOptions
from jmm_agent.mapping.learner import BatchOptions
from jmm_agent.mapping.prior import PriorOptions
from jmm_agent.settling import SettlingOptions
from jmm_agent.updaters import AntagonismOptions, VisionOptions


@dataclass(frozen=True)
class AgentOptions:
    """Options of an `Agent`; the defaults are those of the experiments.

    Attributes:
        learn_antagonism: whether the Antagonism Updater learns (sec. III-B).
        learn_vision: whether the Vision Updater learns (sec. III-C).
        hand_marker: id of the marker on the hand.
        can_marker: id of the marker on the can.
        camera: frame of the camera in the kinematics.
        marker_site: site of the hand's marker in the kinematics.
        prior: prior of the map's error.
        batch: what is learned beside a new pair.
        settling: when lengths count as settled.
        antagonism: options of the Antagonism Updater.
        vision: options of the Vision Updater.
        estimator: noise levels and limits of the joint estimator.
    """

    learn_antagonism: bool = True
    learn_vision: bool = True
    hand_marker: int = 0
    can_marker: int = 1
    camera: str = "eye"
    marker_site: str = "marker_hand"
    prior: PriorOptions = field(default_factory=PriorOptions)
    batch: BatchOptions = field(default_factory=BatchOptions)
    settling: SettlingOptions = field(default_factory=SettlingOptions)
    antagonism: AntagonismOptions = field(default_factory=AntagonismOptions)
    vision: VisionOptions = field(default_factory=VisionOptions)
    estimator: EstimatorOptions = field(default_factory=EstimatorOptions)

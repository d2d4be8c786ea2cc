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
    """Everything that can be set; the defaults are what the experiments use.

    Attributes:
        learn_antagonism, learn_vision: which updaters run.
        hand_marker, can_marker: ids of the markers.
        camera, marker_site: frames of the kinematics.
        prior, batch, settling, antagonism, vision, estimator: of the parts.
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

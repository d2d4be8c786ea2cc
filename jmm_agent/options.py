"""Options of the agent and of its parts."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import get_args

from jmm_agent.errors import AgentError
from jmm_agent.heat.parameters import HeatOptions
from jmm_agent.kalman_filter_options import EstimatorOptions
from jmm_agent.learning.options import LearningOptions
from jmm_agent.learning_monitor import LearningMonitorOptions
from jmm_agent.mapping.learner import BatchOptions
from jmm_agent.mapping.prior import PriorOptions
from jmm_agent.posture_feedback import FeedbackOptions
from jmm_agent.settling import SettlingOptions
from jmm_agent.tension_distribution import TensionOptions
from jmm_agent.time_line import TimeLineOptions
from jmm_agent.updaters import AntagonismOptions, VisionOptions
from jmm_agent.vision.camera_clock import CameraClock
from jmm_agent.vision.can_shape import CanKind, CanShape


@dataclass(frozen=True)
class AgentOptions:
    """Options of an `Agent`; the defaults are those of the experiments.

    Attributes:
        learn_antagonism: whether the Antagonism Updater learns (sec. III-B).
        learn_vision: whether the Vision Updater learns (sec. III-C).
        camera_clock: delay and exposure of the camera.
        hand_marker: id of the marker on the hand.
        can_marker: id of the marker on the can.
        can: how frames show the can: by the marker on it, or itself ("seen"), found by a
            `CanFinder`.
        can_shape: size and colour of a can that is seen.
        camera: frame of the camera in the kinematics; empty for a robot without a camera, whose
            hand is measured otherwise (`Agent.observe`).
        marker_site: site of the hand's marker in the kinematics.
        grip: frame of the kinematics at which the hand holds a load; the marker's if there is none
            of that name.
        feed_forward: whether commands are shorter than the map's lengths by what the tensions that
            hold the posture need, see `FeedForward`. Only where loads and `Agent.motors` are known.
        feedback: of the posture at rest, see `PostureFeedback`; None: friction and unknown loads
            leave the arm where they will.
        tension: which tensions those are beside the loads.
        arrival: a joint that rests farther from its target has not arrived [rad].
        map_rate: largest speed at which commands follow the map when it was changed [m/s].
        prior: prior of the map's error.
        batch: what is learned beside a new pair.
        settling: when lengths count as settled.
        antagonism: options of the Antagonism Updater.
        vision: options of the Vision Updater.
        learning: where learning runs, and when its results enter.
        estimator: noise levels and limits of the joint estimator.
        time_line: which time stamps are used.
        learning_monitor: from when on it is named that nothing is learned.
        heat: thermal model of the motors and limit of their core temperatures, which
            `kengoro.make_agent` makes a `HeatMonitor` of; None: the motors' heat is not watched.

    Raises:
        AgentError: `map_rate` is not positive, or the can neither "marker" nor "seen".
    """

    learn_antagonism: bool = True
    learn_vision: bool = True
    camera_clock: CameraClock = field(default_factory=CameraClock)
    hand_marker: int = 0
    can_marker: int = 1
    can: CanKind = "marker"
    can_shape: CanShape = field(default_factory=CanShape)
    camera: str = "eye"
    marker_site: str = "marker_hand"
    grip: str = "grip"
    feed_forward: bool = True
    feedback: FeedbackOptions | None = None
    tension: TensionOptions = field(default_factory=TensionOptions)
    arrival: float = 0.1
    map_rate: float = 0.03
    prior: PriorOptions = field(default_factory=PriorOptions)
    batch: BatchOptions = field(default_factory=BatchOptions)
    settling: SettlingOptions = field(default_factory=SettlingOptions)
    antagonism: AntagonismOptions = field(default_factory=AntagonismOptions)
    vision: VisionOptions = field(default_factory=VisionOptions)
    learning: LearningOptions = field(default_factory=LearningOptions)
    estimator: EstimatorOptions = field(default_factory=EstimatorOptions)
    time_line: TimeLineOptions = field(default_factory=TimeLineOptions)
    learning_monitor: LearningMonitorOptions = field(default_factory=LearningMonitorOptions)
    heat: HeatOptions | None = None

    def __post_init__(self) -> None:
        if not self.map_rate > 0.0:
            raise AgentError(
                f"AgentOptions: map_rate is {self.map_rate} m/s, but must be positive; infinite to "
                "jump."
            )
        if self.can not in get_args(CanKind):
            raise AgentError(f"AgentOptions: can is {self.can!r}, but must be 'marker' or 'seen'.")

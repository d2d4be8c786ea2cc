"""Observes the hand: which frame, or which measured pose of it, is learned from in each rest.

A frame counts if it was exposed during the rest (`ExposureClock`) and the hand did not move
meanwhile; a measured pose counts if the hand was at rest at its time (`HandPoses`). Each rest gives
one observation, of its frame or of a pose.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from jmm_agent.errors import AgentError
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.learning.frames import beside
from jmm_agent.learning.job_queue import Entered
from jmm_agent.observation import SensorReadings
from jmm_agent.options import AgentOptions
from jmm_agent.types import Floats
from jmm_agent.vision.camera_clock import ExposureClock
from jmm_agent.vision.camera_delay import DelayEstimate
from jmm_agent.vision.hand_marker import FrameJob, FrameMarkers, HandMarker
from jmm_agent.vision.hand_pose import ArmSample, HandPoses
from jmm_agent.vision.marker_detector import Detector, MarkerPose
from jmm_agent.vision.marker_observation import Frames

BLURRED = "the hand moved while the frame was exposed"
NO_MARKER = "the hand's marker was not seen"
NOT_AT_REST = "a fault was found, or the hand was not free"


class HandObservation(NamedTuple):
    """The pose of the hand in a rest, and the state of the arm at that time.

    Attributes:
        sample: state of the arm.
        pose: (4, 4), translation in metres.
        frames: whose pose it is, and in which frame; None: the hand's marker in the camera.
        covariance: of the pose (6, 6), see `pose_covariance`; None: that of a marker in a frame.
    """

    sample: ArmSample
    pose: Floats
    frames: Frames | None = None
    covariance: Floats | None = None


class Observed(NamedTuple):
    """What a control step shows of the hand.

    Attributes:
        observation: to learn from; None if there is none.
        dropped: why others are not learned from, one reason for each.
    """

    observation: HandObservation | None = None
    dropped: tuple[str, ...] = ()


class HandObserver:
    """Selects what is learned from among camera frames and measured poses of the hand.

    Args:
        detector: finds markers in frames; None for an agent without a camera.
        kinematics: of the arm.
        options: of the agent.

    Attributes:
        markers: markers in the newest frame in which they were detected, by id.
        due: whether an observation of the present rest is awaited.

    Raises:
        AgentError: there is a detector without a camera.
    """

    def __init__(
        self, detector: Detector | None, kinematics: ArmKinematics, options: AgentOptions
    ) -> None:
        self._options = options
        self._marker = _hand_marker(detector, kinematics, options)
        self._frames = beside(self._marker, options.learning)
        noise = options.vision.observations.position_noise
        self._exposure = ExposureClock(options.camera_clock, noise)
        self._poses = HandPoses(kinematics, options.settling.window, noise)
        self._frame_time, self._asked = -np.inf, np.inf
        self.markers: dict[int, MarkerPose] = {}
        self.due = False

    @property
    def shows(self) -> Callable[[Floats], bool] | None:
        """Whether a frame shows the hand at a pose in the camera (4, 4); None: unknown."""
        return None if self._marker is None else self._marker.shows

    def reset(self) -> None:
        """Forget all frames and poses, as before a new episode."""
        if self._frames is not None:
            self._frames.reset()
        self._frame_time = -np.inf
        self._exposure.reset()
        self._poses.reset()
        self.due, self.markers = False, {}

    def map_changed(self) -> None:
        """Forget what was expected with another map."""
        self._exposure.map_changed()
        self._poses.map_changed()

    @property
    def delay(self) -> DelayEstimate:
        """Delay of the camera, as given in the options or as estimated so far."""
        return self._exposure.delay

    @property
    def clock_problem(self) -> str:
        """What is wrong with the times of measured poses; empty if nothing is known to be."""
        return self._poses.clock_problem

    @property
    def finder(self) -> FrameMarkers | None:
        """Finds the hand's marker in frames; None for an agent without a camera."""
        return self._frames or self._marker

    @property
    def entered(self) -> list[Entered]:
        """Control steps at which detections entered that were computed beside the loop."""
        return [] if self._frames is None else self._frames.queue.entered

    def replay(self, entered: Iterable[Entered]) -> None:
        """Let detections enter at recorded steps.

        Args:
            entered: recorded ends of jobs, in order.
        """
        if self._frames is not None:
            self._frames.queue.replay(entered)

    def advance(self, step: int) -> None:
        """Let the detections of a control step enter.

        Args:
            step: number of the step.

        Raises:
            AgentError: a frame has a wrong shape or type, or its detection failed.
        """
        if self._frames is not None:
            self._frames.advance(step)

    def close(self) -> None:
        """End the thread beside the loop; a later frame starts another one."""
        if self._frames is not None:
            self._frames.close()

    def exposed(self, stamp: float) -> float:
        """Middle of the exposure of the newest frame [s].

        Args:
            stamp: time with which the frame came [s].
        """
        return self._exposure.middle(stamp)

    def add_pose(self, pose: ArrayLike, covariance: ArrayLike, time: float, frames: Frames) -> None:
        """Add a measured pose of the hand; see `HandPoses.add`."""
        self._poses.add(pose, covariance, time, frames)

    def begin_rest(self) -> None:
        """Await an observation of a rest, at which the lengths have settled just now."""
        self.due, self._asked = self._marker is not None or self._poses.alive, np.inf
        self._exposure.end_movement()
        self._poses.end_movement()

    def forget_rest(self) -> None:
        """Await no observation until the next rest."""
        self.due, self._asked = False, np.inf

    def follow(self, readings: SensorReadings, q: Floats) -> None:
        """Follow the marker, where exposure or delay of the camera demand it.

        Args:
            readings: of this control step.
            q: estimated joint angles (n,) [rad].

        Raises:
            AgentError: the frame has a wrong shape or type.
        """
        if self._marker is None or not self._exposure.follows:
            return
        self._exposure.expect(readings.time, self._marker.pose(q)[:3, 3])
        if not self._exposure.estimating or readings.frame is None:
            return
        after = np.nextafter(self._exposure.followed, np.inf)
        found = (self._detected(readings, q, after) or {}).get(self._options.hand_marker)
        if found is not None:
            position = found.pose_marker_in_camera[:3, 3]
            self._exposure.add_frame(self._frame_time, position)

    def observe_pose(self, sample: ArmSample, trusted: bool) -> Observed:
        """A measured pose of the hand, if one was measured at rest.

        Args:
            sample: state of the arm in this control step.
            trusted: whether there is no fault and the hand is free.
        """
        poses, observation = self._poses, None
        poses.record(sample)
        if not trusted:
            poses.drop(NOT_AT_REST)
        elif (found := poses.take()) is not None:
            self.due &= not poses.used(sample.since)
            pose, then = found
            observation = HandObservation(then, pose.pose, pose.frames, pose.covariance)
        return Observed(observation, tuple(poses.take_dropped()))

    def observe_frame(self, readings: SensorReadings, sample: ArmSample) -> Observed:
        """The marker in a frame that was exposed during the rest, if it is sharp.

        Args:
            readings: of this control step.
            sample: state of the arm in it.

        Raises:
            AgentError: the frame has a wrong shape or type.
        """
        if not np.isfinite(sample.since):
            self.due = False
        if self._marker is None or not self.due or not self._exposure.in_rest(sample.since):
            return Observed()
        blurred = self._exposure.blurred()
        if blurred is None:
            return Observed()
        if blurred:
            self._exposure.refuse()
            return Observed(dropped=(BLURRED,))
        self._asked = min(self._asked, readings.frame_time)
        markers = self._detected(readings, sample.estimate, self._asked)
        if markers is None:
            return Observed()
        self.due = False
        self._poses.rest_used(sample.since)
        found = markers.get(self._options.hand_marker)
        if found is None:
            return Observed(dropped=(NO_MARKER,))
        return Observed(HandObservation(sample, found.pose_marker_in_camera))

    def detect(self, readings: SensorReadings, q: Floats) -> dict[int, MarkerPose]:
        """Markers in the newest frame, by id, searched at once; those of before without a new one.

        Args:
            readings: of this control step.
            q: estimated joint angles (n,) [rad].

        Raises:
            AgentError: the frame has a wrong shape or type.
        """
        new = readings.frame_time != self._frame_time
        if self._marker is not None and readings.frame is not None and new:
            self.markers = self._marker.detect(readings.frame, q).poses
            self._frame_time = readings.frame_time
        return self.markers

    def why_unobserved(self, readings: SensorReadings, since: float) -> str:
        """Why the observation of a rest that is awaited is not there; empty if none is.

        Args:
            readings: of this control step.
            since: time from which the lengths have been at rest [s].
        """
        if self._marker is not None:
            return _why_no_frame(readings, since - self._exposure.begin) if self.due else ""
        if self.due or (self._poses.stalled and not self._poses.used(since)):
            return "no pose of the hand was measured in this rest"
        return ""

    def _detected(
        self, readings: SensorReadings, q: Floats, since: float
    ) -> dict[int, MarkerPose] | None:
        """Markers in the newest frame that was searched; None before one of a time [s] or later."""
        if self._frames is None or readings.frame is None:
            return self.detect(readings, q)
        self._frames.submit(FrameJob(readings.frame_time, readings.frame, q, readings.lengths))
        if self._frames.newest is None or self._frames.newest[0].time < since:
            return None
        self._frame_time, self.markers = self._frames.newest[0].time, self._frames.newest[1].poses
        return self.markers


def _hand_marker(
    detector: Detector | None, kinematics: ArmKinematics, options: AgentOptions
) -> HandMarker | None:
    if detector is None:
        return None
    if not options.camera:
        raise AgentError("Agent: a detector needs a camera, but the options name none.")
    names = options.camera, options.marker_site
    return HandMarker(detector, kinematics, options.hand_marker, *names)


def _why_no_frame(readings: SensorReadings, early: float) -> str:
    """Why the newest frame does not show a rest that began some time [s] after its exposure."""
    if readings.frame is None:
        return "there is no frame"
    if not np.isfinite(readings.frame_time):
        return "the frame's time is not finite, or it is far ahead of the readings"
    if early <= 0.0:
        return "the hand still moved while the newest frame was exposed"
    return f"the newest frame was taken {early:.3g} s before the rest began"

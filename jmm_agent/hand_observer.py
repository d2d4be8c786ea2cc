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
from jmm_agent.vision.hand_detection import HandDetector
from jmm_agent.vision.hand_finder import (
    Findings,
    FrameFinder,
    FrameJob,
    Hand,
    HandFinder,
    HandMissed,
    HandSeen,
)
from jmm_agent.vision.hand_marker import HandMarker
from jmm_agent.vision.hand_pose import ArmSample, HandPoses
from jmm_agent.vision.hand_shape import HandShape
from jmm_agent.vision.marker_detector import Detector, MarkerPose
from jmm_agent.vision.marker_observation import Frames

BLURRED = "the hand moved while the frame was exposed"
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
        detector: finds markers in frames; None if there are none to find.
        kinematics: of the arm.
        options: of the agent.
        hand: finds the hand without a marker, for `VisionOptions(hand="seen")`.

    Attributes:
        hand: the hand in the newest frame that was searched for it, or why it was not found.
        markers: markers in the newest frame in which they were detected, by id.
        due: whether an observation of the present rest is awaited.

    Raises:
        AgentError: there is a detector without a camera, or not the one that the options name.
    """

    def __init__(
        self,
        detector: Detector | None,
        kinematics: ArmKinematics,
        options: AgentOptions,
        hand: HandDetector | None = None,
    ) -> None:
        self._finder = _finder(detector, kinematics, options, hand)
        self._frames = beside(self._finder, options.learning)
        noise = options.vision.observations.position_noise
        noise = noise if self._finder is None else self._finder.position_noise
        self._exposure = ExposureClock(options.camera_clock, noise)
        self._poses = HandPoses(kinematics, options.settling.window, noise)
        self._frame_time = self._marker_time = -np.inf
        self._asked = np.inf
        self.hand = self._none()
        self.markers: dict[int, MarkerPose] = {}
        self.due = False

    @property
    def shows(self) -> Callable[[Floats], bool] | None:
        """Whether a frame shows the hand at a pose in the camera (4, 4); None: unknown."""
        return None if self._finder is None else self._finder.shows

    def reset(self) -> None:
        """Forget all frames and poses, as before a new episode."""
        if self._frames is not None:
            self._frames.reset()
        if self._finder is not None:
            self._finder.reset()
        self._frame_time = self._marker_time = -np.inf
        self._exposure.reset()
        self._poses.reset()
        self.due, self.hand, self.markers = False, self._none(), {}

    def map_changed(self) -> None:
        """Forget what was expected with another map."""
        if self._finder is not None:
            self._finder.map_changed()
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
    def finder(self) -> FrameFinder | None:
        """Finds the hand in frames; None for an agent without a camera."""
        return self._frames or self._finder

    @property
    def frames(self) -> tuple[str, str] | None:
        """Whose pose a frame shows, and the camera; None for an agent without a camera."""
        return None if self._finder is None else self._finder.frames

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
        self.due, self._asked = self._finder is not None or self._poses.alive, np.inf
        self._exposure.end_movement()
        self._poses.end_movement()

    def forget_rest(self) -> None:
        """Await no observation until the next rest."""
        self.due, self._asked = False, np.inf

    def follow(self, readings: SensorReadings, q: Floats) -> None:
        """Follow the hand, in its frames where exposure or delay of the camera demand it.

        Args:
            readings: of this control step.
            q: estimated joint angles (n,) [rad].

        Raises:
            AgentError: the frame has a wrong shape or type.
        """
        if self._finder is None:
            return
        self._finder.follow(q)
        if not self._exposure.follows:
            return
        self._exposure.expect(readings.time, self._finder.pose(q)[:3, 3])
        if not self._exposure.estimating or readings.frame is None:
            return
        after = np.nextafter(self._exposure.followed, np.inf)
        hand = self._found(readings, q, after)
        if isinstance(hand, HandSeen):
            self._exposure.add_frame(self._frame_time, hand.pose[:3, 3])

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
        """The hand in a frame that was exposed during the rest, if it is sharp.

        Args:
            readings: of this control step.
            sample: state of the arm in it.

        Raises:
            AgentError: the frame has a wrong shape or type.
        """
        if not np.isfinite(sample.since):
            self.due = False
        if self._finder is None or not self.due or not self._exposure.in_rest(sample.since):
            return Observed()
        blurred = self._exposure.blurred()
        if blurred is None:
            return Observed()
        if blurred:
            self._exposure.refuse()
            return Observed(dropped=(BLURRED,))
        self._asked = min(self._asked, readings.frame_time)
        hand = self._found(readings, sample.estimate, self._asked)
        if hand is None:
            return Observed()
        self.due = False
        self._poses.rest_used(sample.since)
        if isinstance(hand, HandMissed):
            return Observed(dropped=(hand.reason,))
        return Observed(HandObservation(sample, hand.pose, hand.frames, hand.covariance))

    def detect(self, readings: SensorReadings, q: Floats) -> dict[int, MarkerPose]:
        """Markers in the newest frame, by id, searched at once; those of before without a new one.

        Args:
            readings: of this control step.
            q: estimated joint angles (n,) [rad].

        Raises:
            AgentError: the frame has a wrong shape or type.
        """
        new = readings.frame_time != self._marker_time
        if self._finder is not None and readings.frame is not None and new:
            self._take(readings.frame_time, self._finder.find_markers(readings.frame, q))
        return self.markers

    def why_unobserved(self, readings: SensorReadings, since: float) -> str:
        """Why the observation of a rest that is awaited is not there; empty if none is.

        Args:
            readings: of this control step.
            since: time from which the lengths have been at rest [s].
        """
        if self._finder is not None:
            return _why_no_frame(readings, since - self._exposure.begin) if self.due else ""
        if self.due or (self._poses.stalled and not self._poses.used(since)):
            return "no pose of the hand was measured in this rest"
        return ""

    def _found(self, readings: SensorReadings, q: Floats, since: float) -> Hand | None:
        """The hand in the newest frame that was searched; None before one of a time [s] or later.

        Where frames are searched in the step that needs them, that is the newest frame.
        """
        finder, frame, frames = self._finder, readings.frame, self._frames
        if finder is None or frame is None:
            return self.hand
        if frames is None:
            if readings.frame_time != self._frame_time:
                self._take(readings.frame_time, finder.find(frame, q))
            return self.hand
        frames.submit(FrameJob(readings.frame_time, frame, q, readings.lengths))
        if frames.newest is None or frames.newest[0].time < since:
            return None
        job, found = frames.newest
        self._take(job.time, found)
        return self.hand

    def _none(self) -> Hand:
        """The hand before a frame was searched."""
        return HandMissed("absent", "" if self._finder is None else self._finder.missing)

    def _take(self, time: float, found: Findings) -> None:
        """Keep what was found in a frame of a time [s]."""
        if found.hand is not None:
            self.hand, self._frame_time = found.hand, time
        if found.markers is not None:
            self.markers, self._marker_time = found.markers, time


def _finder(
    detector: Detector | None,
    kinematics: ArmKinematics,
    options: AgentOptions,
    hand: HandDetector | None,
) -> HandFinder | None:
    """Finds the hand as the options want it; None without a camera."""
    seen = options.vision.hand == "seen"
    if detector is None and hand is None and not (seen and options.camera):
        return None
    if not options.camera:
        raise AgentError("Agent: a detector needs a camera, but the options name none.")
    if seen != (hand is not None):
        which = "needs a detector of the hand" if seen else "needs none of the hand"
        raise AgentError(f"Agent: VisionOptions(hand={options.vision.hand!r}) {which}.")
    if hand is not None:
        return HandShape(hand, detector, kinematics, options.camera)
    assert detector is not None
    number, names = options.hand_marker, (options.camera, options.marker_site)
    noise = options.vision.observations.position_noise
    return HandMarker(detector, kinematics, number, *names, noise)


def _why_no_frame(readings: SensorReadings, early: float) -> str:
    """Why the newest frame does not show a rest that began some time [s] after its exposure."""
    if readings.frame is None:
        return "there is no frame"
    if not np.isfinite(readings.frame_time):
        return "the frame's time is not finite, or it is far ahead of the readings"
    if early <= 0.0:
        return "the hand still moved while the newest frame was exposed"
    return f"the newest frame was taken {early:.3g} s before the rest began"

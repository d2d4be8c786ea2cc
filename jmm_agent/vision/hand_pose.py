"""Measured poses of the hand, in place of camera frames: which of them are learned from.

A motion capture system, an RGB-D tracker or a node that detects tags measures the pose of some
frame of the hand. Its numbers arrive late, and while the lengths still settle it is not known
whether the hand was at rest when they were measured. So the poses wait, and the newest pose of a
rest is learned from, with the muscle lengths of its own time.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from jmm_agent.errors import AgentError
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.types import Floats
from jmm_agent.vision.marker_observation import Frames
from jmm_agent.vision.pose_clock import PoseClock
from jmm_agent.vision.pose_covariance import checked_covariance, checked_pose

HISTORY = 2.0
"""Time for which states of the arm are kept [s]; a pose may arrive so late."""
AHEAD = 0.1
"""How much later than the newest sensor readings a pose may be measured [s]."""
ALIVE = 1.0
"""A tracker whose newest pose is older than this is not waited for [s]."""
LEAST_MOTION = 1e-9
"""Motion of a frame that moves with no joint, but for rounding [m/rad, rad/rad]."""
WORLD = "world"
"""Name of the world among frames in which a pose is given."""

MOVING = "the hand was not at rest when its pose was measured"
REPEATED = "the hand's pose was measured again in the same rest"
LATE = f"the hand's pose arrived more than {HISTORY:g} s late"
EARLY = "the hand's pose was measured before the first sensor readings"


class HandPose(NamedTuple):
    """One measured pose of the hand.

    Attributes:
        pose: (4, 4), translation in metres.
        covariance: of the pose (6, 6), see `pose_covariance`.
        time: of the measurement [s].
        frames: whose pose it is, and in which frame; None: world.
    """

    pose: Floats
    covariance: Floats
    time: float
    frames: Frames


class ArmSample(NamedTuple):
    """What was measured and commanded in a control step.

    Attributes:
        time: of the readings [s].
        since: time from which the lengths have been at rest [s]; infinite while that is not known.
        estimate: estimated joint angles (n,) [rad].
        lengths: measured muscle lengths (m,) [m].
        target: target muscle lengths (m,) [m] while they were measured.
        tensions: measured muscle tensions (m,) [N].
        joint_angles: measured joint angles (n,) [rad], NaN where there is no encoder; None: none.
    """

    time: float
    since: float
    estimate: Floats
    lengths: Floats
    target: Floats
    tensions: Floats
    joint_angles: Floats | None


class HandPoses:
    """Keeps measured poses until it is known whether they belong to a rest.

    Args:
        kinematics: of the arm.
        window: time after which the lengths at rest are known to be so [s].
        noise: standard deviation of a position [m].

    Attributes:
        clock_problem: by how much the times of the poses are wrong, in a sentence; empty if they
            are right or unknown.
    """

    def __init__(self, kinematics: ArmKinematics, window: float, noise: float) -> None:
        self._kinematics, self._window = kinematics, window
        self._known: set[Frames] = set()
        self._noise = noise
        self._followed: Frames | None = None
        self.reset()

    def reset(self) -> None:
        """Forget all poses and states, as at the start of an episode."""
        self._samples: deque[ArmSample] = deque()
        self._rests: deque[tuple[float, float]] = deque()
        self._waiting: deque[HandPose] = deque()
        self._dropped: deque[str] = deque()
        self._newest = self._used = -np.inf
        self._clock = PoseClock(self._noise)
        self.clock_problem = ""

    def map_changed(self) -> None:
        """Forget expected positions: those of another map cannot be compared with the next ones."""
        self._clock.reset()

    def end_movement(self) -> None:
        """Compare the clock of the poses with that of the readings, when the hand is at rest."""
        self._clock.end_movement()
        self.clock_problem = self._clock.problem()

    def add(self, pose: ArrayLike, covariance: ArrayLike, time: float, frames: Frames) -> None:
        """Add one measured pose.

        Args:
            pose: (4, 4), translation in metres.
            covariance: of the pose (6, 6), see `checked_covariance`.
            time: of the measurement [s].
            frames: whose pose it is, and in which frame; None or `WORLD`: world.

        Raises:
            AgentError: unknown frames, or no joint moves one against the other; pose or covariance
                are not valid; or the time is not finite or in the future.
        """
        if frames[1] == WORLD:
            frames = frames[0], None
        self._check_frames(frames)
        found = HandPose(checked_pose(pose), checked_covariance(covariance), float(time), frames)
        if not np.isfinite(found.time):
            raise AgentError(f"The time of a measured pose must be finite, got {time} s.")
        samples = self._samples
        if not samples:
            self._dropped.append(EARLY)
            return
        if found.time > samples[-1].time + AHEAD:
            raise AgentError(
                f"A pose was measured at {found.time} s, in the future: the newest sensor readings "
                f"are of {samples[-1].time} s. Give the time on the clock of the readings."
            )
        self._newest = max(self._newest, found.time)
        if found.time < samples[-1].time - HISTORY:
            self._dropped.append(LATE)
        elif found.time < samples[0].time:
            self._dropped.append(EARLY)
        else:
            self._waiting.append(found)
            self._followed = self._followed or frames
            if frames == self._followed:
                self._clock.add(found.time, found.pose[:3, 3])

    def record(self, sample: ArmSample) -> None:
        """Keep the state of the arm in a control step."""
        self._samples.append(sample)
        late = sample.time - self._newest
        if self._followed is not None and late <= HISTORY:
            expected = self._kinematics.pose(self._followed[0], sample.estimate, self._followed[1])
            self._clock.expect(sample.time, expected[:3, 3])
        begin = sample.time - HISTORY - self._window
        while self._samples[0].time < begin:
            self._samples.popleft()
        if np.isfinite(sample.since):
            if self._rests and self._rests[-1][0] == sample.since:
                self._rests.pop()
            self._rests.append((sample.since, sample.time))
        while self._rests and self._rests[0][1] < begin:
            self._rests.popleft()

    def rest_used(self, since: float) -> None:
        """Learn from no pose of the rest that began at a time [s]."""
        self._used = since

    def used(self, since: float) -> bool:
        """Whether the rest that began at a time [s] was learned from."""
        return since == self._used

    @property
    def alive(self) -> bool:
        """Whether poses arrive, so that one of the present rest can be expected."""
        return bool(self._samples) and self._samples[-1].time - self._newest <= ALIVE

    @property
    def stalled(self) -> bool:
        """Whether poses have arrived before, but none do now."""
        return bool(np.isfinite(self._newest)) and not self.alive

    def take(self) -> tuple[HandPose, ArmSample] | None:
        """The newest pose of a rest that was not used yet, with the state of the arm at its time.

        Each rest gives one pose.
        """
        found: HandPose | None = None
        now, used = self._samples[-1].time, -np.inf
        for _ in range(len(self._waiting)):
            pose = self._waiting.popleft()
            since = self._rest_at(pose.time)
            if since is None:
                if now - pose.time > self._window * 1.5:
                    self._dropped.append(MOVING)
                else:
                    self._waiting.append(pose)
            elif self.used(since):
                self._dropped.append(REPEATED)
            else:
                if found is not None:
                    self._dropped.append(REPEATED)
                    if found.time > pose.time:
                        continue
                found, used = pose, since
        if found is None:
            return None
        self._used = used
        return found, self._sample_at(found.time)

    def drop(self, reason: str) -> None:
        """Use none of the poses that wait.

        Args:
            reason: why.
        """
        self._dropped.extend([reason] * len(self._waiting))
        self._waiting.clear()

    def take_dropped(self) -> list[str]:
        """Reasons why poses were dropped since the last call, one for each."""
        return [self._dropped.popleft() for _ in range(len(self._dropped))]

    def _rest_at(self, time: float) -> float | None:
        """When the rest began in which a time [s] lies; None if it is not known to be in one."""
        for since, until in reversed(self._rests):
            if since <= time <= until:
                return since
        return None

    def _sample_at(self, time: float) -> ArmSample:
        """The state of the arm nearest to a time [s]."""
        return min(self._samples, key=lambda sample: abs(sample.time - time))

    def _check_frames(self, frames: Frames) -> None:
        """Refuse frames that the joints do not move against each other."""
        if frames in self._known:
            return
        middle = self._kinematics.limits.mean(axis=1)
        motion = self._kinematics.frame_jacobian(frames[0], middle, frames[1])
        if np.abs(motion).max() < LEAST_MOTION:
            raise AgentError(
                f"No joint moves {frames[0]!r} against {frames[1] or 'the world'!r}; a measured "
                "pose must be of a frame that moves with the hand."
            )
        self._known.add(frames)

"""A moving arm without dynamics: it follows smooth paths exactly, and a camera sees it late.

It is the nominal model, except that its lengths were zeroed at another posture. A frame holds the
number of the moment at which it was taken; the detector returns the marker's pose of that moment.
"""

from __future__ import annotations

from copy import copy, deepcopy
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from jmm_agent.agent import Agent
from jmm_agent.kalman_filter import JointEstimator
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.observation import SensorReadings
from jmm_agent.options import AgentOptions
from jmm_agent.updaters import VisionOptions
from jmm_agent.vision.hand_detection import HandDetection, HandSkip
from jmm_agent.vision.marker_detector import Detections, MarkerPose
from tests.jmm_agent.nominal_arm import posture_set

PERIOD = 0.02
MISTAKE = np.radians([1, -1, 1, 4, -4, 3, 4, -8, 7, 8, -7, 3, -3, 2])
"""Posture (14,) [rad] at which the lengths were zeroed."""
TESTED = posture_set()[60:90:3]
"""Postures (N, 14) [rad] at which what was learned is judged."""


class MovingHand:
    """Detector of the hand of a `MovingArm`, without a marker.

    Attributes:
        arm: the arm.
        skip: why no frame shows the hand; None: all do.
        fixed: pose that all frames show, as a picture of a hand has; None: the hand's.
        off: how far poses are off, in the camera [m].
        expected: the last pose that was expected.
    """

    arm: MovingArm
    frame = "hand"
    COVARIANCE = np.diag([4e-6, 4e-6, 3.6e-5, 3e-4, 3e-4, 3e-4])

    def __init__(self) -> None:
        self.skip: HandSkip | None = None
        self.fixed: np.ndarray | None = None
        self.off, self.seen = np.zeros(3), True
        self.expected: np.ndarray | None = None
        self.rng = np.random.default_rng(3)

    def __deepcopy__(self, memo: dict[int, object]) -> MovingHand:
        return self

    def detect(
        self, frame_rgb: np.ndarray, expected: np.ndarray | None = None
    ) -> HandDetection | HandSkip:
        self.expected = expected
        if self.skip is not None:
            return self.skip
        pose = self.arm.pose_in("hand", frame_rgb) if self.fixed is None else self.fixed.copy()
        error = np.sqrt(np.diag(self.COVARIANCE)) * self.rng.standard_normal(6)
        pose[:3, 3] += error[:3] + self.off
        pose[:3, :3] = Rotation.from_rotvec(error[3:]).as_matrix() @ pose[:3, :3]
        return HandDetection(pose, self.COVARIANCE)

    def shows(self, pose: np.ndarray) -> bool:
        return self.seen


class MovingArm:
    """An agent, and the arm that it observes.

    Args:
        nominal_map: the agent's map at the start, and with other zeros that of the arm.
        kinematics: of the arm.
        sees: whether the agent has a camera.
        interval: time between two frames [s].
        delay: time after which a frame arrives [s].
        stamped_late: whether a frame has the time of its arrival instead of its own.
        rest: duration of each rest [s].
        hand: detects the hand in place of its marker; None: the marker is detected.
        vision: further options of the Vision Updater.
        options: of the agent.
    """

    def __init__(
        self,
        nominal_map: JointMuscleMap,
        kinematics: ArmKinematics,
        sees: bool = True,
        interval: float = 0.2,
        delay: float = 0.0,
        stamped_late: bool = False,
        rest: float = 0.8,
        seed: int = 0,
        hand: MovingHand | None = None,
        vision: dict[str, Any] | None = None,
        **options: Any,
    ) -> None:
        self.nominal_map, self.kinematics = nominal_map, kinematics
        self._interval, self._delay, self._late, self._rest = interval, delay, stamped_late, rest
        self.rng = np.random.default_rng(seed)
        self._zero = nominal_map.lengths(MISTAKE)
        self.path = [posture_set()[0]]
        self.agent = Agent(
            nominal_map,
            kinematics,
            self if sees and hand is None else None,
            posture_set(),
            self.path[0],
            np.random.default_rng(seed),
            AgentOptions(
                vision=VisionOptions(
                    hand="marker" if hand is None else "seen", lengths="l", **(vision or {})
                ),
                **options,
            ),
            hand=hand,
        )
        self.hand = hand or MovingHand()
        self.hand.arm = self
        self.agent.begin_episode()

    def copied(self) -> MovingArm:
        """A copy with an agent and a hand of its own, which goes on as this arm would."""
        hand = copy(self.hand)
        hand.rng = deepcopy(hand.rng)
        hand.arm = deepcopy(self, {id(self.hand): hand})
        return hand.arm

    @property
    def time(self) -> float:
        return PERIOD * (len(self.path) - 1)

    @property
    def q(self) -> np.ndarray:
        return self.path[-1]

    def q_at(self, time: float) -> np.ndarray:
        """Joint angles (14,) [rad] at a time [s]."""
        return self.path[int(np.clip(round(time / PERIOD), 0, len(self.path) - 1))]

    def lengths(self, q: np.ndarray) -> np.ndarray:
        """The arm's muscle lengths (36,) [m]."""
        return self.nominal_map.lengths(q) - self._zero

    def detect(self, frame: np.ndarray, expected: object = None) -> Detections:
        """The marker's pose when the frame was taken."""
        pose = self.pose_in("marker_hand", frame)
        return Detections({0: MarkerPose(0, pose, np.zeros((4, 2)), 0.0, pose, 9.0)}, {}, ())

    def pose_in(self, part: str, frame: np.ndarray) -> np.ndarray:
        """Pose (4, 4) of a part of the arm in the camera when a frame was taken."""
        moment = int(frame[0, 0, 0]) + 256 * int(frame[0, 0, 1])
        return self.kinematics.pose(part, self.path[moment], relative_to="eye")

    def readings(self, **more: Any) -> SensorReadings:
        """What the arm measures now."""
        lengths = self.lengths(self.q) + self.rng.normal(0, 1e-4, 36)
        taken = np.floor((self.time - self._delay) / self._interval + 1e-6) * self._interval
        if taken < 0.0:
            return SensorReadings(self.time, lengths, np.full(36, 50.0))._replace(**more)
        moment = round(taken / PERIOD)
        frame = np.full((1, 1, 3), [moment % 256, moment // 256, 7], dtype=np.uint8)
        stamp = taken + self._delay * self._late
        return SensorReadings(self.time, lengths, np.full(36, 50.0), frame, stamp)._replace(**more)

    def step(self, q: np.ndarray, **more: Any) -> None:
        """Move to joint angles (14,) [rad] within one step."""
        self.path.append(q)
        self.agent.step(self.readings(**more))

    def visit(self, *postures: np.ndarray, move: float = 0.6) -> None:
        """Move smoothly to postures (14,) [rad], and rest at each."""
        for posture in postures:
            start = self.q
            for share in np.arange(PERIOD, move + 1e-9, PERIOD) / move:
                self.step(start + share**2 * (3.0 - 2.0 * share) * (posture - start))
            for _ in range(round(self._rest / PERIOD)):
                self.step(posture)

    @property
    def error(self) -> float:
        """RMS error of the joint angles by the map from the arm's lengths [deg]."""
        limits = self.kinematics.limits
        errors = []
        for q in TESTED:
            estimator = JointEstimator(self.agent.map, limits, q=q)
            for _ in range(15):
                estimator.update(self.lengths(q), PERIOD)
            errors.append(estimator.q - q)
        return float(np.degrees(np.sqrt(np.mean(np.square(errors)))))

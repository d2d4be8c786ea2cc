"""The hand in a camera frame by its own shape, without a marker: what a detector of it returns."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Protocol, runtime_checkable

import numpy as np

from jmm_agent.types import Floats


class HandSkip(Enum):
    """Why a frame has no pose of the hand."""

    DARK = "the frame is black"
    NOT_SEEN = "the hand is not in the frame"
    TWICE = "another hand in the frame could be the own one"
    ANOTHER = "the hand in the frame does not move as the own one"
    MIRRORED = "the hand is a mirror image, or the other hand of a pair"
    UNCLEAR = "too little of the hand is seen sharply for a pose"
    UNCERTAIN = "the hand's pose is too uncertain"


@dataclass(frozen=True)
class HandDetection:
    """The hand in one frame.

    Attributes:
        pose_hand_in_camera: of the detector's `HandDetector.frame` (4, 4), metres; camera x right,
            y down, z forward.
        covariance: of the pose (6, 6): x, y, z [m] and rotations about x, y, z [rad] in the
            camera's axes, see `jmm_agent.vision.pose_covariance`.
    """

    pose_hand_in_camera: Floats
    covariance: Floats


class HandDetector(Protocol):
    """Interface of the objects that find the hand in frames by its shape.

    A detector remembers nothing from frame to frame, and may be called from another thread. A copy
    of an agent shares it: its ``__deepcopy__`` returns itself if it cannot be copied.
    """

    @property
    def frame(self) -> str:
        """Name of the frame of the kinematics whose pose it finds, such as the body "hand"."""

    def detect(
        self, frame_rgb: np.ndarray, expected: np.ndarray | None = None
    ) -> HandDetection | HandSkip:
        """The pose of the hand in a frame, or why it has none.

        Args:
            frame_rgb: (H, W, 3) uint8.
            expected: pose_hand_in_camera (4, 4) that the muscle lengths predict; where to search
                first. It may be wrong by any amount, and no pose may follow from it.

        Raises:
            AgentError: the frame has a wrong shape or type.
        """

    def shows(self, pose: np.ndarray) -> bool:
        """Whether a frame would show enough of the hand for a pose.

        Args:
            pose: pose_hand_in_camera (4, 4).
        """


@runtime_checkable
class HandsDetector(HandDetector, Protocol):
    """A detector that finds other hands in a frame beside the own one, too.

    It does not know which one is the own one; `jmm_agent.vision.own_hand` does by their movements.
    """

    def hands(
        self, frame_rgb: np.ndarray, expected: np.ndarray | None = None
    ) -> tuple[HandDetection, ...] | HandSkip:
        """All hands in a frame, the surest one first, or why there is none.

        Args:
            frame_rgb: (H, W, 3) uint8.
            expected: as for `HandDetector.detect`.

        Raises:
            AgentError: the frame has a wrong shape or type.
        """

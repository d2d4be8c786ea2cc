"""Trained detector of Kengoro's hand, which is loaded where an agent is to see its hand."""

from __future__ import annotations

from pathlib import Path

from jmm_agent.options import AgentOptions
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.hand_detection import HandDetector
from jmm_agent.vision.hand_detector import TrainedHandDetector
from kengoro.errors import UsageError
from kengoro.robots import CAMERA
from kengoro_env.assets import assets_root

KENGORO = "hand_detectors/kengoro.zip"
"""File of the detector of Kengoro's hand, among the assets."""


def trained_hand(
    options: AgentOptions, own: bool, camera: Camera | None, path: Path | None = None
) -> HandDetector | None:
    """The trained detector of the hand; None if the options need none.

    Args:
        options: of the agent.
        own: whether the robot is another one than Kengoro's arm.
        camera: the camera that the frames come from; None: Kengoro's.
        path: file of `kengoro hand-detector`; None: the one of Kengoro's hand.

    Raises:
        UsageError: it was trained for another robot, or there is none, or no camera for it.
        AgentError: the file cannot be used.
    """
    if path is not None and not options.camera:
        raise UsageError(
            f"The hand's detector {path} needs a camera, but the options name none (camera='')."
        )
    if options.vision.hand != "seen" or not options.camera:
        return None
    if path is None:
        if own:
            raise UsageError(
                "A hand that is seen needs a detector that was trained for this robot; give its "
                "file as hand, or use hand='marker'."
            )
        path = assets_root() / KENGORO
        if not path.is_file():
            raise UsageError(
                "There is no trained detector of Kengoro's hand here yet: `kengoro hand-detector "
                "train` trains one; give its file as hand, or use hand='marker'."
            )
    return TrainedHandDetector(camera or CAMERA, path)

"""Trained detector of Kengoro's hand, which is loaded where an agent is to see its hand."""

from __future__ import annotations

import importlib

from jmm_agent.options import AgentOptions
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.hand_detection import HandDetector
from kengoro.errors import UsageError
from kengoro.robots import CAMERA

LOADER = "jmm_agent.vision.hand_detector"
"""Module with `load_hand_detector`."""


def trained_hand(options: AgentOptions, own: bool, camera: Camera | None) -> HandDetector | None:
    """The trained detector of Kengoro's hand; None if the options need none.

    Args:
        options: of the agent.
        own: whether the robot is another one than Kengoro's arm.
        camera: the camera that the frames come from; None: Kengoro's.

    Raises:
        UsageError: it was trained for another robot or camera, or there are no weights.
        AgentError: the weights cannot be used.
    """
    if options.vision.hand != "seen" or not options.camera:
        return None
    if own or camera not in (None, CAMERA):
        what = "robot" if own else "camera"
        raise UsageError(
            f"A hand that is seen needs a detector that was trained for this {what}; give it as "
            "hand, or use hand='marker'."
        )
    try:
        load = importlib.import_module(LOADER).load_hand_detector
    except ModuleNotFoundError as error:
        if error.name != LOADER:
            raise
        raise UsageError(
            "There is no trained detector of the hand yet (jmm_agent.vision.hand_detector is "
            "missing); give one as hand, or use hand='marker'."
        ) from None
    detector: HandDetector = load()
    return detector

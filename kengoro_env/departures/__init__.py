"""How an actual robot departs from its drawing; the agent is never told.

Each departure is a frozen dataclass with units and one verb, ``edit(draft)``. Null parameters
(the defaults) leave the draft, and so the compiled model, as they are.
"""

from kengoro_env.departures.geometry import AttachmentDisplacement, BoneWrapping
from kengoro_env.departures.presets import actual, drawing
from kengoro_env.departures.sensors import (
    CameraError,
    EncoderError,
    FrameDelay,
    TensionSensorError,
    ZeroPosture,
)
from kengoro_env.departures.tendons import DryFriction, Elongation, MotorInertia, TendonStretch

__all__ = [
    "AttachmentDisplacement",
    "BoneWrapping",
    "CameraError",
    "DryFriction",
    "Elongation",
    "EncoderError",
    "FrameDelay",
    "MotorInertia",
    "TendonStretch",
    "TensionSensorError",
    "ZeroPosture",
    "actual",
    "drawing",
]

from .departures import actual, drawing
from .env import KengoroEnv
from .errors import KengoroError
from .postures import posture_set
from .robot.draft import Departure, Draft
from .robot.motor_gains import gains_of
from .robot.muscle_law import Gains
from .robot.nominal_model import NominalArm
from .robot.robot import Robot
from .robot.statics import Statics
from .vector import KengoroVectorEnv
from .vision.head_camera import HeadCamera
from .vision.rendering import Painter
from .wrappers import ScaledObservation, ScaledVectorObservation

__all__ = [
    "Departure",
    "Draft",
    "Gains",
    "HeadCamera",
    "KengoroEnv",
    "KengoroError",
    "KengoroVectorEnv",
    "NominalArm",
    "Painter",
    "Robot",
    "ScaledObservation",
    "ScaledVectorObservation",
    "Statics",
    "actual",
    "drawing",
    "gains_of",
    "posture_set",
]

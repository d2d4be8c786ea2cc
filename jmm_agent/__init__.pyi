from .agent import Agent
from .driver import Driver, drive
from .errors import AgentError
from .grasping import GraspPlanner
from .guard.faults import Fault, MotorControl
from .guard.guard import Guard, GuardOptions
from .guard.null_guard import NullGuard
from .kinematics.arm_kinematics import ArmKinematics, IkOptions
from .mapping.joint_muscle_map import JointMuscleMap
from .mapping.learner import Pairs, RidgeRule
from .mapping.minibatch import MinibatchRule
from .mapping.training import load_or_train, train
from .nominal_model import NominalModel
from .observation import SensorReadings
from .options import AgentOptions
from .updaters import VisionOptions
from .vision.camera import Camera
from .vision.hold_out import HoldOutOptions
from .vision.marker_detector import Detector, MarkerDetector, MarkerPose

__all__ = [
    "Agent",
    "AgentError",
    "AgentOptions",
    "ArmKinematics",
    "Camera",
    "Detector",
    "Driver",
    "Fault",
    "GraspPlanner",
    "Guard",
    "GuardOptions",
    "HoldOutOptions",
    "IkOptions",
    "JointMuscleMap",
    "MarkerDetector",
    "MarkerPose",
    "MinibatchRule",
    "MotorControl",
    "NominalModel",
    "NullGuard",
    "Pairs",
    "RidgeRule",
    "SensorReadings",
    "VisionOptions",
    "drive",
    "load_or_train",
    "train",
]

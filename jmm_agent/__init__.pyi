from .agent import Agent
from .agent_log import AgentLog, RecordedAgent
from .command_limits import CommandLimits
from .commissioning.commissioning import Commissioner, Commissioning, CommissioningError
from .commissioning.findings import Finding
from .commissioning.options import CommissionOptions
from .driving.call_watch import DriverTimeoutError
from .driving.commission import commission
from .driving.drive import DriveOptions, DriveReport, LostReadingsError, drive
from .driving.driver import Driver, PausingDriver, StiffnessDriver
from .driving.emergency_stop import EmergencyStop, EmergencyStopError
from .driving.stopping import stopping
from .driving.watchdog import Watchdog
from .errors import AgentError
from .grasping import GraspPlanner
from .guard.faults import Fault, MotorControl
from .guard.guard import Guard, GuardOptions
from .guard.null_guard import NullGuard
from .hand_load import HandLoad
from .heat.heat_monitor import HeatMonitor
from .heat.parameters import HeatOptions, ThermalParameters
from .joint_stiffness import Stiffness
from .kinematics.arm_kinematics import ArmKinematics, IkOptions
from .learning.job_queue import Entered
from .learning.options import BESIDE, LearningOptions
from .mapping.joint_muscle_map import CheckpointError, JointMuscleMap
from .mapping.learner import Pairs, RidgeRule
from .mapping.minibatch import MinibatchRule
from .mapping.tendon_stretch import TendonStretch
from .mapping.training import load_or_train, train
from .muscle_order import MuscleOrder
from .next_posture import NextPosture
from .nominal_model import NominalModel
from .observation import SensorReadings
from .options import AgentOptions
from .posture_feedback import FeedbackOptions
from .posture_planner import PosturePlanner
from .prediction_record import PredictionRecord
from .scales import RobotScales
from .tension_distribution import TensionOptions
from .updaters import VisionOptions
from .vision.camera import Camera
from .vision.camera_clock import CameraClock
from .vision.can_finder import CanDetection, CanFinder, CanSkip
from .vision.can_shape import CanShape
from .vision.hand_detection import HandDetection, HandDetector, HandsDetector, HandSkip
from .vision.hand_detector import TrainedHandDetector
from .vision.hand_finder import HandSeen
from .vision.hold_out import HoldOutOptions
from .vision.marker_detector import Detector, MarkerDetector, MarkerPose
from .vision.observation_prediction import ObservationPrediction

__all__ = [
    "BESIDE",
    "Agent",
    "AgentError",
    "AgentLog",
    "AgentOptions",
    "ArmKinematics",
    "Camera",
    "CameraClock",
    "CanDetection",
    "CanFinder",
    "CanShape",
    "CanSkip",
    "CheckpointError",
    "CommandLimits",
    "CommissionOptions",
    "Commissioner",
    "Commissioning",
    "CommissioningError",
    "Detector",
    "DriveOptions",
    "DriveReport",
    "Driver",
    "DriverTimeoutError",
    "EmergencyStop",
    "EmergencyStopError",
    "Entered",
    "Fault",
    "FeedbackOptions",
    "Finding",
    "GraspPlanner",
    "Guard",
    "GuardOptions",
    "HandDetection",
    "HandDetector",
    "HandLoad",
    "HandSeen",
    "HandSkip",
    "HandsDetector",
    "HeatMonitor",
    "HeatOptions",
    "HoldOutOptions",
    "IkOptions",
    "JointMuscleMap",
    "LearningOptions",
    "LostReadingsError",
    "MarkerDetector",
    "MarkerPose",
    "MinibatchRule",
    "MotorControl",
    "MuscleOrder",
    "NextPosture",
    "NominalModel",
    "NullGuard",
    "ObservationPrediction",
    "Pairs",
    "PausingDriver",
    "PosturePlanner",
    "PredictionRecord",
    "RecordedAgent",
    "RidgeRule",
    "RobotScales",
    "SensorReadings",
    "Stiffness",
    "StiffnessDriver",
    "TendonStretch",
    "TensionOptions",
    "ThermalParameters",
    "TrainedHandDetector",
    "VisionOptions",
    "Watchdog",
    "commission",
    "drive",
    "load_or_train",
    "stopping",
    "train",
]

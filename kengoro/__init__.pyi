from .agents import make_agent, scales_of
from .calibration.calibration_file import Calibration, load_calibration
from .clock import Clock
from .commands.record import record
from .commissioning import commission
from .errors import UsageError
from .recording import Recording
from .remote_robot.client import RemoteRobot
from .remote_robot.process import robot_process
from .remote_robot.server import RobotServer, ServerOptions
from .robots import make_env, sample_postures, shuffled_postures
from .session import EpisodeEndedError, Session
from .study_writer import write_study
from .trained_maps import nominal_model, trained_map

__all__ = [
    "Calibration",
    "Clock",
    "EpisodeEndedError",
    "Recording",
    "RemoteRobot",
    "RobotServer",
    "ServerOptions",
    "Session",
    "UsageError",
    "commission",
    "load_calibration",
    "make_agent",
    "make_env",
    "nominal_model",
    "record",
    "robot_process",
    "sample_postures",
    "scales_of",
    "shuffled_postures",
    "trained_map",
    "write_study",
]

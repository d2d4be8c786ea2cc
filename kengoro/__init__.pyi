from .agents import make_agent
from .commands.record import record
from .errors import UsageError
from .recording import Recording
from .remote_robot import RemoteRobot, robot_process
from .robots import make_env, sample_postures, shuffled_postures
from .session import EpisodeEndedError, Session
from .study_writer import write_study
from .trained_maps import nominal_model, trained_map

__all__ = [
    "EpisodeEndedError",
    "Recording",
    "RemoteRobot",
    "Session",
    "UsageError",
    "make_agent",
    "make_env",
    "nominal_model",
    "record",
    "robot_process",
    "sample_postures",
    "shuffled_postures",
    "trained_map",
    "write_study",
]

from .causes import CATALOGUE, find_cause, register_cause
from .causes.base import Cause, Effects, Location, Parameter, SearchHints, Values
from .check import check_study
from .diagnosis import Diagnosis, Verdict
from .errors import RealityGapError, StudyError, UnknownNameError
from .extended import Extended
from .inference.verdict import Options
from .io.loader import load_study
from .pipeline import diagnose
from .posterior import Posterior
from .report.actuator_configs import ActuatorConfigs, isaac_lab_actuators, mjlab_actuators
from .report.engines import EngineInput, engine_input
from .report.extended_model import load_calibrated, load_extended
from .report.files import write_diagnosis, write_samples
from .report.posterior_file import load_posterior
from .simulation.hypothesis import Candidate
from .simulation.synthetic import simulate_study
from .study.data import Channel, Episode, Reading, Study

__all__ = [
    "CATALOGUE",
    "ActuatorConfigs",
    "Candidate",
    "Cause",
    "Channel",
    "Diagnosis",
    "Effects",
    "EngineInput",
    "Episode",
    "Extended",
    "Location",
    "Options",
    "Parameter",
    "Posterior",
    "Reading",
    "RealityGapError",
    "SearchHints",
    "Study",
    "StudyError",
    "UnknownNameError",
    "Values",
    "Verdict",
    "check_study",
    "diagnose",
    "engine_input",
    "find_cause",
    "isaac_lab_actuators",
    "load_calibrated",
    "load_extended",
    "load_posterior",
    "load_study",
    "mjlab_actuators",
    "register_cause",
    "simulate_study",
    "write_diagnosis",
    "write_samples",
]

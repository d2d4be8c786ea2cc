from .causes import CATALOGUE, find_cause, register_cause
from .causes.base import Cause, Effects, Location, Parameter, SearchHints, Values
from .check import check_study
from .diagnosis import Diagnosis, Verdict
from .errors import RealityGapError, StudyError, UnknownNameError
from .inference.verdict import Options
from .io.loader import load_study
from .pipeline import diagnose
from .report.extended_model import load_extended
from .report.files import write_diagnosis
from .simulation.hypothesis import Candidate
from .simulation.synthetic import simulate_study
from .study.data import Channel, Episode, Reading, Study

__all__ = [
    "CATALOGUE",
    "Candidate",
    "Cause",
    "Channel",
    "Diagnosis",
    "Effects",
    "Episode",
    "Location",
    "Options",
    "Parameter",
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
    "find_cause",
    "load_extended",
    "load_study",
    "register_cause",
    "simulate_study",
    "write_diagnosis",
]

"""What a simulation gets wrong: the cause by its name, the model extended by it, and the gain.

`diagnose` compares a MuJoCo model with measurements of the machine that it stands for.
"""

from __future__ import annotations

from reality_gap.causes import CATALOGUE, cause, register
from reality_gap.deciding import Options
from reality_gap.diagnosing import diagnose
from reality_gap.diagnosis import Diagnosis, Verdict
from reality_gap.errors import RealityGapError, StudyError
from reality_gap.reading import load_study
from reality_gap.study import Study

__all__ = [
    "CATALOGUE",
    "Diagnosis",
    "Options",
    "RealityGapError",
    "Study",
    "StudyError",
    "Verdict",
    "cause",
    "diagnose",
    "load_study",
    "register",
]

"""What a simulation gets wrong: the cause by its name, the model extended by it, and the gain.

`diagnose` compares a MuJoCo model with measurements of the machine that it stands for.
"""

from __future__ import annotations

from reality_gap.causes import CATALOGUE, cause, register
from reality_gap.diagnosis import Diagnosis, Verdict
from reality_gap.errors import RealityGapError, StudyError
from reality_gap.inference.verdict import Options
from reality_gap.io.loader import load_study
from reality_gap.pipeline import diagnose
from reality_gap.study.data import Study

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

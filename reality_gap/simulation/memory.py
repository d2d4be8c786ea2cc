"""Memory: an estimate of what a diagnosis needs, and studies that are thinned to fit a bound.

Most of it holds changes of all readings, one for each parameter of each candidate. Where the bound
does not suffice for these, every second reading is left out, or more. Readings that are left out
make estimates less certain, but not wrong. Efforts are thinned by `inverse_dynamics.prepare`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import mujoco

from reality_gap.causes import CATALOGUE
from reality_gap.causes.base import Cause
from reality_gap.errors import StudyError
from reality_gap.simulation.inverse_dynamics import ensure_prepared
from reality_gap.study.data import Study
from reality_gap.study.system import compile_system

GIGABYTE = 1e9
"""Unit of bounds [bytes]."""
BASE = 4.5e8
"""Memory of a diagnosis apart from the model and the readings [bytes]."""
WORKER = 2.5e8
"""Memory of a further process apart from the model [bytes]."""
PER_NUMBER = 110.0
"""Memory for each reading and parameter: measured on logs of 600 to 20 000 readings [bytes]."""
COPIES = 4.0
"""How often a process holds the model: as loaded, as compiled, and as edited."""
FEWEST = 200
"""Number of readings of a channel below which a study is not thinned."""


class Plan(NamedTuple):
    """How a diagnosis fits a bound.

    Attributes:
        study: the study, thinned if necessary.
        jobs: number of processes.
        needed: estimated memory [bytes].
    """

    study: Study
    jobs: int
    needed: float


def fit_memory(
    study: Study,
    jobs: int,
    limit: float,
    note: Callable[[str], None] = lambda sentence: None,
    causes: Sequence[Cause] | None = None,
) -> Plan:
    """Reduce processes and readings until a diagnosis is estimated to fit a bound.

    Args:
        study: the study.
        jobs: number of processes.
        limit: bound of the memory of all processes [bytes].
        note: called with a sentence on what was reduced.
        causes: causes that are considered; the catalogue by default.

    Raises:
        StudyError: the bound does not suffice even so.
    """
    model = model_memory(study)
    parameters = _count_parameters(study, causes or tuple(CATALOGUE.values()))
    count, fewest = _count_readings(ensure_prepared(study))
    data = PER_NUMBER * parameters * count
    fixed = model + BASE
    wanted = jobs
    while jobs > 1 and fixed + data + jobs * (model + WORKER) > limit:
        jobs -= 1
    if jobs < wanted:
        note(f"{jobs} of {wanted} processes are used, to stay within {_text(limit)} of memory")
    others = jobs * (model + WORKER) if jobs > 1 else 0.0
    if fixed + others + data <= limit:
        return Plan(study, jobs, fixed + others + data)
    stride = math.ceil(data / (limit - fixed)) if limit > fixed else 0
    if study.inverse or not stride or fewest < FEWEST * stride:
        advice = "shorten the log, or consider fewer causes (--causes)"
        raise StudyError(
            f"a diagnosis of {study.name} needs about {_text(fixed + data)} of memory, for "
            f"{count} readings and {parameters} parameters, and {_text(fixed)} even without them; "
            f"allow more (--memory){', ' + advice if stride else ''}"
        )
    note(
        f"1 of {stride} readings is used, to stay within {_text(limit)} of memory; all of them "
        f"would need about {_text(fixed + data)}"
    )
    return Plan(thinned(study, stride), jobs, fixed + data / stride)


def thinned(study: Study, stride: int) -> Study:
    """Return a study with every ``stride``-th reading of each channel."""
    kept = slice(None, None, stride)
    episodes = (
        replace(
            episode,
            readings=tuple(
                replace(r, time=r.time[kept], value=r.value[kept]) for r in episode.readings
            ),
        )
        for episode in study.episodes
    )
    return replace(study, episodes=tuple(episodes))


def model_memory(study: Study) -> float:
    """Return about what a study's model needs in a process [bytes]."""
    return COPIES * float(mujoco.mj_sizeModel(compile_system(study).model))


def _count_parameters(study: Study, causes: Sequence[Cause]) -> int:
    system = compile_system(study)
    return sum(
        len(cause.parameters(system, location))
        for cause in causes
        for location in cause.locations(system)
    )


def _count_readings(study: Study) -> tuple[int, int]:
    """Return the number of readings of a study, and that of its channel with the fewest."""
    of_channels = [
        sum(len(episode.readings[c].time) for episode in study.episodes)
        for c in range(len(study.channels))
    ]
    return sum(of_channels), min(of_channels)


def _text(size: float) -> str:
    return f"{size / GIGABYTE:.2g} GB"

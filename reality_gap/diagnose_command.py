"""Options of the command diagnose: thresholds, the causes to consider and depth of the search."""

from __future__ import annotations

import math
import os
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from reality_gap.errors import StudyError

if TYPE_CHECKING:
    from reality_gap.causes.base import Cause
    from reality_gap.inference.verdict import Options


@dataclass(frozen=True)
class Thresholds:
    """Thresholds of a diagnosis; the defaults are calibrated."""

    refits: int = 8
    """How many candidates are fitted for the first cause."""
    more_refits: int = 5
    """How many candidates are fitted for each further cause."""
    threshold: float = 7.0
    """Evidence that the first cause needs [nats]."""
    further: float = 8.0
    """Evidence that each further cause must add [nats]."""
    root: float = 0.5
    """Multiple of the square root of the evidence so far that each further cause must add."""
    weak: float = 3.0
    """Evidence that each further cause must add where a model is wrong by many noises [nats]."""
    nonlinear: float = 0.005
    """Share of what tolerances explain that a cause must explain beyond that evidence."""
    visible: float = 3.0
    """Change of the readings by a large fault from which on a cause is judged [noise]."""
    certain: float = 10.0
    """Evidence of a learned residual above which a remainder is unexplained [nats]."""
    unexplained: float = 0.15
    """Share of the evidence of named causes that may be learned of their remainder."""
    root_learned: float = 3.0
    """Multiple of the square root of that evidence that may be learned of their remainder."""
    better: float = 6.0
    """Evidence by which a learned residual must exceed that of causes to refute them [nats]."""
    by_chance: float = 0.5
    """Share of the evidence of an event that may be learned without its time."""
    worse: float = 1.2
    """RMS on held-out data that causes may leave even if it was lower without them [noise]."""
    left: float = 1.5
    """RMS on held-out data above which the causes are not all that is wrong [noise]."""
    rough: float = 4.0
    """Factor of the tolerances above which they do not excuse what is left."""
    deviation: float = 20.0
    """Deviation of a parameter above which it does not excuse what is left [tolerances]."""
    likely: float = 0.5
    """Probability that a cause needs to be named, with all that predict the same."""
    guess: float = 20.0
    """Evidence from which on a less likely cause is named, too [nats]."""
    possible: float = 0.05
    """Probability below which no cause is named, whatever its evidence."""
    form: float = 0.03
    """Relative error of what tolerances explain of the readings."""
    of_step: float = 3.0
    """Largest error of the time step that excuses what is left [noise]."""
    many: float = 20.0
    """RMS of the residual from which on groups of causes are fitted first [noise]."""
    large: float = 5.0
    """RMS of what the causes leave from which on groups of causes are fitted [noise]."""


@dataclass(frozen=True)
class Diagnose:
    """Diagnose a study: write verdict.json, report.html and the extended model."""

    study: tyro.conf.Positional[Path]
    """STUDY.yaml: the model, the logs and the meaning of their columns."""
    out: Path
    """Folder to write; it must not exist, be empty, or hold an earlier diagnosis."""
    jobs: int = os.cpu_count() or 1
    """Number of processes."""
    tolerance: float = 1.0
    """Factor of all tolerances of the model; larger for a rough model, such as 3."""
    memory: float = 4.0
    """Memory of all processes, as estimated; readings are left out to stay within it [GB]."""
    time_limit: float = math.inf
    """Longest time of the diagnosis [s]; what was screened until then is kept."""
    causes: tuple[str, ...] = ()
    """Ids of the causes to consider, as the command causes lists them; by default all."""
    without: tuple[str, ...] = ()
    """Ids of causes to leave out."""
    depth: int = 10
    """Largest number of causes that the search adds."""
    thresholds: Thresholds = Thresholds()


def options_of(command: Diagnose) -> Options:
    """Return the options of a diagnosis.

    Raises:
        StudyError: an option is out of its range.
    """
    from reality_gap.inference.forward_selection import Settings
    from reality_gap.inference.verdict import Options

    if command.jobs < 1:
        raise StudyError(f"--jobs must be at least 1, not {command.jobs}")
    if not 0.0 < command.tolerance < math.inf:
        raise StudyError(f"--tolerance must be above 0 and finite, not {command.tolerance}")
    if not 0.0 < command.memory < math.inf:
        raise StudyError(f"--memory must be above 0 and finite, not {command.memory}")
    if not command.time_limit > 0.0:
        raise StudyError(f"--time-limit must be above 0, not {command.time_limit}")
    given = asdict(command.thresholds)
    for name, value in given.items():
        if not 0 <= value < math.inf or (name in ("refits", "more_refits") and value < 1):
            least = "at least 1" if name in ("refits", "more_refits") else "at least 0 and finite"
            raise StudyError(f"--thresholds.{name.replace('_', '-')} must be {least}, not {value}")
    for name in ("likely", "possible"):
        if given[name] > 1.0:
            raise StudyError(f"--thresholds.{name} must be from 0 to 1, not {given[name]}")
    if command.depth < 1:
        raise StudyError(f"--depth must be at least 1, not {command.depth}")
    searching = {field.name for field in fields(Settings)} - {"most"}
    search = Settings(most=command.depth, **{name: given.pop(name) for name in searching})
    given["root"] = given.pop("root_learned")
    return Options(
        search=search, tolerance=command.tolerance, time_limit=command.time_limit, **given
    )


def considered_causes(command: Diagnose) -> list[Cause]:
    """Return the causes of the catalogue that a diagnosis considers.

    Raises:
        UnknownNameError: a cause is not in the catalogue.
        StudyError: none is left.
    """
    from reality_gap.causes import CATALOGUE, find_cause

    left_out = {find_cause(name).id for name in command.without}
    wanted = [find_cause(name) for name in dict.fromkeys(command.causes)] or [*CATALOGUE.values()]
    found = [cause for cause in wanted if cause.id not in left_out]
    if not found:
        raise StudyError("--without leaves out all causes; at least one must be considered")
    return found

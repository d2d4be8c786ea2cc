"""The EMPS log: reading it, the study that it makes, and what least squares says of it.

Electro-Mechanical Positioning System: a DC motor drives a carriage through a ball screw in closed
loop. Source of the data and of the published numbers: A. Janot, M. Gautier and M. Brunot, "Data Set
and Reference Models of EMPS", Workshop on Nonlinear System Identification Benchmarks, 2019 (free to
use with citation). The data are the user's; none are in this package.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path

import numpy as np
from scipy.signal import butter, sosfiltfilt

from experiments.harness.errors import ExperimentError
from jmm_agent.types import Floats
from reality_gap.simulation.inverse_dynamics import EDGE, Motion, Traced, prepare
from reality_gap.study.data import Channel, Episode, Reading, Study

COLUMNS = ("t_s", "q_ref_m", "q_m", "u_V")
FORCE_PER_VOLT = 35.15065188248547
"""Force of the drive at the carriage [N/V]."""

MASS = 95.1089
PUBLISHED = {"viscous": 203.5034, "coulomb": 20.3935, "offset": -3.1648}
"""Of the carriage [kg]; friction [N s/m], [N], and what the force is offset by [N]."""

PUBLISHED_ERROR, PUBLISHED_ERROR_BY_DIRECTION = 4.08, 3.11
"""Relative error of the force [%]: of these, and with frictions that depend on the direction."""

MODEL_ERROR = 0.04
"""What models of such a drive leave of its force, as share of the RMS: far more than the sensors'
noise, and it repeats. Evidence is weighed against that, so that a cause must beat it."""


@dataclass(frozen=True)
class Log:
    """Measured at 1 kHz: time [s], reference [m], position [m], force [N], all (n,)."""

    time: Floats
    reference: Floats
    position: Floats
    force: Floats


def read_log(path: Path) -> Log:
    """Read the CSV file of the log.

    Raises:
        ExperimentError: there is no such file, or it is not that log.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            head, *rows = csv.reader(file)
        table = np.array(rows, dtype=float)
    except (OSError, ValueError) as error:
        raise ExperimentError(f"{path} cannot be read as the EMPS log: {error}") from error
    if tuple(head) != COLUMNS or table.ndim != 2 or len(table) < 1000:
        raise ExperimentError(
            f"{path} has the columns {', '.join(head)} and {len(table)} rows; the EMPS log has "
            f"{', '.join(COLUMNS)} and at least 1000."
        )
    time, reference, position, volts = table.T
    if not np.all(np.isfinite(table)) or np.any(np.diff(time) <= 0):
        raise ExperimentError(f"{path} has cells that are not numbers, or times that do not rise.")
    return Log(time, reference, position, FORCE_PER_VOLT * volts)


def make_study(log: Log) -> Study:
    """The prepared study: force of a carriage that is a mass alone, along its measured motion."""
    channels = (
        Channel("position", "position", unit="m"),
        Channel("force", "carriage", unit="N", kind="effort"),
    )
    readings = (Reading(log.time, log.position), Reading(log.time, log.force))
    episode = Episode("EMPS", log.time[:1], np.zeros((1, 0)), readings)
    drawing = Path(str(files("experiments.emps") / "emps.xml"))
    study = prepare(Study("EMPS", drawing, channels, (episode,)))
    noise = MODEL_ERROR * float(np.sqrt(np.mean(measured_force(study) ** 2)))
    return replace(study, channels=(replace(study.channels[0], noise=noise),))


def measured_force(study: Study) -> Floats:
    """The low-passed force that is compared (m,) [N]."""
    return study.episodes[0].readings[0].value


def motion(study: Study) -> Motion:
    """Along which it is compared."""
    episode = study.episodes[0]
    assert isinstance(episode, Traced)
    return episode.motion


def at_readings(study: Study, values: Floats) -> Floats:
    """Values on the motion's grid, at the times of the force."""
    return np.interp(study.episodes[0].readings[0].time, motion(study).time, values)


def relative_error(measured: Floats, predicted: Floats) -> float:
    """Of a predicted force [%], as published: norm of the error over norm of the force."""
    return 100.0 * float(np.linalg.norm(measured - predicted) / np.linalg.norm(measured))


def period(log: Log) -> float | None:
    """Time after which the reference repeats itself [s]; None if it does not in the log."""
    centred = log.reference - log.reference.mean()
    lags = range(len(centred) // 10, len(centred) // 2)
    differences = [float(np.std(centred[lag:] - centred[:-lag])) for lag in lags]
    best = int(np.argmin(differences))
    if differences[best] > 1e-3 * np.std(centred):
        return None
    return lags[best] * float(np.median(np.diff(log.time)))


def repeatability(log: Log, study: Study) -> float | None:
    """Deviation of the low-passed force from one period to the next [N]; None if none repeats."""
    after = period(log)
    if after is None:
        return None
    step = float(np.median(np.diff(log.time)))
    sections = butter(4, 2 * motion(study).cutoff * step, output="sos")
    edge = round(EDGE / (motion(study).cutoff * step))
    force = sosfiltfilt(sections, log.force)[edge:-edge]
    lag = round(after / step)
    return float(np.sqrt(np.mean((force[lag:] - force[:-lag]) ** 2) / 2))

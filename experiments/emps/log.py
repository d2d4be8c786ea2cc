"""EMPS log: its reader, its study, and errors of predicted forces.

Electro-Mechanical Positioning System: a DC motor drives a carriage through a ball screw in closed
loop. Source of the data and of the published numbers: A. Janot, M. Gautier and M. Brunot, "Data Set
and Reference Models of EMPS", Workshop on Nonlinear System Identification Benchmarks, 2019 (free to
use with citation). The user provides the data; none are in this package.
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
from reality_gap.simulation.effort_filter import EDGE
from reality_gap.simulation.inverse_dynamics import prepare
from reality_gap.simulation.measured_motion import Motion
from reality_gap.simulation.prepared_episode import PreparedEpisode
from reality_gap.study.data import Channel, Episode, Reading, Study

COLUMNS = ("t_s", "q_ref_m", "q_m", "u_V")
FORCE_PER_VOLT = 35.15065188248547
"""Force of the drive at the carriage [N/V]."""

MASS = 95.1089
PUBLISHED = {"viscous": 203.5034, "coulomb": 20.3935, "offset": -3.1648}
"""Published mass [kg], viscous [N s/m] and Coulomb friction [N], and offset of the force [N]."""

PUBLISHED_ERROR, PUBLISHED_ERROR_BY_DIRECTION = 4.08, 3.11
"""Published relative errors of the force [%]: of these, and with direction-dependent friction."""

MODEL_ERROR = 0.04
"""Error of models of such a drive, as share of the RMS force. It is systematic and much larger than
the sensors' noise, so evidence is weighed against it."""


@dataclass(frozen=True)
class Log:
    """Samples at 1 kHz, shape (n,) each: time [s], reference [m], position [m], force [N]."""

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
    """Make the study: force of a mass along the measured motion of the carriage.

    Errors of the model are larger than those of the sensors, and their size is that of the noise.
    """
    channels = (
        Channel("position", "position", unit="m"),
        Channel("force", "carriage", unit="N", kind="effort", noise=_model_error(log.force)),
    )
    readings = (Reading(log.time, log.position), Reading(log.time, log.force))
    episode = Episode("EMPS", log.time[:1], np.zeros((1, 0)), readings)
    model = Path(str(files("experiments.emps") / "emps.xml"))
    study = prepare(Study("EMPS", model, channels, (episode,)))
    noise = _model_error(measured_force(study))
    return replace(study, channels=(replace(study.channels[0], noise=noise),))


def _model_error(force: Floats) -> float:
    """Error of the model of a force (k,) [N]."""
    return MODEL_ERROR * float(np.sqrt(np.mean(force**2)))


def measured_force(study: Study) -> Floats:
    """Low-passed force that is compared, shape (m,) [N]."""
    return study.episodes[0].readings[0].value


def motion(study: Study) -> Motion:
    """Measured motion along which the force is compared."""
    episode = study.episodes[0]
    assert isinstance(episode, PreparedEpisode)
    return episode.motion


def at_readings(study: Study, values: Floats) -> Floats:
    """Interpolate values on the grid of the motion at the times of the force."""
    return np.interp(study.episodes[0].readings[0].time, motion(study).time, values)


def relative_error(measured: Floats, predicted: Floats) -> float:
    """Relative error [%] of a predicted force: norm of the error over norm of the force."""
    return 100.0 * float(np.linalg.norm(measured - predicted) / np.linalg.norm(measured))


def period(log: Log) -> float | None:
    """Period of the reference [s]; None if it does not repeat within the log."""
    centred = log.reference - log.reference.mean()
    lags = range(len(centred) // 10, len(centred) // 2)
    differences = [float(np.std(centred[lag:] - centred[:-lag])) for lag in lags]
    best = int(np.argmin(differences))
    if differences[best] > 1e-3 * np.std(centred):
        return None
    return lags[best] * float(np.median(np.diff(log.time)))


def repeatability(log: Log, study: Study) -> float | None:
    """RMS deviation of the low-passed force between periods [N]; None without a period."""
    after = period(log)
    if after is None:
        return None
    step = float(np.median(np.diff(log.time)))
    sections = butter(4, 2 * motion(study).cutoff * step, output="sos")
    edge = round(EDGE / (motion(study).cutoff * step))
    force = sosfiltfilt(sections, log.force)[edge:-edge]
    lag = round(after / step)
    return float(np.sqrt(np.mean((force[lag:] - force[:-lag]) ** 2) / 2))

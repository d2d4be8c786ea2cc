"""Least squares on the inverse dynamic model, for comparison with the diagnosis.

The model is linear in its parameters. Its residuals are correlated over tenths of a second, so the
intervals come from the scatter of long blocks of the log (cluster-robust sandwich).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfiltfilt
from scipy.stats import t as student

from experiments.emps.log import at_readings, measured_force, motion, relative_error
from jmm_agent.types import Floats
from reality_gap.simulation.measured_motion import Motion
from reality_gap.study.data import Study

BLOCKS = 24
"""Number of blocks of the log."""

TERMS: dict[str, Callable[[Motion], Floats]] = {
    "mass": lambda m: m.qacc[:, 0],
    "viscous": lambda m: m.qvel[:, 0],
    "coulomb": lambda m: np.sign(m.qvel[:, 0]),
    "offset": lambda m: np.ones(len(m.time)),
    "spring": lambda m: m.qpos[:, 0],
    "viscous by direction": lambda m: np.abs(m.qvel[:, 0]),
}
"""Force per unit of each parameter, on the motion's grid."""

UNITS = {
    "mass": "kg",
    "viscous": "N s/m",
    "coulomb": "N",
    "offset": "N",
    "spring": "N/m",
    "viscous by direction": "N s/m",
}


@dataclass(frozen=True)
class Regression:
    """A linear fit.

    Attributes:
        values: of the parameters.
        widths: half widths of their 95 % intervals.
        error: relative error of the force [%].
    """

    values: dict[str, float]
    widths: dict[str, float]
    error: float


def regress(study: Study, names: Sequence[str]) -> Regression:
    """Fit the named terms to the measured force."""
    force = measured_force(study)
    columns = np.column_stack([term(study, name) for name in names])
    inverse = np.linalg.inv(columns.T @ columns)
    values = inverse @ (columns.T @ force)
    left = force - columns @ values
    scatter = np.zeros_like(inverse)
    for block in np.array_split(np.arange(len(force)), BLOCKS):
        pull = columns[block].T @ left[block]
        scatter += np.outer(pull, pull)
    covariance = inverse @ scatter @ inverse * BLOCKS / (BLOCKS - 1)
    widths = student.ppf(0.975, BLOCKS - 1) * np.sqrt(np.diag(covariance))
    return Regression(
        dict(zip(names, values.tolist(), strict=True)),
        dict(zip(names, widths.tolist(), strict=True)),
        relative_error(force, columns @ values),
    )


def term(study: Study, name: str) -> Floats:
    """Force per unit of a parameter at the readings, with the low-pass of the readings."""
    along = motion(study)
    step = float(along.time[1] - along.time[0])
    sections = butter(4, 2 * along.cutoff * step, output="sos")
    return at_readings(study, sosfiltfilt(sections, TERMS[name](along)))


def force_of(study: Study, values: dict[str, float]) -> Floats:
    """Force at the readings for some parameters, shape (m,) [N]."""
    return sum((term(study, name) * value for name, value in values.items()), np.zeros(1))

"""Reader of a log with motor angles and measured joint angles of a cable-driven robot.

The patient side manipulator of a da Vinci Research Kit (dVRK) moved its joints to commanded angles
and stopped at each; a depth camera measured balls on base and tip of the instrument, from which six
joint angles follow. Source: M. Hwang et al., "Efficiently Calibrating Cable-Driven Surgical Robots
With RGBD Fiducial Sensing and Recurrent Neural Networks", IEEE RA-L 5(4):5937-5944, 2020. The user
provides the data; none are in this package.

The log has commanded joint angles and no encoders. The robot's controller turns the former into
motor angles by the instrument's coupling, and its position control follows them at rest, so motor
angles are commanded joint angles times the inverse coupling, `machine.TRANSMISSION`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.harness.errors import ExperimentError
from jmm_agent.types import Floats

COMMANDED, MEASURED, STAMPS = "q_des", "q_act", "t_st?mp"
"""Beginnings of the names of the files: joint angles commanded and measured, and times."""
JOINTS = 6
SLIDER = 2
"""Index of the only joint that slides; its position is in m, and all others are angles in rad."""
REACH = 0.24
"""Longest position of the slider [m]."""
LEAST = 100
"""Least number of samples of which anything can be said."""


@dataclass(frozen=True)
class Log:
    """N samples at rest, in the order of time.

    Attributes:
        time: (N,) [s].
        commanded: joint angles that the controller converts to motor angles (N, 6) [rad, m].
        measured: joint angles by the camera (N, 6) [rad, m].
        lost: number of samples that were left out because the camera did not see the balls.
    """

    time: Floats
    commanded: Floats
    measured: Floats
    lost: int


def read_log(folder: Path) -> Log:
    """Read the files ``q_des*.npy``, ``q_act*.npy`` and ``t_stamp*.npy`` of a folder.

    Samples in which the camera did not see the balls, written as zeros, are left out and counted.

    Raises:
        ExperimentError: a file is missing, cannot be read, or does not fit the others.
    """
    if not folder.is_dir():
        raise ExperimentError(f"There is no folder {folder}.")
    commanded, measured = (_array(folder, name, 2) for name in (COMMANDED, MEASURED))
    time = _array(folder, STAMPS, 1)
    count = len(time)
    for name, found in ((COMMANDED, commanded), (MEASURED, measured)):
        if found.shape != (count, JOINTS):
            raise ExperimentError(
                f"{folder}: {name} has shape {found.shape}, but ({count}, {JOINTS}) is needed."
            )
    if not (np.isfinite(commanded).all() and np.isfinite(time).all()):
        raise ExperimentError(f"{folder}: commanded joint angles or times are not finite.")
    if not (np.diff(time) > 0.0).all():
        raise ExperimentError(f"{folder}: times must grow from sample to sample.")
    if not (np.abs(np.delete(commanded, SLIDER, axis=1)) < 2.0 * np.pi).all():
        raise ExperimentError(f"{folder}: angles must be in rad, and below a full turn.")
    if not ((commanded[:, SLIDER] >= 0.0) & (commanded[:, SLIDER] <= REACH)).all():
        raise ExperimentError(
            f"{folder}: column {SLIDER} must be the insertion, between 0 and {REACH} m."
        )
    seen = np.isfinite(measured).all(axis=1) & (measured != 0.0).all(axis=1)
    if seen.sum() < LEAST:
        raise ExperimentError(
            f"{folder}: {seen.sum()} of {count} samples have measured joint angles, but at least "
            f"{LEAST} are needed."
        )
    return Log(time[seen], commanded[seen], measured[seen], int((~seen).sum()))


def _array(folder: Path, name: str, dimensions: int) -> Floats:
    """The only file of a folder whose name begins so, as an array."""
    paths = sorted(folder.glob(f"{name}*.npy"))
    if len(paths) != 1:
        raise ExperimentError(
            f"{folder} has {len(paths)} files {name}*.npy, but exactly one is needed."
        )
    try:
        found = np.asarray(np.load(paths[0], allow_pickle=False), dtype=float)
    except (OSError, ValueError, TypeError) as error:
        raise ExperimentError(f"{paths[0]} cannot be read as an array: {error}") from error
    if found.ndim != dimensions:
        raise ExperimentError(
            f"{paths[0]} has {found.ndim} dimensions, but {dimensions} are needed."
        )
    return found

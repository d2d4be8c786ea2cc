"""Reader of the da Vinci log: a cable drive of a grasper, measured at both ends.

A drive spindle pulls cables that turn a jaw against a load; angle and torque are measured at
spindle and jaw in 50 runs, 5 frequencies times 10 loads. Source: J. J. O'Neill, T. K. Stephens and
T. M. Kowalewski, "Evaluation of Torque Measurement Surrogates as Applied to Grip Torque and Jaw
Angle Estimation of Robotic Surgical Tools", IEEE RA-L 3(4):3027-3034, 2018; the data are under the
ODbL / DbCL (attribution, share-alike). The user provides the data; none are in this package.
"""

from __future__ import annotations

import json
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from experiments.harness.errors import ExperimentError
from jmm_agent.types import Floats

CHANNELS = (
    "drive_angle_rad",
    "drive_torque_Nm",
    "drive_current_A",
    "jaw_angle_rad",
    "jaw_torque_Nm",
)
RATE = 200.0
"""Sampling rate of the log [Hz]."""
THINNING = 5
"""Samples of the log for each sample that is compared: 40 Hz."""
CUTOFF = 0.8
"""Cutoff of the zero-phase low-pass before thinning [half of the new rate]."""
BEGIN = 0.55
"""Left out at the start of a run, until the drive has turned once, as the state of friction and
backlash is unknown before [periods]."""
JUMP = 0.3
"""Rotation of the jaw within 50 ms that counts as a disturbance [rad]; the run is left out from a
second before on."""


@dataclass(frozen=True)
class Runs:
    """Runs of equal length; arrays are (n,), (r,) or (n, r) for n samples of r runs.

    Attributes:
        time: (n,) [s].
        frequency, load: (r,) nominal frequency [Hz] and load [%].
        drive: angle of the spindle, positive where it closes the jaw [rad].
        torque: of the spindle, positive where it closes the jaw [N m].
        jaw: angle of the jaw, growing as it closes on the load [rad].
        resistance: torque of the load against closing [N m].
        use: which samples are compared.
    """

    time: Floats
    frequency: Floats
    load: Floats
    drive: Floats
    torque: Floats
    jaw: Floats
    resistance: Floats
    use: NDArray[np.bool_]

    def chosen(self, which: NDArray[np.bool_]) -> Runs:
        """Some of the runs, by a mask of shape (r,)."""
        arrays = (self.drive, self.torque, self.jaw, self.resistance)
        drive, torque, jaw, resistance = (a[:, which] for a in arrays)
        return Runs(
            self.time,
            self.frequency[which],
            self.load[which],
            drive,
            torque,
            jaw,
            resistance,
            self.use[:, which],
        )


def read_runs(path: Path, rate: float = RATE / THINNING) -> Runs:
    """Read the log, low-passed and thinned to about ``rate`` [Hz].

    Raises:
        ExperimentError: there is no such file, or it is not that log.
    """
    try:
        with np.load(path, allow_pickle=False) as content:
            index = json.loads(str(content["index_json"]))
            channels = tuple(str(name) for name in content["channels"])
            raw = [np.asarray(content[f"run{row['run']:03d}"], dtype=float) for row in index]
            frequency = np.array([row["header_freq_hz"] for row in index])
            load = np.array([row["header_load_percent"] for row in index])
    except (OSError, KeyError, TypeError, ValueError, zipfile.BadZipFile) as error:
        raise ExperimentError(f"{path} cannot be read as the da Vinci log: {error}") from error
    if channels != CHANNELS or not raw or any(run.shape[1:] != (5,) for run in raw):
        raise ExperimentError(
            f"{path} has the channels {', '.join(channels)}; the da Vinci log has "
            f"{', '.join(CHANNELS)}."
        )
    if len(set(frequency)) < 2 or len(set(load)) < 2:
        raise ExperimentError(f"{path} has runs at one frequency or load; two of each are needed.")
    count = min(len(run) for run in raw)
    stacked = np.stack([run[:count] for run in raw], axis=1)
    step = round(RATE / rate)
    sections = butter(4, CUTOFF / step, output="sos")
    smooth = sosfiltfilt(sections, stacked, axis=0)
    thin = smooth[::step]
    time = np.arange(len(thin)) * step / RATE
    drive, torque, _, jaw, jaw_torque = np.moveaxis(thin, 2, 0)
    use = (time[:, None] > BEGIN / frequency) & (time[:, None] < time[-1] - 0.2)
    use &= _undisturbed(stacked[:, :, 3], step)[: len(thin)]
    return Runs(time, frequency, load, -drive, torque, jaw, -jaw_torque, use)


def _undisturbed(jaw: Floats, step: int) -> NDArray[np.bool_]:
    """Thinned samples, shape (n, r), before any jump after the first second."""
    moved = np.abs(jaw[10:] - jaw[:-10]) > JUMP
    moved[: round(RATE)] = False
    early = np.vstack([moved, np.zeros((10, moved.shape[1]), dtype=bool)])
    first = np.where(early.any(axis=0), early.argmax(axis=0), len(jaw) + 1)
    return (np.arange(len(jaw))[:, None] < first - RATE)[::step]

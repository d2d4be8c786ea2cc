"""Study of the da Vinci cable drive for `reality_gap`: a cable that shortens, a jaw, a load.

Commands are the length of the cable that corresponds to the angle of the spindle, and the measured
load. Measurements are the torque of the spindle, as tension of the cable, and the angle of the jaw.
The catalogue of `reality_gap` has no friction before the cable, no cable that hardens and no
compliance behind the friction; see `experiments.davinci.models` for these.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import numpy as np

from experiments.davinci.log import BEGIN, RATE, Runs
from jmm_agent.types import Floats
from reality_gap.study.data import Channel, Episode, Initial, Reading, Study

RADIUS = 0.005
"""Nominal radius of the model's pulley [m]."""
RATIO = 0.92
"""Ratio of jaw angle to spindle angle in the model."""

TORQUE_NOISE, ANGLE_NOISE = 0.006, 0.007
"""Errors of the best structure in torque [N m] and angle [rad]. They are systematic and much larger
than the sensors' noise, so evidence is weighed against them."""

LOADS, FREQUENCIES = 3, 2
"""Number of loads and of frequencies in the study."""
STEP = 0.001
"""Time between commands [s]; longer steps would excite a stiff cable."""
PERIODS = 1.6
"""Length of an episode [periods]; compared from `BEGIN` on."""


def make_study(runs: Runs) -> Study:
    """Make a study from some of the runs, which must have the log's own rate."""
    channels = (
        Channel("tension", "tension", unit="N", noise=TORQUE_NOISE / RADIUS),
        Channel("jaw angle", "angle", unit="rad", noise=ANGLE_NOISE),
    )
    model = Path(str(files("experiments.davinci") / "davinci.xml"))
    zero = _zero(runs)
    episodes = tuple(_episode(runs, run, zero) for run in _spread(runs))
    return Study("da Vinci cable drive", model, channels, episodes, Initial(settle=0.5))


def _spread(runs: Runs) -> list[int]:
    """Runs at the corners of loads and of the upper frequencies, whose periods are short."""
    loads = _some(np.unique(runs.load), LOADS)
    known = np.unique(runs.frequency)
    frequencies = _some(known[len(known) // 2 :], FREQUENCIES)
    wanted = [(f, load) for f in frequencies for load in loads]
    pairs = list(zip(runs.frequency, runs.load, strict=True))
    return [pairs.index(pair) for pair in wanted if pair in pairs]


def _some(values: Floats, count: int) -> Floats:
    return values[np.unique(np.linspace(0, len(values) - 1, count).round().astype(int))]


def _zero(runs: Runs) -> float:
    """Jaw angle at zero spindle angle and the least load [rad]."""
    least = runs.use & (runs.load == runs.load.min())
    return float(np.median((runs.jaw - RATIO * runs.drive)[least]))


def _episode(runs: Runs, run: int, zero: float) -> Episode:
    """Episode of one run, with readings from the first turn of the spindle on."""
    frequency = runs.frequency[run]
    end = runs.time <= PERIODS / frequency
    time = np.arange(0.0, PERIODS / frequency, STEP)
    drive = np.interp(time, runs.time, runs.drive[:, run])
    target = -RADIUS * (RATIO * drive + zero)
    load = np.interp(time, runs.time, runs.resistance[:, run])
    read = end & (runs.time > BEGIN / frequency)
    read[1:] &= np.arange(1, len(read)) % round(RATE / 20) == 0
    return Episode(
        f"{frequency:g} Hz, {runs.load[run]:g} %",
        time,
        np.column_stack([target, -load]),
        (
            Reading(runs.time[read], -runs.torque[read, run] / RADIUS),
            Reading(runs.time[read], runs.jaw[read, run]),
        ),
        {"jaw": float(runs.jaw[0, run])},
    )

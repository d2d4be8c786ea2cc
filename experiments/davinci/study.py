"""The da Vinci cable drive as a study for `reality_gap`: a cable that shortens, a jaw, a load.

Commanded are what the spindle's angle makes of the cable's length, and the measured load; compared
are the spindle's torque, as tension of the cable, and the jaw's angle. `reality_gap` knows no
friction of the spindle before the cable, no cable that hardens and no compliance behind the
friction: for these see `experiments.davinci.models`.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import numpy as np

from experiments.davinci.log import BEGIN, RATE, Runs
from jmm_agent.types import Floats
from reality_gap.study.data import Channel, Episode, Initial, Reading, Study

RADIUS = 0.005
"""Of the model's pulley [m]; nominal."""
RATIO = 0.92
"""Of jaw to spindle, as the model has it."""

TORQUE_NOISE, ANGLE_NOISE = 0.006, 0.007
"""What the best structure leaves of torque [N m] and angle [rad]. Sensors are far better, but what
no structure explains repeats; evidence is weighed against that."""

LOADS, FREQUENCIES = 3, 2
"""How many of each are in the study."""
STEP = 0.001
"""Between commands [s]: held as long as the log's, they would shake a stiff cable."""
PERIODS = 1.6
"""Length of an episode; compared from `BEGIN` on."""


def make_study(runs: Runs) -> Study:
    """A study of some runs; ``runs`` at the log's own rate."""
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
    """Jaw angle at which the spindle stands at zero, at the least load [rad]."""
    least = runs.use & (runs.load == runs.load.min())
    return float(np.median((runs.jaw - RATIO * runs.drive)[least]))


def _episode(runs: Runs, run: int, zero: float) -> Episode:
    """One run from its begin on; read from the first turn of the spindle on."""
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

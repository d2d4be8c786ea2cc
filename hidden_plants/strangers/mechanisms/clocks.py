"""Clocks: sensors whose time stamps drift away from those of the commands, or are too early.

Amplitudes: clock_drift, the difference of the frequencies [1]; early_stamps of all sensors of a
kind [s].
"""

from __future__ import annotations

import numpy as np

from hidden_plants.secret import Effect
from hidden_plants.strangers.mechanisms.mechanism import Mechanism, Structure, sign, size_of
from hidden_plants.strangers.mechanisms.readings import sensors_by_kind, tune_delay
from hidden_plants.strangers.plant import Plant
from hidden_plants.strangers.stranger import Stranger


def _drifts(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    if stranger.traits.kind == "efforts":
        return []
    per = 1.0 / max(path.duration for path in stranger.paths)
    return [Structure("clock_drift", (), 0.01 * per, 0.2 * per, {"sign": sign(rng)})]


def _tune_drift(plant: Plant, effect: Effect) -> None:
    plant.drift += size_of(effect)


def _early(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    if stranger.traits.kind == "efforts":
        return []
    return [
        Structure("early_stamps", names, 0.005, 0.05, {"sign": -1.0})
        for names in sensors_by_kind(stranger)
    ]


MECHANISMS = (
    Mechanism("clock_drift", _drifts, _tune_drift),
    Mechanism("early_stamps", _early, tune_delay),
)

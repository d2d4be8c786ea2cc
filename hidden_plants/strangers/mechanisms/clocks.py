"""Clocks: sensors whose time stamps drift away from those of the commands, or are too early.

Amplitudes: clock_drift, the difference of the frequencies [1]; early_stamps of all sensors of a
kind [s].
"""

from __future__ import annotations

import numpy as np

from hidden_plants.secret import Effect
from hidden_plants.strangers.mechanisms.mechanism import Mechanism, Structure, sign, size_of
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
    kinds = dict.fromkeys(sensor.kind for sensor in stranger.sensors)
    groups = [tuple(s.name for s in stranger.sensors if s.kind == kind) for kind in kinds]
    return [Structure("early_stamps", names, 0.005, 0.05, {"sign": -1.0}) for names in groups]


def _tune_early(plant: Plant, effect: Effect) -> None:
    for name in effect.elements:
        delay = plant.reading_delay.get(name, 0.0) + size_of(effect)
        plant.reading_delay[name] = float(np.round(delay, 9))


MECHANISMS = (
    Mechanism("clock_drift", _drifts, _tune_drift),
    Mechanism("early_stamps", _early, _tune_early),
)

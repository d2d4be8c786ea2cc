"""Readings that are wrong although the machine is right.

Amplitudes: reading_zero [unit of the sensor]; reading_scale and force_reading_scale [1];
force_reading_zero [N or N m]; mirrored_reading, always 1; sensor_delay of all sensors of a
kind [s].
"""

from __future__ import annotations

from functools import partial

import numpy as np

from hidden_plants.secret import Effect
from hidden_plants.strangers.mechanisms.mechanism import (
    Mechanism,
    Structure,
    limits,
    sign,
    size_of,
)
from hidden_plants.strangers.plant import Plant
from hidden_plants.strangers.stranger import Stranger

FORCES = ("force", "effort")
"""Kinds of sensors of forces."""


def _positions(
    id: str, size: float, most: float, relative: bool, stranger: Stranger, rng: np.random.Generator
) -> list[Structure]:
    """Structures of the position readings of servos; others are encoder errors."""
    if stranger.traits.kind != "servos":
        return []
    return [
        Structure(id, (s.name,), size * scale, most * scale, {"sign": sign(rng)})
        for s in stranger.sensors
        if s.kind == "position"
        for scale in (1.0 if relative else float(stranger.travel[s.index]),)
    ]


def _forces(
    id: str, size: float, most: float, relative: bool, stranger: Stranger, rng: np.random.Generator
) -> list[Structure]:
    """Structures of the readings of forces."""
    return [
        Structure(id, (s.name,), size * scale, most * scale, {"sign": sign(rng)})
        for s in stranger.sensors
        if s.kind in FORCES
        for scale in (1.0 if relative else float(limits(stranger)[s.index]),)
    ]


def _tune_zero(plant: Plant, effect: Effect) -> None:
    name = effect.elements[0]
    plant.reading_offset[name] = plant.reading_offset.get(name, 0.0) + size_of(effect)


def _tune_scale(plant: Plant, effect: Effect) -> None:
    name = effect.elements[0]
    plant.reading_scale[name] = plant.reading_scale.get(name, 1.0) * (1.0 + size_of(effect))


def _mirrors(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    return [
        Structure("mirrored_reading", (s.name,), 1.0, 1.0)
        for s in stranger.sensors
        if s.kind == "position" and stranger.traits.kind != "efforts"
    ]


def _tune_mirror(plant: Plant, effect: Effect) -> None:
    name = effect.elements[0]
    plant.reading_scale[name] = -plant.reading_scale.get(name, 1.0)


def _delays(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    if stranger.traits.kind == "efforts":
        groups = [tuple(s.name for s in stranger.sensors if s.kind == "effort")]
    else:
        groups = sensors_by_kind(stranger)
    return [Structure("sensor_delay", names, 0.005, 0.1) for names in groups]


def sensors_by_kind(stranger: Stranger) -> list[tuple[str, ...]]:
    """Names of the sensors of each kind."""
    kinds = dict.fromkeys(s.kind for s in stranger.sensors)
    return [tuple(s.name for s in stranger.sensors if s.kind == kind) for kind in kinds]


def tune_delay(plant: Plant, effect: Effect) -> None:
    """Let sensors be late by the amplitude, or early if its sign is negative."""
    for name in effect.elements:
        delay = plant.reading_delay.get(name, 0.0) + size_of(effect)
        plant.reading_delay[name] = float(np.round(delay, 9))


MECHANISMS = (
    Mechanism("reading_zero", partial(_positions, "reading_zero", 0.01, 0.15, False), _tune_zero),
    Mechanism("reading_scale", partial(_positions, "reading_scale", 0.02, 0.3, True), _tune_scale),
    Mechanism("mirrored_reading", _mirrors, _tune_mirror),
    Mechanism(
        "force_reading_scale", partial(_forces, "force_reading_scale", 0.05, 0.6, True), _tune_scale
    ),
    Mechanism(
        "force_reading_zero", partial(_forces, "force_reading_zero", 0.02, 0.3, False), _tune_zero
    ),
    Mechanism("sensor_delay", _delays, tune_delay),
)

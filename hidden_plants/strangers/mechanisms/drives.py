"""Drives: forces, gains, limits, lags and delays.

Amplitudes: force_scale, servo_kp and servo_kd [1], relative with a ``sign``; force_offset [N or
N m]; actuator_lag and command_delay [s]; torque_limit, the share of the usual peak force by which
the limit falls short of 1.2 times it [1]. ``all`` is 1 where all drives share the effect.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from hidden_plants.secret import Effect
from hidden_plants.strangers.mechanisms.mechanism import (
    Mechanism,
    Structure,
    index_of,
    limits,
    sign,
    size_of,
)
from hidden_plants.strangers.plant import Plant
from hidden_plants.strangers.stranger import Stranger

HEADROOM = 1.2
"""Limit at which a torque limit of amplitude 0 lies, over the usual peak force."""


def _own(stranger: Stranger) -> list[tuple[str, ...]]:
    """Each actuator, and all of them; none where torques are logged in closed loop."""
    if stranger.traits.kind == "efforts":
        return []
    every = stranger.actuators
    return [(name,) for name in every] + ([every] if len(every) > 1 else [])


def _relative(
    id: str,
    size: float,
    most: float,
    kinds: tuple[str, ...],
    stranger: Stranger,
    rng: np.random.Generator,
) -> list[Structure]:
    """Structures of each drive and of all, for these kinds of machines."""
    if stranger.traits.kind not in kinds:
        return []
    return [Structure(id, names, size, most, {"sign": sign(rng)}) for names in _own(stranger)]


def _tune_force_scale(plant: Plant, effect: Effect) -> None:
    for name in effect.elements:
        plant.force_scale[index_of(plant, name)] *= 1.0 + size_of(effect)


def _tune_kp(plant: Plant, effect: Effect) -> None:
    factor = np.ones(len(plant.scale))
    for name in effect.elements:
        factor[index_of(plant, name)] += size_of(effect)
    law = plant.law
    plant.law = replace(law, gain=law.gain * factor, position=law.position * factor)


def _tune_kd(plant: Plant, effect: Effect) -> None:
    factor = np.ones(len(plant.scale))
    for name in effect.elements:
        factor[index_of(plant, name)] += size_of(effect)
    plant.law = replace(plant.law, rate=plant.law.rate * factor)


def _offsets(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    singles = [names for names in _own(stranger) if len(names) == 1]
    return [
        Structure("force_offset", names, 0.02 * limit, 0.2 * limit, {"sign": sign(rng)})
        for names, limit in zip(singles, limits(stranger).tolist(), strict=False)
    ]


def _tune_offset(plant: Plant, effect: Effect) -> None:
    plant.force_offset[index_of(plant, effect.elements[0])] += size_of(effect)


def _limits(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    if stranger.traits.kind not in ("motors", "servos"):
        return []
    peaks = stranger.design.peak
    if stranger.traits.kind == "motors":
        peaks = np.max([np.abs(c).max(axis=0) for _, c in stranger.commands], axis=0)
    singles = [names for names in _own(stranger) if len(names) == 1]
    return [
        Structure("torque_limit", names, 0.3, 0.85, {"peak": peak})
        for names, peak in zip(singles, peaks.tolist(), strict=False)
    ]


def _tune_limit(plant: Plant, effect: Effect) -> None:
    level = HEADROOM * effect.parameters["peak"] * (1.0 - effect.parameters["size"])
    i = index_of(plant, effect.elements[0])
    low, high = plant.law.low.copy(), plant.law.high.copy()
    low[i], high[i] = max(low[i], -level), min(high[i], level)
    plant.law = replace(plant.law, low=low, high=high)


def _lags(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    return [Structure("actuator_lag", names, 0.005, 0.05) for names in _own(stranger)]


def _tune_lag(plant: Plant, effect: Effect) -> None:
    for name in effect.elements:
        plant.lag[index_of(plant, name)] += effect.parameters["size"]


def _delays(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    return [Structure("command_delay", names, 0.01, 0.15) for names in _own(stranger)]


def _tune_delay(plant: Plant, effect: Effect) -> None:
    for name in effect.elements:
        plant.delay[index_of(plant, name)] += effect.parameters["size"]


_SERVOS, _POWERED = ("servos",), ("motors", "servos", "tendons")

MECHANISMS = (
    Mechanism(
        "force_scale", partial(_relative, "force_scale", 0.05, 0.6, _POWERED), _tune_force_scale
    ),
    Mechanism("servo_kp", partial(_relative, "servo_kp", 0.1, 0.7, _SERVOS), _tune_kp),
    Mechanism("servo_kd", partial(_relative, "servo_kd", 0.2, 0.9, _SERVOS), _tune_kd),
    Mechanism("force_offset", _offsets, _tune_offset),
    Mechanism("torque_limit", _limits, _tune_limit),
    Mechanism("actuator_lag", _lags, _tune_lag),
    Mechanism("command_delay", _delays, _tune_delay),
)

"""Friction of joints and tendons, by which the real machine exceeds the model.

Amplitudes: coulomb_friction [N or N m]; viscous_friction [N s/m or N m s/rad];
load_dependent_friction, the ratio of dry friction to tension [1]; direction_dependent_friction, the
larger of the levels of both directions [N], of which the other is ``other`` times it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hidden_plants.secret import Effect
from hidden_plants.strangers.mechanisms.mechanism import (
    Mechanism,
    Structure,
    index_of,
    joint_of,
    limits,
)
from hidden_plants.strangers.plant import Plant, State, travels
from hidden_plants.strangers.stranger import Stranger

Structures = Callable[[Stranger, np.random.Generator], list[Structure]]


def _coulomb(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    peaks = stranger.design.peak
    found = [
        Structure("coulomb_friction", (joint,), 0.05 * peak, 0.6 * peak, {"on_joint": 1.0})
        for joint, peak in zip(stranger.joints, peaks.tolist(), strict=True)
    ]
    for tendon, limit in zip(stranger.tendons, limits(stranger).tolist(), strict=False):
        shape = {"on_joint": 0.0}
        found.append(Structure("coulomb_friction", (tendon,), 0.02 * limit, 0.2 * limit, shape))
    return found


def _tune_coulomb(plant: Plant, effect: Effect) -> None:
    name, level = effect.elements[0], effect.parameters["size"]
    if effect.parameters["on_joint"]:
        plant.joint_friction[joint_of(plant, name)] += level
    else:
        plant.outer[index_of(plant, name)] += level


def _viscous(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    numbers = stranger.design
    sizes = (numbers.peak / numbers.speed).tolist()
    found = [
        Structure("viscous_friction", (joint,), 0.05 * size, 1.5 * size, {"on_joint": 1.0})
        for joint, size in zip(stranger.joints, sizes, strict=True)
    ]
    rates = limits(stranger) / travels(stranger)
    for tendon, rate in zip(stranger.tendons, rates.tolist(), strict=False):
        shape = {"on_joint": 0.0}
        found.append(Structure("viscous_friction", (tendon,), 0.01 * rate, 0.3 * rate, shape))
    return found


def _tune_viscous(plant: Plant, effect: Effect) -> None:
    name, coefficient = effect.elements[0], effect.parameters["size"]
    if effect.parameters["on_joint"]:
        plant.model.dof_damping[joint_of(plant, name)] += coefficient
        return
    i = index_of(plant, name)

    def act(state: State) -> None:
        state.pull[i] -= coefficient * state.velocity[i]

    plant.pull_devices.append(lambda: act)


def _each_tendon(id: str, share: float, most: float, relative: bool) -> Structures:
    """Structures on each tendon; sizes are shares, of the limit unless ``relative``."""

    def structures(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
        scales = np.ones(len(stranger.tendons)) if relative else limits(stranger)
        return [
            Structure(id, (tendon,), share * scale, most * scale, {"other": 0.15})
            for tendon, scale in zip(stranger.tendons, scales.tolist(), strict=False)
        ]

    return structures


def _tune_load_dependent(plant: Plant, effect: Effect) -> None:
    plant.load_friction[index_of(plant, effect.elements[0])] += effect.parameters["size"]


def _two_sided(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    one = _each_tendon("direction_dependent_friction", 0.02, 0.2, False)(stranger, rng)
    return [
        Structure(s.id, s.elements, s.size, s.most, {**s.shape, "out": out})
        for s in one
        for out in (1.0, 0.0)
    ]


def _tune_two_sided(plant: Plant, effect: Effect) -> None:
    shape, level = effect.parameters, effect.parameters["size"]
    levels = np.array([level, shape["other"] * level])
    plant.outer[index_of(plant, effect.elements[0])] += levels if shape["out"] else levels[::-1]


MECHANISMS = (
    Mechanism("coulomb_friction", _coulomb, _tune_coulomb),
    Mechanism("viscous_friction", _viscous, _tune_viscous),
    Mechanism(
        "load_dependent_friction",
        _each_tendon("load_dependent_friction", 0.03, 0.4, True),
        _tune_load_dependent,
    ),
    Mechanism("direction_dependent_friction", _two_sided, _tune_two_sided),
)

"""Tendons: elasticity, permanent elongation, slack, and displaced sites.

Amplitudes: tendon_elasticity [m/N]; wire_elongation [m] after ``start`` within ``duration``
[s of log time]; slack [m] at zero tension; attachment_shift [m] in a direction.
"""

from __future__ import annotations

from math import exp

import numpy as np

from hidden_plants.secret import Effect
from hidden_plants.strangers.drives import tendon_lengths
from hidden_plants.strangers.mechanisms.mechanism import (
    Mechanism,
    Structure,
    direction,
    index_of,
    limits,
    vector_of,
)
from hidden_plants.strangers.mismatch import sites_of
from hidden_plants.strangers.plant import Plant, State, travels
from hidden_plants.strangers.stranger import Stranger

QUICKEST = 0.002
"""Least time constant of a stretch [s]."""


class Stretch:
    """Elastic tendon: the encoder at the motor reads the path less the stretch."""

    def __init__(self, index: int, compliance: float, stiffness: float, step: float) -> None:
        self.index, self.compliance, self.stretch = index, compliance, 0.0
        time = max(QUICKEST, 4.0 * step * (1.0 + compliance * stiffness))
        self.share = 1.0 - exp(-step / time)

    def __call__(self, state: State) -> None:
        """Subtract the stretch from the encoder reading."""
        target = self.compliance * max(0.0, -float(state.pull[self.index]))
        self.stretch += self.share * (target - self.stretch)
        state.encoder[self.index] -= self.stretch


def _elastic(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    stiff = np.abs(stranger.law.position)
    return [
        Structure("tendon_elasticity", (tendon,), 0.05 / k, 2.0 / k)
        for tendon, k in zip(stranger.tendons, stiff.tolist(), strict=False)
    ]


def _tune_elastic(plant: Plant, effect: Effect) -> None:
    i, compliance = index_of(plant, effect.elements[0]), effect.parameters["size"]
    stiffness = float(abs(plant.law.position[i]))
    plant.encoder_devices.insert(0, lambda: Stretch(i, compliance, stiffness, plant.step))


def _elongations(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    found = []
    for tendon, travel in zip(stranger.tendons, _travels(stranger), strict=True):
        start = round(stranger.traits.seconds * rng.uniform(0.25, 0.6), 3)
        duration = float(rng.choice([0.02, 3.0]))
        shape = {"start": start, "duration": duration}
        found.append(Structure("wire_elongation", (tendon,), 0.01 * travel, 0.15 * travel, shape))
    return found


def _travels(stranger: Stranger) -> list[float]:
    return travels(stranger).tolist() if stranger.routes else []


def _tune_elongation(plant: Plant, effect: Effect) -> None:
    i, length = index_of(plant, effect.elements[0]), effect.parameters["size"]
    start, duration = effect.parameters["start"], effect.parameters["duration"]

    def act(state: State) -> None:
        share = (state.time - start) / duration
        if share > 0.0:
            state.encoder[i] -= length * min(share, 1.0)

    plant.encoder_devices.append(lambda: act)


class Toe:
    """Slack tendon: at low tension the paid-out length exceeds the length of the path."""

    def __init__(self, index: int, slack: float, tension: float, step: float) -> None:
        self.index, self.slack, self.tension, self.extra = index, slack, tension, 0.0
        self.share = 1.0 - exp(-step / QUICKEST)

    def __call__(self, state: State) -> None:
        """Add the slack to the encoder reading."""
        pull = max(0.0, -float(state.pull[self.index]))
        self.extra += self.share * (self.slack * exp(-pull / self.tension) - self.extra)
        state.encoder[self.index] += self.extra


def _slacks(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    return [
        Structure("slack", (tendon,), 0.01 * travel, 0.2 * travel, {"tension": 0.15 * limit})
        for tendon, travel, limit in zip(
            stranger.tendons, _travels(stranger), limits(stranger).tolist(), strict=False
        )
    ]


def _tune_slack(plant: Plant, effect: Effect) -> None:
    i, slack = index_of(plant, effect.elements[0]), effect.parameters["size"]
    tension = effect.parameters["tension"]
    plant.encoder_devices.append(lambda: Toe(i, slack, tension, plant.step))


def _shifts(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    shortest = min(link.length for link in stranger.skeleton.links)
    return [
        Structure("attachment_shift", (site,), 0.01 * shortest, 0.1 * shortest, direction(rng))
        for site in sites_of(stranger)
        if not site.endswith("_side")
    ]


def _tune_shift(plant: Plant, effect: Effect) -> None:
    """Move a site; its encoder is zeroed at the model's zero posture again."""
    zero = np.array(plant.model.qpos0)[None]
    before = tendon_lengths(plant.model, zero)[0]
    plant.model.site_pos[plant.model.site(effect.elements[0]).id] += vector_of(effect)
    plant.offset += before - tendon_lengths(plant.model, zero)[0]


MECHANISMS = (
    Mechanism("tendon_elasticity", _elastic, _tune_elastic),
    Mechanism("wire_elongation", _elongations, _tune_elongation),
    Mechanism("slack", _slacks, _tune_slack),
    Mechanism("attachment_shift", _shifts, _tune_shift),
)

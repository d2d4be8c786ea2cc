"""Encoders, whose errors also reach the drive that they feed.

Amplitudes: joint_offset and length_offset [rad or m]; encoder_scale and length_scale [1]; backlash,
the whole gap [rad or m].
"""

from __future__ import annotations

from functools import partial

import numpy as np

from hidden_plants.secret import Effect
from hidden_plants.strangers.drives import tendon_lengths
from hidden_plants.strangers.mechanisms.mechanism import (
    Mechanism,
    Structure,
    index_of,
    sign,
    size_of,
)
from hidden_plants.strangers.plant import Plant, State, travels
from hidden_plants.strangers.stranger import Stranger


def _each(
    id: str,
    on_tendons: bool,
    size: float,
    most: float,
    relative: bool,
    stranger: Stranger,
    rng: np.random.Generator,
) -> list[Structure]:
    """Structures of each encoder; sizes are shares of the travel unless ``relative``."""
    if bool(stranger.routes) != on_tendons:
        return []
    scales = np.ones(len(stranger.moved)) if relative else travels(stranger)
    return [
        Structure(id, (name,), size * scale, most * scale, {"sign": sign(rng)})
        for name, scale in zip(stranger.moved, scales.tolist(), strict=True)
    ]


def _tune_offset(plant: Plant, effect: Effect) -> None:
    plant.offset[index_of(plant, effect.elements[0])] += size_of(effect)


def _tune_scale(plant: Plant, effect: Effect) -> None:
    i = index_of(plant, effect.elements[0])
    zeros = np.array(plant.model.qpos0)
    if plant.stranger.routes:
        zeros = tendon_lengths(plant.model, zeros[None])[0]
    zero = float(zeros[i])
    plant.scale[i] *= 1.0 + size_of(effect)
    plant.offset[i] -= size_of(effect) * zero


class Play:
    """Gear with play before an encoder, which follows only when the play is taken up."""

    def __init__(self, index: int, gap: float) -> None:
        self.index, self.half, self.reading = index, 0.5 * gap, float("nan")

    def __call__(self, state: State) -> None:
        """Replace the encoder reading by that behind the gear."""
        true = float(state.encoder[self.index])
        if self.reading != self.reading:
            self.reading = true
        self.reading = min(max(self.reading, true - self.half), true + self.half)
        state.encoder[self.index] = self.reading


def _gaps(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    return [
        Structure("backlash", (name,), 0.01 * travel, 0.1 * travel)
        for name, travel in zip(stranger.moved, travels(stranger).tolist(), strict=True)
    ]


def _tune_gap(plant: Plant, effect: Effect) -> None:
    i, gap = index_of(plant, effect.elements[0]), effect.parameters["size"]
    plant.encoder_devices.append(lambda: Play(i, gap))


MECHANISMS = (
    Mechanism(
        "joint_offset", partial(_each, "joint_offset", False, 0.01, 0.15, False), _tune_offset
    ),
    Mechanism(
        "length_offset", partial(_each, "length_offset", True, 0.01, 0.1, False), _tune_offset
    ),
    Mechanism(
        "encoder_scale", partial(_each, "encoder_scale", False, 0.02, 0.3, True), _tune_scale
    ),
    Mechanism("length_scale", partial(_each, "length_scale", True, 0.02, 0.2, True), _tune_scale),
    Mechanism("backlash", _gaps, _tune_gap),
)

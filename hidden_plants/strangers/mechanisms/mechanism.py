"""Record of a mechanism, and helpers for where it acts and how large it is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from hidden_plants.secret import Effect
from hidden_plants.strangers.plant import Plant
from hidden_plants.strangers.stranger import Stranger
from hidden_plants.types import Floats

Shape = Mapping[str, float]


@dataclass(frozen=True)
class Structure:
    """An effect without amplitude.

    Attributes:
        id: of the effect.
        elements: names of the elements that it acts on.
        size: a usual amplitude for this machine, from which a search starts.
        most: largest physical amplitude.
        shape: parameters that do not scale with the amplitude.
        least: amplitude below which the effect is not what its name says, although it may be seen.
    """

    id: str
    elements: tuple[str, ...]
    size: float
    most: float
    shape: Shape = field(default_factory=dict)
    least: float = 0.0

    def at(self, amplitude: float) -> Effect:
        """The effect of an amplitude, which is the parameter "size"."""
        return Effect(self.id, self.elements, {**self.shape, "size": amplitude}, amplitude)


@dataclass(frozen=True)
class Mechanism:
    """One kind of effect.

    Attributes:
        id: of the effect.
        structures: lists where and in which shapes it may act on a machine, with random shapes.
        tune: applies an effect to a machine.
    """

    id: str
    structures: Callable[[Stranger, np.random.Generator], list[Structure]]
    tune: Callable[[Plant, Effect], None]


def size_of(effect: Effect) -> float:
    """Amplitude with the sign of the effect's shape."""
    return effect.parameters.get("sign", 1.0) * effect.parameters["size"]


def index_of(plant: Plant, name: str) -> int:
    """Index of the drive that is an actuator, or that moves a joint or tendon, of this name."""
    return plant.stranger.moved.index(name.removeprefix("m_"))


def joint_of(plant: Plant, name: str) -> int:
    """Index of a joint, which is also that of its link and degree of freedom."""
    return plant.stranger.joints.index(name)


def limits(stranger: Stranger) -> Floats:
    """Force limit of each drive (drives,)."""
    return np.maximum(np.abs(stranger.law.low), np.abs(stranger.law.high))


def sign(rng: np.random.Generator) -> float:
    """1 or -1."""
    return float(rng.choice([-1.0, 1.0]))


def direction(rng: np.random.Generator) -> dict[str, float]:
    """A random unit vector, as the entries x, y and z of a shape."""
    vector = rng.standard_normal(3)
    vector /= np.linalg.norm(vector)
    return {axis: round(float(part), 4) for axis, part in zip("xyz", vector, strict=True)}


def vector_of(effect: Effect) -> Floats:
    """Vector of an effect whose shape is a direction (3,)."""
    unit = np.array([effect.parameters[axis] for axis in "xyz"])
    found: Floats = effect.parameters["size"] * unit
    return found

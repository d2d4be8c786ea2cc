"""Record of a mechanism, and helpers for its shapes and parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from hidden_plants.machine import Machine
from hidden_plants.robot import Reshape, Robot
from hidden_plants.secret import Effect
from hidden_plants.types import Floats

Shape = Mapping[str, float]


@dataclass(frozen=True)
class Structure:
    """An effect without amplitude.

    Attributes:
        id: of the effect.
        elements: names of the model's elements that it acts on.
        shape: parameters that do not scale with the amplitude. ``least`` and ``most`` bound the
            sampled amplitudes further.
    """

    id: str
    elements: tuple[str, ...]
    shape: Shape = field(default_factory=dict)


def scaled(name: str) -> Callable[[Shape, float], dict[str, float]]:
    """Parameters of which ``name`` is the amplitude and the rest is the shape."""
    return lambda shape, amplitude: {**shape, name: amplitude}


BOTH_SIGNS: tuple[Shape, ...] = ({"sign": 1.0}, {"sign": -1.0})


def signed(name: str) -> Callable[[Shape, float], dict[str, float]]:
    """Parameters of which ``name`` is the amplitude times the sign of the shape."""
    return lambda shape, amplitude: {**shape, name: shape["sign"] * amplitude}


@dataclass(frozen=True)
class Mechanism:
    """One kind of effect.

    Attributes:
        id: of the catalogues in `hidden_plants.secret`.
        unit: of the amplitude.
        typical: a detectable amplitude; searches start there.
        bound: largest physical amplitude.
        structures: lists where and in which shapes the effect may act on a machine.
        parameters: computes an effect's parameters in SI units from shape and amplitude.
        reshape: applies the effect to the spec before it is compiled.
        tune: applies the effect to the robot after.
    """

    id: str
    unit: str
    typical: float
    bound: float
    structures: Callable[[Machine], list[Structure]]
    parameters: Callable[[Shape, float], dict[str, float]]
    reshape: Reshape | None = None
    tune: Callable[[Robot, Effect], None] | None = None

    def effect(self, structure: Structure, amplitude: float) -> Effect:
        """Return the effect of a structure at an amplitude."""
        parameters = self.parameters(structure.shape, amplitude)
        return Effect(self.id, structure.elements, parameters, amplitude)


def each_tendon(id: str, shapes: tuple[Shape, ...] = ({},)) -> Callable[[Machine], list[Structure]]:
    """Structures that act on one tendon, for every tendon and every shape."""

    def structures(machine: Machine) -> list[Structure]:
        return [Structure(id, (tendon,), shape) for tendon in machine.tendons for shape in shapes]

    return structures


def random_direction(rng: np.random.Generator, names: str = "xyz") -> dict[str, float]:
    """A random unit vector, as entries ``direction_<name>`` of a shape."""
    direction = rng.standard_normal(3)
    direction /= np.linalg.norm(direction)
    return {
        f"direction_{name}": round(float(part), 4)
        for name, part in zip(names, direction, strict=True)
    }


def along(shape: Shape, amplitude: float) -> dict[str, float]:
    """Parameters ``x``, ``y``, ``z``: the amplitude times the unit vector of the shape."""
    return {**shape, **{axis: amplitude * shape[f"direction_{axis}"] for axis in "xyz"}}


def vector(effect: Effect) -> Floats:
    """Parameters ``x``, ``y``, ``z`` of an effect as a vector (3,)."""
    return np.array([effect.parameters[axis] for axis in "xyz"])


def shapes_of(id: str, *names: str) -> np.random.Generator:
    """Random generator for the shapes of a mechanism at the elements ``names``."""
    return np.random.default_rng(list("/".join((id, *names)).encode()))

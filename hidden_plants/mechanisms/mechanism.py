"""What every mechanism of a hidden effect says of itself."""

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
    """An effect without its size: where it acts, and the parameters that do not scale.

    ``least`` and ``most`` in a shape bound the amplitudes that are drawn further.
    """

    id: str
    elements: tuple[str, ...]
    shape: Shape = field(default_factory=dict)


def scaled(name: str) -> Callable[[Shape, float], dict[str, float]]:
    """Parameters whose one scaled number ``name`` is the amplitude itself."""
    return lambda shape, amplitude: {**shape, name: amplitude}


BOTH_SIGNS: tuple[Shape, ...] = ({"sign": 1.0}, {"sign": -1.0})


def signed(name: str) -> Callable[[Shape, float], dict[str, float]]:
    """Parameters whose one scaled number ``name`` is the amplitude times the shape's sign."""
    return lambda shape, amplitude: {**shape, name: shape["sign"] * amplitude}


@dataclass(frozen=True)
class Mechanism:
    """One kind of effect.

    Attributes:
        id: of the catalogues in `hidden_plants.secret`.
        unit: of the amplitude.
        typical: an amplitude that shows well; searches start there.
        bound: the largest amplitude that is physical.
        structures: where it may act on a machine, some with several shapes.
        parameters: of an effect, from its shape and amplitude; SI.
        reshape: writes it into the model before it is compiled.
        tune: writes it into the machine after.
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
        """The effect of a structure at an amplitude."""
        parameters = self.parameters(structure.shape, amplitude)
        return Effect(self.id, structure.elements, parameters, amplitude)


def each_tendon(
    id: str, shapes: tuple[Shape, ...] = ({},), group: bool = False
) -> Callable[[Machine], list[Structure]]:
    """Every wire alone, with every shape; with ``group`` also all wires of the machine at once."""

    def structures(machine: Machine) -> list[Structure]:
        places = [(tendon,) for tendon in machine.tendons] + ([machine.tendons] if group else [])
        return [Structure(id, place, shape) for place in places for shape in shapes]

    return structures


def random_way(rng: np.random.Generator, names: str = "xyz") -> dict[str, float]:
    """A random unit vector, as the shape's ``way_<name>`` for three names."""
    way = rng.standard_normal(3)
    way /= np.linalg.norm(way)
    return {
        f"direction_{name}": round(float(part), 4) for name, part in zip(names, way, strict=True)
    }


def along(shape: Shape, amplitude: float) -> dict[str, float]:
    """``x``, ``y``, ``z``: the amplitude along the shape's unit vector."""
    return {**shape, **{axis: amplitude * shape[f"direction_{axis}"] for axis in "xyz"}}


def vector(effect: Effect) -> Floats:
    """``x``, ``y``, ``z`` of an effect (3,)."""
    return np.array([effect.parameters[axis] for axis in "xyz"])


def shapes_of(id: str, *names: str) -> np.random.Generator:
    """The random numbers that the shapes of a mechanism at a place are drawn from."""
    return np.random.default_rng(list("/".join((id, *names)).encode()))

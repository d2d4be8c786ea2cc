"""Nuisance: small mismatches between every robot and its nominal model, and sensor noise."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from hidden_plants.machine import Machine
from hidden_plants.types import Floats


@dataclass(frozen=True)
class Nuisance:
    """Half widths of uniform mismatches; standard deviations of noise.

    Attributes:
        mass: of every body, relative [1].
        site: of every site of a tendon, each axis [m].
        friction: dry friction of every tendon, uniform from 0 to this [N].
        encoder_offset: of every tendon [m].
        tension_offset: of every tension sensor [N].
        damping: of every joint, relative [1].
        gain: of every motor, relative [1].
        camera_shift, camera_turn: of the camera's mounting, each axis [m], [rad].
        marker_shift: of the marker on the hand, each axis [m].
        encoder_noise, tension_noise: of one reading [m], [N].
        marker_noise, marker_turn_noise: of one marker observation, each axis [m], [rad].
        jitter: half width of the sampling instants [s].
    """

    mass: float = 0.005
    site: float = 1e-4
    friction: float = 0.3
    encoder_offset: float = 3e-5
    tension_offset: float = 0.3
    damping: float = 0.03
    gain: float = 0.003
    camera_shift: float = 3e-4
    camera_turn: float = np.deg2rad(0.03)
    marker_shift: float = 1e-4
    encoder_noise: float = 1e-4
    tension_noise: float = 1.0
    marker_noise: float = 5e-4
    marker_turn_noise: float = np.deg2rad(0.2)
    jitter: float = 1e-3

    def scaled(self, factor: float) -> Nuisance:
        """Multiply all mismatches and noises by ``factor``; the jitter stays."""
        names = [field.name for field in fields(self) if field.name != "jitter"]
        values = {name: getattr(self, name) * factor for name in names}
        return Nuisance(**values, jitter=self.jitter)


class Mismatch(NamedTuple):
    """Differences between one robot and its nominal model; units as in `Nuisance`.

    Shapes: ``mass`` (bodies,); ``site`` (sites, 3); ``friction``, ``encoder_offset``,
    ``tension_offset`` and ``gain`` (tendons,); ``damping`` (joints,); ``camera_shift``,
    ``camera_turn`` and ``marker_shift`` (3,).
    """

    mass: Floats
    site: Floats
    friction: Floats
    encoder_offset: Floats
    tension_offset: Floats
    damping: Floats
    gain: Floats
    camera_shift: Floats
    camera_turn: Floats
    marker_shift: Floats


def _shapes(machine: Machine) -> dict[str, tuple[int, ...]]:
    tendons = (len(machine.tendons),)
    return {
        "mass": (len(machine.bodies),),
        "site": (len(machine.sites), 3),
        "friction": tendons,
        "encoder_offset": tendons,
        "tension_offset": tendons,
        "damping": (len(machine.joints),),
        "gain": tendons,
        "camera_shift": (3,),
        "camera_turn": (3,),
        "marker_shift": (3,),
    }


def mismatch_size(machine: Machine) -> int:
    """Number of parameters of a mismatch."""
    return sum(int(np.prod(shape)) for shape in _shapes(machine).values())


def mismatch_at(machine: Machine, nuisance: Nuisance, unit: Floats) -> Mismatch:
    """Scale unit parameters to a mismatch.

    Args:
        machine: nominal model.
        nuisance: half widths.
        unit: parameters (`mismatch_size`,), each in [-1, 1]; 0 is the mean.
    """
    parts, start = {}, 0
    for name, shape in _shapes(machine).items():
        count = int(np.prod(shape))
        part = unit[start : start + count].reshape(shape)
        if name == "friction":
            part = 0.5 * (1.0 + part)
        parts[name] = part * getattr(nuisance, name)
        start += count
    return Mismatch(**parts)


def sample_mismatch(machine: Machine, nuisance: Nuisance, rng: np.random.Generator) -> Mismatch:
    """Sample a mismatch uniformly."""
    return mismatch_at(machine, nuisance, rng.uniform(-1.0, 1.0, mismatch_size(machine)))

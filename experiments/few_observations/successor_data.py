"""Data of the networks of the authors' later papers: a drawing, rests, and settings.

Both the experiment and the process that runs torch import this module, so it imports little.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jmm_agent.mapping.group_map import Layers
from jmm_agent.types import Floats, Ints


class Observed(NamedTuple):
    """Rests of a robot, or samples of a drawing.

    Attributes:
        angles: joint angles (K, n) [rad].
        tensions: (K, m) [N].
        lengths: (K, m) [m].
        torques: of the loads (K, n) [N m].
    """

    angles: Floats
    tensions: Floats
    lengths: Floats
    torques: Floats

    def first(self, count: int) -> Observed:
        """The first rests."""
        return Observed(*(part[:count] for part in self))


class Scales(NamedTuple):
    """Scales of inputs and outputs: means and standard deviations over the drawing's samples.

    Attributes:
        angle_centre, angle: of the joint angles (n,) [rad].
        tension_centre, tension: of the tensions (m,) [N].
        length_centre, length: of the lengths (m,) [m].
        torque: of all torques of the loads, from 0 [N m].
    """

    angle_centre: Floats
    angle: Floats
    tension_centre: Floats
    tension: Floats
    length_centre: Floats
    length: Floats
    torque: float

    @classmethod
    def of(cls, samples: Observed, torque: float) -> Scales:
        """Scales of samples, with that of the torques [N m]."""
        return cls(
            samples.angles.mean(axis=0),
            samples.angles.std(axis=0),
            samples.tensions.mean(axis=0),
            samples.tensions.std(axis=0),
            samples.lengths.mean(axis=0),
            samples.lengths.std(axis=0),
            torque,
        )

    def scaled_angles(self, angles: Floats) -> Floats:
        """Scaled joint angles (..., n)."""
        return np.asarray((angles - self.angle_centre) / self.angle)

    def scaled_tensions(self, tensions: Floats) -> Floats:
        """Scaled tensions (..., m)."""
        return np.asarray((tensions - self.tension_centre) / self.tension)


class Group(NamedTuple):
    """Network of one group of muscles of the drawing.

    Attributes:
        joints, muscles: indices of its inputs and outputs.
        centre, scale: of its inputs (n_in,) [rad].
        layers: of the network.
    """

    joints: Ints
    muscles: Ints
    centre: Floats
    scale: Floats
    layers: Layers


class Drawing(NamedTuple):
    """What is known of a robot before anything is measured.

    Attributes:
        groups: networks of the nominal map.
        scales: of inputs and outputs.
        samples: of the drawing.
        rehearsed: some of them, which are learned beside what is measured.
        zero: the drawing at joint angles of 0, with the tensions that hold it (K = 1).
    """

    groups: tuple[Group, ...]
    scales: Scales
    samples: Observed
    rehearsed: Observed
    zero: Observed


@dataclass(frozen=True)
class Initial:
    """Initial training of the autoencoder.

    Attributes:
        steps: number of steps of Adam.
        batch: samples in each.
        rate: largest step size; it falls as half a cosine.
    """

    steps: int = 8000
    batch: int = 128
    rate: float = 4e-3


@dataclass(frozen=True)
class Learning:
    """Settings of an update.

    Attributes:
        rate: step size of Adam.
        steps: numbers of steps after which the networks are returned, rising.
        own: weight of what the method learns beside the measured lengths: rehearsed samples of the
            drawing, or the balance of tensions and torques.
        boundary: weight of the lengths of 0 at joint angles of 0; the physics-informed network's.
    """

    rate: float
    steps: tuple[int, ...]
    own: float
    boundary: float = 0.0

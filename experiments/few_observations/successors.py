"""Learners of the authors' later papers: from what a robot's looks gave to maps l = f(theta, T).

All start at the same drawing and get the same rests. Their networks learn by torch in a process of
its own, with the settings in `SETTINGS`, which `python -m experiments.few_observations.tune` chose.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from experiments.few_observations.methods import AUTOENCODER, PHYSICS, ROUTE_CHANGE
from experiments.few_observations.successor_data import (
    Drawing,
    Group,
    Initial,
    Learning,
    Observed,
    Scales,
)
from experiments.few_observations.tension_maps import (
    AutoencoderMap,
    DenseLayers,
    NetworkMap,
    PhysicsMap,
    RouteChangeMap,
)
from experiments.robots.world import World
from jmm_agent.guard.faults import MotorControl
from jmm_agent.mapping.array_file import ArrayFileError, read_arrays, write_arrays
from jmm_agent.mapping.torch_process import shared
from jmm_agent.tension_distribution import TensionOptions, distribute
from jmm_agent.types import Floats
from kengoro.trained_maps import default_cache
from kengoro_env.robot.muscle_law import Gains

SETTINGS = {
    ROUTE_CHANGE: Learning(1e-3, (100,), 0.0),
    AUTOENCODER: Learning(1e-3, (300,), 0.1),
    PHYSICS: Learning(1e-3, (100,), 0.01),
}
"""Settings of each learner."""
SAMPLES, REHEARSED = 20_000, 100
"""Numbers of the drawing's samples, and of those that are rehearsed."""
HELD = 300
"""Number of typical postures whose tensions set the range of the samples' tensions."""
MOST_BYTES = 64 << 20
"""Largest file of an autoencoder."""
METHOD = "autoencoder-1"
"""Name of the initial training: another one keeps its networks in other files."""
NETWORKS = "experiments.few_observations.networks"


def motors() -> MotorControl:
    """Gains and limit of the motors."""
    gains = Gains()
    return MotorControl(gains.stiffness, gains.bias, gains.limit)


def drawing_of(world: World) -> Drawing:
    """The drawing, and samples of it in the box of the typical postures.

    Tensions are random between T_bias and the largest one that holds typical postures with the
    least internal force; lengths do not depend on them, because drawn tendons do not stretch.

    Args:
        world: nominal model and typical postures.
    """
    rng = np.random.default_rng(0)
    held = nominal_rests(world, world.postures[:HELD])
    low, high = world.postures.min(axis=0), world.postures.max(axis=0)
    angles = rng.uniform(low, high, (SAMPLES, len(low)))
    tensions = rng.uniform(motors().bias, held.tensions.max(), (SAMPLES, held.tensions.shape[1]))
    samples = Observed(angles, tensions, world.map.lengths(angles), np.zeros_like(angles))
    groups = tuple(
        Group(one.joint_index, one.muscle_index, one.centre, one.scale, one.layers)
        for one in world.map.groups
    )
    scales = Scales.of(samples, float(np.sqrt(np.mean(held.torques**2))))
    zero = nominal_rests(world, np.zeros((1, len(low))))
    return Drawing(groups, scales, samples, samples.first(REHEARSED), zero)


def nominal_rests(world: World, angles: Floats) -> Observed:
    """Rests of the drawing at joint angles (K, n) [rad], with the least internal force."""
    lengths, arms = world.map.lengths_and_jacobian(angles)
    torques, control = np.array([world.arm.gravity(q) for q in angles]), motors()
    least = TensionOptions().low(control, lengths.shape[1])
    pulls = [
        distribute(own, torque, least, control.limit).tensions
        for own, torque in zip(arms, torques, strict=True)
    ]
    return Observed(angles, np.array(pulls), lengths, torques)


def autoencoder_of(drawing: Drawing, initial: Initial, folder: Path | None) -> DenseLayers:
    """The autoencoder of a drawing: read from a file, or trained and kept there.

    Args:
        drawing: the drawing.
        initial: how it is trained.
        folder: of trained maps; the user's cache folder if left out.
    """
    digest = hashlib.sha256(f"{METHOD} {initial}".encode())
    for part in (*drawing.samples, *drawing.scales):
        digest.update(np.ascontiguousarray(part).tobytes())
    path = (folder or default_cache()) / f"autoencoder-{digest.hexdigest()[:16]}.npz"
    try:
        arrays = read_arrays(path, MOST_BYTES)
        return [(arrays[f"{k}_w"], arrays[f"{k}_b"]) for k in range(len(arrays) // 2)]
    except (ArrayFileError, KeyError):
        pass
    found: DenseLayers = shared().call(f"{NETWORKS}.autoencoder:train", drawing, initial)
    arrays = {f"{k}_w": weights for k, (weights, _) in enumerate(found)}
    write_arrays(path, arrays | {f"{k}_b": offsets for k, (_, offsets) in enumerate(found)})
    return found


class Successors:
    """Makes maps from rests.

    Args:
        world: nominal model and typical postures.
        initial: training of the autoencoder.
        folder: of trained maps; the user's cache folder if left out.
    """

    def __init__(self, world: World, initial: Initial, folder: Path | None) -> None:
        self._nominal, self.drawing = world.map, drawing_of(world)
        self._start = autoencoder_of(self.drawing, initial, folder)
        # The samples are for the initial training only, and are not sent with each update.
        self._known = self.drawing._replace(samples=self.drawing.samples.first(0))

    def learn(self, name: str, seen: Observed, learning: Learning) -> list[NetworkMap]:
        """Maps of a learner, after each number of steps.

        Args:
            name: of the learner, one of `SETTINGS`.
            seen: rests; without any, the maps are those of the drawing.
            learning: settings.
        """
        if len(seen.angles) == 0:  # the mean of no errors is no number
            learning = replace(learning, steps=(0,) * len(learning.steps))
        arguments: tuple[Any, ...] = (self._known, seen, learning)
        if name == AUTOENCODER:
            found = shared().call(
                f"{NETWORKS}.autoencoder:learn", self._known, self._start, seen, learning
            )
            return [AutoencoderMap(self.drawing.scales, arrays) for arrays in found]
        module, kind = {
            ROUTE_CHANGE: ("route_change", RouteChangeMap),
            PHYSICS: ("physics_informed", PhysicsMap),
        }[name]
        found = shared().call(f"{NETWORKS}.{module}:learn", *arguments)
        return [kind(self._nominal, self.drawing.scales, arrays) for arrays in found]

    def map(self, name: str, seen: Observed) -> NetworkMap:
        """Map of a learner with its chosen settings; see `learn`."""
        return self.learn(name, seen, SETTINGS[name])[-1]

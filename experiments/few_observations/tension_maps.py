"""Maps l = f(theta, T) by the networks of the authors' later papers, evaluated without torch."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.few_observations.successor_data import Scales
from jmm_agent.mapping.group_map import METRES, Layers, sigmoid
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.types import Floats

DenseLayers = Sequence[tuple[Floats, Floats]]
"""Weights (outputs, inputs) and offsets (outputs,) of each layer; tanh is between them."""


def dense(layers: DenseLayers, x: Floats) -> Floats:
    """Outputs (B, outputs) of a network at inputs (B, inputs)."""
    for weights, offsets in layers[:-1]:
        x = np.tanh(x @ weights.T + offsets)
    weights, offsets = layers[-1]
    return np.asarray(x @ weights.T + offsets)


def dense_jacobian(layers: DenseLayers, x: Floats, inputs: int) -> Floats:
    """Derivatives (outputs, inputs) of a network by its first inputs, at x (all inputs,)."""
    slope = np.eye(len(x))[:, :inputs]
    for weights, offsets in layers[:-1]:
        x = np.tanh(weights @ x + offsets)
        slope = (1.0 - x**2)[:, None] * (weights @ slope)
    return np.asarray(layers[-1][0] @ slope)


class NetworkMap(ABC):
    """Map from joint angles and tensions to muscle lengths; see `evaluation.TensionMap`."""

    @abstractmethod
    def lengths(self, q: Floats, tensions: Floats) -> Floats:
        """Muscle lengths (B, m) [m] at angles (B, n) [rad] and tensions (B, m) [N]."""

    @abstractmethod
    def lengths_and_jacobian(self, q: Floats, tensions: Floats) -> tuple[Floats, Floats]:
        """Lengths (m,) [m] and their derivatives by the angles (m, n) [m/rad].

        Args:
            q: joint angles (n,) [rad].
            tensions: (m,) [N].
        """

    def jacobian(self, q: Floats, tensions: Floats) -> Floats:
        """Derivatives of the lengths by the angles, see `lengths_and_jacobian`."""
        return self.lengths_and_jacobian(q, tensions)[1]

    def at(self, tensions: Floats) -> AtTensions | JointMuscleMap:
        """The map from joint angles to lengths at tensions (m,) [N]."""
        return AtTensions(self, tensions)


@dataclass(frozen=True)
class AtTensions:
    """A map at tensions that stay.

    Attributes:
        whole: the map.
        tensions: (m,) [N].
    """

    whole: NetworkMap
    tensions: Floats

    def lengths(self, q: Floats) -> Floats:
        """Muscle lengths [m]: (n,) -> (m,), or (B, n) -> (B, m)."""
        postures = np.atleast_2d(q)
        lengths = self.whole.lengths(postures, np.tile(self.tensions, (len(postures), 1)))
        return lengths if np.ndim(q) == 2 else lengths[0]

    def lengths_and_jacobian(self, q: Floats) -> tuple[Floats, Floats]:
        """Lengths (m,) [m] and Jacobian (m, n) [m/rad] at angles (n,) [rad]."""
        return self.whole.lengths_and_jacobian(q, self.tensions)


class RouteChangeMap(NetworkMap):
    """Map of `networks.route_change`.

    Args:
        nominal: map of the drawing.
        scales: of inputs and outputs.
        arrays: what `networks.route_change.learn` returns.
    """

    def __init__(self, nominal: JointMuscleMap, scales: Scales, arrays: Any) -> None:
        groups, self._change = arrays
        named = zip(nominal.groups, groups, strict=True)
        self._ideal = nominal.with_layers({group.name: layers(own) for group, own in named})
        self._scales = scales

    def lengths(self, q: Floats, tensions: Floats) -> Floats:
        """See `NetworkMap.lengths`."""
        change = dense(self._change, self._inputs(q, tensions))
        return np.asarray(self._ideal.lengths(q) + self._scales.length * change)

    def lengths_and_jacobian(self, q: Floats, tensions: Floats) -> tuple[Floats, Floats]:
        """See `NetworkMap.lengths_and_jacobian`."""
        lengths, slope = self._ideal.lengths_and_jacobian(q)
        x, scale = self._inputs(q, tensions), self._scales.length
        change = scale[:, None] / self._scales.angle * dense_jacobian(self._change, x, len(q))
        return lengths + scale * dense(self._change, x), slope + change

    def _inputs(self, q: Floats, tensions: Floats) -> Floats:
        parts = self._scales.scaled_angles(q), self._scales.scaled_tensions(tensions)
        return np.concatenate(parts, axis=-1)


class PhysicsMap(NetworkMap):
    """Map of `networks.physics_informed`.

    Args:
        nominal: map of the drawing.
        scales: of inputs and outputs.
        arrays: what `networks.physics_informed.learn` returns.
    """

    def __init__(self, nominal: JointMuscleMap, scales: Scales, arrays: Any) -> None:
        self._nominal, self._scales, self._arrays = nominal, scales, arrays

    def lengths(self, q: Floats, tensions: Floats) -> Floats:
        """See `NetworkMap.lengths`."""
        scaled, found = self._scales.scaled_tensions(tensions), np.empty(tensions.shape)
        for group, own in zip(self._nominal.groups, self._arrays, strict=True):
            x = (q[:, group.joint_index] - group.centre) / group.scale
            inner = x @ own["W1"].T + own["b1"] + scaled[:, group.muscle_index] @ own["pulls"].T
            found[:, group.muscle_index] = METRES * (sigmoid(inner) @ own["W2"].T + own["b2"])
        return found

    def lengths_and_jacobian(self, q: Floats, tensions: Floats) -> tuple[Floats, Floats]:
        """See `NetworkMap.lengths_and_jacobian`."""
        return self.at(tensions).lengths_and_jacobian(q)

    def at(self, tensions: Floats) -> JointMuscleMap:
        """The map at tensions (m,) [N]: they only add to the offsets of the hidden units."""
        scaled, moved = self._scales.scaled_tensions(tensions), {}
        for group, own in zip(self._nominal.groups, self._arrays, strict=True):
            pulled = own["pulls"] @ scaled[group.muscle_index]
            moved[group.name] = layers(own)._replace(b1=own["b1"] + pulled)
        return self._nominal.with_layers(moved)


class AutoencoderMap(NetworkMap):
    """Map of `networks.autoencoder`, which is given angles and tensions, and not lengths.

    Args:
        scales: of inputs and outputs.
        arrays: what `networks.autoencoder.learn` returns.
    """

    def __init__(self, scales: Scales, arrays: Any) -> None:
        self._scales, self._layers = scales, arrays

    def lengths(self, q: Floats, tensions: Floats) -> Floats:
        """See `NetworkMap.lengths`."""
        own = dense(self._layers, self._inputs(q, tensions))
        scaled = own[:, -len(self._scales.length) :]
        return np.asarray(scaled * self._scales.length + self._scales.length_centre)

    def lengths_and_jacobian(self, q: Floats, tensions: Floats) -> tuple[Floats, Floats]:
        """See `NetworkMap.lengths_and_jacobian`."""
        whole = dense_jacobian(self._layers, self._inputs(q, tensions), len(q))
        own = whole[-len(self._scales.length) :]
        slope = own * self._scales.length[:, None] / self._scales.angle
        return self.lengths(q[None], tensions[None])[0], slope

    def _inputs(self, q: Floats, tensions: Floats) -> Floats:
        masks = np.broadcast_to([1.0, 1.0, 0.0], (*q.shape[:-1], 3))
        parts = (
            self._scales.scaled_angles(q),
            self._scales.scaled_tensions(tensions),
            np.zeros_like(tensions),
            masks,
        )
        return np.concatenate(parts, axis=-1)


def layers(arrays: dict[str, Floats]) -> Layers:
    """Layers of a group among the arrays that a process returned."""
    return Layers(arrays["W1"], arrays["b1"], arrays["W2"], arrays["b2"])

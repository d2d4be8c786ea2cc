"""What is known of a map's error before anything was learned: a Gaussian prior on output layers.

The map is corrected in its output layers only: delta(theta) = D phi(theta) with the features
phi = (1, centred hidden activities), scaled such that the offset of a wire has a standard
deviation of `offset` and its deviation in shape one of `shape` over typical postures. All wires
of a group share the kernel phi(theta)' phi(theta'). Each time that a wire gives for good, what was
measured before is off by one more unknown number, of standard deviation `give`, at all postures.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from jmm_agent.errors import AgentError
from jmm_agent.mapping.joint_muscle_map import METRES, GroupMap, JointMuscleMap
from jmm_agent.types import Floats, Ints


@dataclass(frozen=True)
class PriorOptions:
    """Standard deviations of the drawing's errors and of events.

    Attributes:
        offset: of a wire's length over all postures, from zeroing lengths by hand [m].
        shape: of how its length changes with posture, from points that lie elsewhere [m].
        noise: of what the map cannot follow: friction, stretch, play [m].
        give: of how far a wire gives when it gives for good [m].
    """

    offset: float = 0.025
    shape: float = 0.005
    noise: float = 0.001
    give: float = 0.02


class GroupKernel:
    """Kernel at K postures, plus noise, factorised, of wires that share it.

    Attributes:
        muscles: wires of one group that gave at the same times.
        features: phi (K, 1 + H) [m].
        given: covariance (K, K) of how far such a wire gave since each posture [m^2].
    """

    def __init__(self, muscles: Ints, features: Floats, noise: Floats, given: Floats) -> None:
        self.muscles = muscles
        self.features = features
        self.given = given
        self._factor = cho_factor(features @ features.T + given + np.diag(noise**2))

    def whiten(self, residual: Floats) -> Floats:
        """(Phi Phi' + given + noise^2)^-1 residual, for residuals (K, ...) [m]."""
        return cho_solve(self._factor, residual)


class MapPrior:
    """Prior of the error of a map that was trained on the drawing.

    Args:
        drawn: the map before learning; every correction is counted from it.
        postures: typical postures (N, n) [rad], N > 1, which set the scale of `shape`.

    Raises:
        AgentError: the postures are all alike.
    """

    def __init__(self, drawn: JointMuscleMap, postures: Floats, options: PriorOptions) -> None:
        self.map, self.options = drawn, options
        self._centres = []
        self._scales = []
        for group in drawn.groups:
            hidden = group.hidden(postures)
            centre = hidden.mean(axis=0)
            spread = np.sqrt(np.mean(np.sum((hidden - centre) ** 2, axis=1)))
            if spread == 0.0:
                raise AgentError("Prior: typical postures must differ in the joints of each group.")
            self._centres.append(centre)
            self._scales.append(options.shape / float(spread))

    def _features(self, rank: int, postures: Floats) -> Floats:
        hidden = self.map.groups[rank].hidden(postures)
        shape = self._scales[rank] * (hidden - self._centres[rank])
        return np.hstack([np.full((len(postures), 1), self.options.offset), shape])

    def groups(
        self, postures: Floats, noise: Floats | None = None, gave: Floats | None = None
    ) -> Sequence[GroupKernel]:
        """Kernels of all wires; where none gave, one a group, in the map's order.

        Args:
            postures: (K, n) [rad].
            noise: (K,) how far each may be missed [m]; the prior's if left out.
            gave: (K, m) how often each wire gave for good since; never if left out.
        """
        spread = np.full(len(postures), self.options.noise) if noise is None else noise
        kernels = []
        for rank, group in enumerate(self.map.groups):
            features, muscles = self._features(rank, postures), group.muscle_index
            history = np.zeros((len(postures), len(muscles))) if gave is None else gave[:, muscles]
            for times, alike in _histories(history):
                given = self.options.give**2 * np.minimum.outer(times, times)
                kernels.append(GroupKernel(muscles[alike], features, spread, given))
        return kernels

    def corrected(self, postures: Floats, lengths: Floats, noise: Floats) -> JointMuscleMap:
        """The map with the smallest change of output layers that explains pairs.

        Args:
            postures: (K, n) [rad].
            lengths: (K, m) [m].
            noise: (K,) how far each pair may be missed [m].
        """
        residual = lengths - self.map.lengths(postures)
        layers: dict[str, tuple[Floats, Floats]] = {}
        for rank, (group, kernel) in enumerate(
            zip(self.map.groups, self.groups(postures, noise), strict=True)
        ):
            change = kernel.features.T @ kernel.whiten(residual[:, kernel.muscles]) / METRES
            layers[group.name] = self._layer(rank, group, change)
        return self.map.with_output_layers(layers)

    def _layer(self, rank: int, group: GroupMap, change: Floats) -> tuple[Floats, Floats]:
        """Output layer of a group for a change (1 + H, k) [mm] of the features' weights."""
        weights = self._scales[rank] * change[1:].T
        offset = self.options.offset * change[0] - weights @ self._centres[rank]
        return group.W2 + weights, group.b2 + offset


def _histories(gave: Floats) -> Iterator[tuple[Floats, Ints]]:
    """Different columns (K,) of ``gave`` (K, k), and which columns are like each."""
    if not gave.any():
        yield np.zeros(len(gave)), np.arange(gave.shape[1])
        return
    columns, kind = np.unique(gave, axis=1, return_inverse=True)
    for number, column in enumerate(columns.T):
        yield column, np.flatnonzero(kind.ravel() == number)

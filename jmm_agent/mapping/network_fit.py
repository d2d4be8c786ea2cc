"""Fits the network of one group: Adam on both layers, then a ridge solve of the output layer.

The paper takes 8.5 million Adam steps of five samples (Kawaharazuka et al. 2018, sec. IV-A). Here
the sigmoids start centred at random points of the box of joint limits, Adam with a falling rate
moves both layers, and a ridge solve fits the output layer. This takes seconds instead of half an
hour, and leaves a tenth of the error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jmm_agent.errors import AgentError
from jmm_agent.mapping.group_map import METRES, sigmoid
from jmm_agent.types import Floats

Singles = NDArray[np.float32]

BETA1, BETA2 = 0.9, 0.99
CHUNK = 250  # steps between two entries of the loss history
SOLVED = 10_000  # samples in the final solve


class TrainingError(AgentError):
    """Options or data by which a map cannot be trained."""


class Layers(NamedTuple):
    """Layers of a network, for scaled inputs and lengths in mm.

    Attributes:
        W1: weights of the hidden layer (H, n).
        b1: offsets of the hidden layer (H,).
        W2: weights of the output layer (k, H) [mm].
        b2: offsets of the output layer (k,) [mm].
    """

    W1: Floats
    b1: Floats
    W2: Floats
    b2: Floats


@dataclass(frozen=True)
class Recipe:
    """Options of training.

    Attributes:
        hidden: number of hidden units of each group.
        samples: number of random postures of the nominal model, shared by all groups.
        margin: how far the postures reach beyond the limits, as a share of half the range.
        slope: size of the slopes of the initial sigmoids across the box of limits.
        steps: Adam steps of a group, to be multiplied by the square of its number of joints.
        batch: number of postures in each step.
        rate: largest learning rate; it falls as half a cosine.
        ridge: weight that holds the output layer where Adam left it in the final solve, per sample.
    """

    hidden: int = 1000
    samples: int = 40_000
    margin: float = 0.05
    slope: float = 4.0
    steps: int = 300
    batch: int = 32
    rate: float = 0.03
    ridge: float = 1e-7

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not (np.isfinite(value) and value > 0) and not (name == "margin" and value == 0):
                raise TrainingError(f"Recipe: {name} is {value}, but must be positive.")
        if self.samples < self.batch:
            raise TrainingError(
                f"Recipe: {self.samples} samples are less than one batch of {self.batch}."
            )


def fit(
    x: Floats,
    y: Floats,
    rng: np.random.Generator,
    recipe: Recipe,
    progress: Callable[[float], None],
) -> tuple[Layers, tuple[float, ...]]:
    """Train one network.

    Args:
        x: inputs (N, n), scaled to [-1, 1] within the limits.
        y: lengths (N, k) [mm].
        rng: random numbers.
        recipe: options of training.
        progress: called with the share that is done.

    Returns:
        The layers, and the RMSE [m] over each 250 steps.

    Raises:
        TrainingError: training diverged.
    """
    count, n = x.shape
    slopes = rng.normal(size=(recipe.hidden, n)) * recipe.slope / np.sqrt(n)
    centres = rng.uniform(-1.0, 1.0, slopes.shape)
    start = Layers(
        slopes,
        -(slopes * centres).sum(axis=1),
        np.zeros((y.shape[1], recipe.hidden)),
        y.mean(axis=0),
    )
    inputs = np.column_stack([x, np.ones(count)]).astype(np.float32)
    targets = y.astype(np.float32)
    network = Network(start, recipe.batch)
    steps = recipe.steps * n**2
    history, total = [], 0.0
    for step in range(steps):
        rows = rng.integers(count, size=recipe.batch)
        total += network.gradient(inputs[rows], targets[rows])
        network.step(recipe.rate * 0.5 * (1.0 + np.cos(np.pi * step / steps)))
        if (step + 1) % CHUNK == 0 or step + 1 == steps:
            history.append(METRES * float(np.sqrt(total / (step % CHUNK + 1))))
            if not np.isfinite(history[-1]):
                raise TrainingError(f"Training diverged at rate {recipe.rate}; a lower one helps.")
            total = 0.0
            progress((step + 1) / steps)
    return settle(x[:SOLVED], y[:SOLVED], network.layers(), recipe.ridge), tuple(history)


class Network:
    """Network in float32 with its gradient and its Adam state, each in one flat array.

    Written out in NumPy, because this takes a third of the time of automatic differentiation. The
    offsets are the last rows of the two weight matrices.

    Args:
        layers: at the start.
        batch: number of postures in each step, B.
    """

    def __init__(self, layers: Layers, batch: int) -> None:
        inner = np.vstack([layers.W1.T, layers.b1])
        outer = np.vstack([layers.W2.T, layers.b2])
        self._weights = np.concatenate([inner.ravel(), outer.ravel()]).astype(np.float32)
        self._slope = np.zeros_like(self._weights)
        self._mean = np.zeros_like(self._weights)
        self._square = np.zeros_like(self._weights)
        self._count = 0
        (self._inner, self._outer), (self._d_inner, self._d_outer) = (
            (flat[: inner.size].reshape(inner.shape), flat[inner.size :].reshape(outer.shape))
            for flat in (self._weights, self._slope)
        )
        self._hidden = np.ones((batch, len(outer)), dtype=np.float32)

    def gradient(self, inputs: Singles, targets: Singles) -> float:
        """Compute the gradient of the mean square error.

        Args:
            inputs: scaled inputs with a last column of ones (B, n + 1).
            targets: lengths (B, k) [mm].

        Returns:
            The mean square error [mm^2].
        """
        h = self._hidden[:, :-1]
        h[:] = sigmoid(inputs @ self._inner)
        error = self._hidden @ self._outer - targets
        loss = float(np.square(error).mean())
        error *= 2.0 / error.size
        np.matmul(self._hidden.T, error, out=self._d_outer)
        np.matmul(inputs.T, (error @ self._outer[:-1].T) * h * (1.0 - h), out=self._d_inner)
        return loss

    def step(self, rate: float) -> None:
        """One step of Adam (Kingma and Ba 2015) along the gradient.

        Args:
            rate: learning rate.
        """
        self._count += 1
        self._mean += (1.0 - BETA1) * (self._slope - self._mean)
        self._square += (1.0 - BETA2) * (self._slope * self._slope - self._square)
        unbias = np.sqrt(1.0 - BETA2**self._count) / (1.0 - BETA1**self._count)
        self._weights -= (rate * unbias) * self._mean / (np.sqrt(self._square) + 1e-8)

    def layers(self) -> Layers:
        """The present layers, in float64."""
        return _unpacked(self._inner, self._outer)

    def slopes(self) -> Layers:
        """The gradient by each entry of the layers, in float64."""
        return _unpacked(self._d_inner, self._d_outer)


def _unpacked(inner: Singles, outer: Singles) -> Layers:
    wide = (inner[:-1].T, inner[-1], outer[:-1].T, outer[-1])
    return Layers(*(part.astype(np.float64) for part in wide))


def settle(x: Floats, y: Floats, layers: Layers, ridge: float) -> Layers:
    """Fit the output layer by ridge regression towards the one before.

    Args:
        x: scaled inputs (N, n).
        y: lengths (N, k) [mm].
        layers: before; the hidden layer stays.
        ridge: weight of the change of the output layer, per sample.
    """
    hidden = sigmoid(x @ layers.W1.T + layers.b1)
    features = np.column_stack([hidden, np.ones(len(x))])
    rest = y - hidden @ layers.W2.T - layers.b2
    gram = features.T @ features
    gram[np.diag_indices_from(gram)] += ridge * len(x)
    change = np.linalg.solve(gram, features.T @ rest)
    return layers._replace(W2=layers.W2 + change[:-1].T, b2=layers.b2 + change[-1])

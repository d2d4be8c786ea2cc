"""Fitting one group's network: Adam on both layers, then a solve of the output layer.

The paper takes 8.5 million Adam steps of five samples (Kawaharazuka et al. 2018, sec. IV-A). Here
the sigmoids start centred at random points of the box of joint limits, Adam with a falling rate
moves both layers, and a ridge solve settles the output layer: seconds instead of half an hour, and
a tenth of the error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jmm_agent.errors import AgentError
from jmm_agent.mapping.joint_muscle_map import METRES, sigmoid
from jmm_agent.types import Floats

Singles = NDArray[np.float32]

BETA1, BETA2 = 0.9, 0.99
CHUNK = 250  # steps between two entries of the loss history
SOLVED = 10_000  # samples in the final solve


class TrainingError(AgentError):
    """A map cannot be trained as asked."""


class Layers(NamedTuple):
    """Hidden layer W1 (H, n), b1 (H,) and output layer W2 (k, H), b2 (k,) [mm]."""

    W1: Floats
    b1: Floats
    W2: Floats
    b2: Floats


@dataclass(frozen=True)
class Recipe:
    """How the networks are trained.

    Attributes:
        hidden: hidden units per group.
        samples: random postures of the drawing, shared by all groups.
        margin: how far beyond the limits they reach, as a fraction of half the range.
        slope: size of the initial sigmoids' slopes across the box.
        steps: Adam steps of a group, for each squared number of its joints.
        batch: postures per step.
        rate: largest learning rate; it falls as half a cosine.
        ridge: how firmly the final solve holds the output layer where Adam left it, per sample.
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
    """Train one network on scaled inputs x (N, n) and lengths y (N, k) [mm].

    Returns its layers, for inputs scaled alike and outputs in mm, and the RMSE [m] over each 250
    steps. `progress` hears the fraction that is done.

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
    """The network in float32 with its gradient and its Adam state, each in one flat array.

    Written out, because a step takes a third of the time that autograd needs for it. The biases
    are the last rows of the two weight matrices; a batch (B, n + 1) of inputs ends in ones.
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
        """Set the gradient of the mean square error, which is returned."""
        h = self._hidden[:, :-1]
        h[:] = sigmoid(inputs @ self._inner)
        error = self._hidden @ self._outer - targets
        loss = float(np.square(error).mean())
        error *= 2.0 / error.size
        np.matmul(self._hidden.T, error, out=self._d_outer)
        np.matmul(inputs.T, (error @ self._outer[:-1].T) * h * (1.0 - h), out=self._d_inner)
        return loss

    def step(self, rate: float) -> None:
        """One step of Adam (Kingma and Ba 2015) along the gradient."""
        self._count += 1
        self._mean += (1.0 - BETA1) * (self._slope - self._mean)
        self._square += (1.0 - BETA2) * (self._slope * self._slope - self._square)
        unbias = np.sqrt(1.0 - BETA2**self._count) / (1.0 - BETA1**self._count)
        self._weights -= (rate * unbias) * self._mean / (np.sqrt(self._square) + 1e-8)

    def layers(self) -> Layers:
        """The layers as they stand, in float64."""
        return _unpacked(self._inner, self._outer)

    def slopes(self) -> Layers:
        """The gradient by the layers' entries, in float64."""
        return _unpacked(self._d_inner, self._d_outer)


def _unpacked(inner: Singles, outer: Singles) -> Layers:
    wide = (inner[:-1].T, inner[-1], outer[:-1].T, outer[-1])
    return Layers(*(part.astype(np.float64) for part in wide))


def settle(x: Floats, y: Floats, layers: Layers, ridge: float) -> Layers:
    """The layers with the output layer that fits y (N, k) [mm] at x (N, n) best.

    The ridge holds it where it was: what the samples do not say stays as it is.
    """
    hidden = sigmoid(x @ layers.W1.T + layers.b1)
    features = np.column_stack([hidden, np.ones(len(x))])
    rest = y - hidden @ layers.W2.T - layers.b2
    gram = features.T @ features
    gram[np.diag_indices_from(gram)] += ridge * len(x)
    change = np.linalg.solve(gram, features.T @ rest)
    return layers._replace(W2=layers.W2 + change[:-1].T, b2=layers.b2 + change[-1])

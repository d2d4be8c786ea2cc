"""Fits the network of one group: Adam on both layers, then a ridge solve of the output layer.

The paper takes 8.5 million Adam steps of five samples (Kawaharazuka et al. 2018, sec. IV-A). Here
the sigmoids start centred at random points of the box of joint limits, Adam with a falling rate
moves both layers in float32, and a ridge solve in float64 fits the output layer. This takes seconds
instead of half an hour, and leaves a tenth of the error.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, pi

import numpy as np
import torch
from torch.nn.functional import mse_loss

from jmm_agent.mapping.group_map import METRES, Layers
from jmm_agent.mapping.recipe import Recipe, TrainingError
from jmm_agent.networks.network import Network, tensor
from jmm_agent.types import Floats

BETAS = (0.9, 0.99)
CHUNK = 250  # steps between two entries of the loss history
SOLVED = 10_000  # samples in the final solve


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
    network = Network(start(x.shape[1], y, rng, recipe), torch.float32)
    inputs, targets = tensor(x, torch.float32), tensor(y, torch.float32)
    steps = recipe.steps * x.shape[1] ** 2
    adam = torch.optim.Adam(network.parameters(), recipe.rate, BETAS, fused=True)
    falling = torch.optim.lr_scheduler.LambdaLR(
        adam, lambda step: 0.5 * (1.0 + cos(pi * step / steps))
    )
    history, total = [], torch.zeros(())
    for step in range(1, steps + 1):
        rows = torch.from_numpy(rng.integers(len(x), size=recipe.batch))
        adam.zero_grad()
        loss = mse_loss(network.of_scaled(inputs[rows]), targets[rows])
        loss.backward()
        adam.step()
        falling.step()
        total += loss.detach()
        if step % CHUNK == 0 or step == steps:
            count = (step - 1) % CHUNK + 1
            history.append(METRES * float(np.sqrt(total.item() / count)))
            if not np.isfinite(history[-1]):
                raise TrainingError(f"Training diverged at rate {recipe.rate}; a lower one helps.")
            total = torch.zeros(())
            progress(step / steps)
    return settle(x[:SOLVED], y[:SOLVED], network.layers(), recipe.ridge), tuple(history)


def start(inputs: int, y: Floats, rng: np.random.Generator, recipe: Recipe) -> Layers:
    """Layers before training: sigmoids across the box of limits, and mean lengths.

    Args:
        inputs: number of joints.
        y: lengths (N, k) [mm].
        rng: random numbers.
        recipe: options of training.
    """
    slopes = rng.normal(size=(recipe.hidden, inputs)) * recipe.slope / np.sqrt(inputs)
    centres = rng.uniform(-1.0, 1.0, slopes.shape)
    outer = np.zeros((y.shape[1], recipe.hidden))
    return Layers(slopes, -(slopes * centres).sum(axis=1), outer, y.mean(axis=0))


def settle(x: Floats, y: Floats, layers: Layers, ridge: float) -> Layers:
    """Fit the output layer by ridge regression towards the one before.

    Args:
        x: scaled inputs (N, n).
        y: lengths (N, k) [mm].
        layers: before; the hidden layer stays.
        ridge: weight of the change of the output layer, per sample.
    """
    network = Network(layers)
    with torch.no_grad():
        hidden = torch.sigmoid(network.hidden(tensor(x)))
        features = torch.column_stack([hidden, hidden.new_ones(len(x))])
        gram = features.T @ features
        gram.diagonal().add_(ridge * len(x))
        rest = tensor(y) - network.output(hidden)
        change = torch.linalg.solve(gram, features.T @ rest).numpy()
    return layers._replace(W2=layers.W2 + change[:-1].T, b2=layers.b2 + change[-1])

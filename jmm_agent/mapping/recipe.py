"""Options of the initial training of a map (Kawaharazuka et al. 2018, sec. II-A)."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from jmm_agent.errors import AgentError


class TrainingError(AgentError):
    """Options, data or a process by which networks cannot be trained."""


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
    steps: int = 150
    batch: int = 64
    rate: float = 0.04
    ridge: float = 1e-7

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not (np.isfinite(value) and value > 0) and not (name == "margin" and value == 0):
                raise TrainingError(f"Recipe: {name} is {value}, but must be positive.")
        if self.samples < self.batch:
            raise TrainingError(
                f"Recipe: {self.samples} samples are less than one batch of {self.batch}."
            )

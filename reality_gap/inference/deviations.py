"""Most probable deviations: what tolerances explain of residuals, and what they leave."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reality_gap.inference.problem import Problem
from reality_gap.inference.whitening import likeliest_sizes
from reality_gap.study.splits import SELECT, split
from reality_gap.types import Floats


@dataclass(frozen=True)
class Deviations:
    """Most probable deviations of a model that leaves a residual, given the readings.

    Attributes:
        sizes: the deviations, shape (p,) [tolerances].
        left: what they leave of the residual, shape (n,) [noise].
        cost: what they cost, per reading: a deviation of one tolerance is as unlikely as a reading
            with an error of one noise [noise^2].
    """

    sizes: Floats
    left: Floats
    cost: float

    @property
    def left_with_cost(self) -> Floats:
        """Size of what they leave, and of what they cost, shape (n,) [noise].

        Deviations of many tolerances explain nearly everything.
        """
        return np.asarray(np.sqrt(self.left**2 + self.cost))


def deviations(problem: Problem, *residuals: Floats) -> tuple[Deviations, ...]:
    """Infer the deviations of each residual (n,) [noise] from the fit and selection splits."""
    use, tolerances = split(problem.measured) <= SELECT, problem.noise_model.tolerances
    every = np.column_stack(residuals)
    sizes = likeliest_sizes(tolerances, np.ones(len(use)), use, every)
    left = every - tolerances @ sizes
    cost = np.sum(sizes**2, axis=0) / np.count_nonzero(use)
    return tuple(Deviations(sizes[:, i], left[:, i], float(cost[i])) for i in range(len(residuals)))

"""Learned residual: what the few best columns of a bank explain of a residual.

Up to `MOST_COLUMNS` columns that explain most are learned in closed form. Their evidence includes a
penalty for their number, for having been selected, and for the selection of their bank. A learned
residual is never a cause. It estimates how much there is to explain, and what it explains beyond
the causes counts as unexplained.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reality_gap.inference.motion_functions import Bank
from reality_gap.inference.problem import Problem
from reality_gap.study.splits import REPORT, split
from reality_gap.types import Floats

SIZE = 3.0
"""Prior deviation of a weight; with weight 1, a column has the size of the noise."""
MOST_COLUMNS = 6
"""Largest number of columns of a bank that are learned."""


@dataclass(frozen=True)
class Learned:
    """What a bank explains of a residual.

    Attributes:
        name: name of the bank.
        evidence: increase of the log marginal likelihood of the fit and selection splits [nats].
        prediction: explained part of the residual in units of noise, shape (n,).
        explained: share of the residual's power on the report split; may be negative.
    """

    name: str
    evidence: float
    prediction: Floats
    explained: float


def learn_best(problem: Problem, residual: Floats, banks: Sequence[Bank]) -> Learned:
    """Learn a residual by the bank that explains it best; before, all are equally likely.

    Args:
        problem: what is to be explained.
        residual: the residual to learn in units of noise, shape (n,).
        banks: at least one bank.
    """
    found = (learn(problem, residual, bank, len(banks)) for bank in banks)
    return max(found, key=lambda one: one.evidence)


def learn(problem: Problem, residual: Floats, bank: Bank, banks: int = 1) -> Learned:
    """Learn a residual by the few columns of a bank that explain it best.

    Columns are added one by one, each with a penalty for its freedom and for its selection.

    Args:
        problem: what is to be explained.
        residual: the residual to learn in units of noise, shape (n,).
        bank: functions to learn from.
        banks: number of banks of which this may be the best.
    """
    whiten = problem.noise_model.whiten
    columns, left = whiten(bank.columns), whiten(residual)
    gram, right = columns.T @ columns, columns.T @ left
    count = len(right)
    chosen: list[int] = []
    best, weight = 0.0, np.zeros(0)
    while len(chosen) < min(MOST_COLUMNS, count):
        trials = [
            (_evidence(gram, right, [*chosen, j]), j) for j in _candidates(gram, right, chosen)
        ]
        evidence, j = max(trials)
        penalty = np.log(banks) + sum(np.log(count - i) for i in range(len(chosen) + 1))
        if evidence - penalty < best + 1.0:
            break
        chosen.append(j)
        best = evidence - penalty
        weight = _weights(gram, right, chosen)
    prediction = bank.columns[:, chosen] @ weight if chosen else np.zeros(len(residual))
    report = split(problem.measured) == REPORT
    power = float(np.sum(residual[report] ** 2))
    decrease = power - float(np.sum((residual[report] - prediction[report]) ** 2))
    return Learned(bank.name, best, prediction, decrease / power if power else 0.0)


def _candidates(gram: Floats, right: Floats, chosen: list[int]) -> list[int]:
    """Return the columns that explain most of what the chosen ones leave."""
    left = right - gram[:, chosen] @ _weights(gram, right, chosen) if chosen else right
    score = left**2 / (np.diag(gram) + 1e-9)
    score[chosen] = -1.0
    return [int(j) for j in np.argsort(-score)[:5]]


def _weights(gram: Floats, right: Floats, chosen: list[int]) -> Floats:
    """Return the most likely weights of the chosen columns."""
    part = gram[np.ix_(chosen, chosen)] + np.eye(len(chosen)) / SIZE**2
    weights: Floats = np.linalg.solve(part, right[chosen]).astype(np.float64)
    return weights


def _evidence(gram: Floats, right: Floats, chosen: list[int]) -> float:
    """Return the log marginal likelihood of weights with prior deviation `SIZE` [nats]."""
    part = gram[np.ix_(chosen, chosen)]
    weight = _weights(gram, right, chosen)
    _, log_determinant = np.linalg.slogdet(np.eye(len(chosen)) + SIZE**2 * part)
    return 0.5 * float(right[chosen] @ weight - log_determinant)

"""Typical effects: what typical faults of candidates change, as a Gram matrix."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from reality_gap.inference.problem import Problem
from reality_gap.inference.screening import TYPICAL_FAULTS, Sensitivity
from reality_gap.inference.whitening import whitening
from reality_gap.study.splits import SELECT, split
from reality_gap.types import Floats, Ints

OPERATIONS = 2e10
"""Number of multiplications for the Gram matrix from which on readings are left out."""
EVENTS = ("external_force",)
"""Ids of causes that come from outside, so that no motion shows them."""


@dataclass(frozen=True)
class Effects:
    """Effects of typical faults.

    Attributes:
        gram: Gram matrix of the change of the readings by each parameter, shape (k, k).
        owner: index of the candidate that each parameter belongs to, shape (k,).
    """

    gram: Floats
    owner: Ints

    @property
    def count(self) -> int:
        """Number of candidates."""
        return int(self.owner[-1]) + 1

    def columns(self, i: int) -> Ints:
        """Return the indices of the columns of a candidate."""
        return np.flatnonzero(self.owner == i)

    @cached_property
    def foremost(self) -> Ints:
        """Index of the column with the largest effect of each candidate, shape (n,)."""
        power = np.diag(self.gram)
        own = (self.columns(i) for i in range(self.count))
        return np.array([columns[np.argmax(power[columns])] for columns in own])

    def size(self, i: int) -> float:
        """Return the largest effect of a typical fault [noise]."""
        c = self.foremost[i]
        return float(np.sqrt(max(0.0, self.gram[c, c])))

    def distances(self, j: int) -> Floats:
        """Return the effect of each candidate that candidate j cannot have, shape (n,) [noise]."""
        others, first = self.columns(j), self.foremost
        along = self.gram[np.ix_(others, first)]
        fitted = np.linalg.lstsq(self.gram[np.ix_(others, others)], along, rcond=1e-12)[0]
        left = self.gram[first, first] - np.sum(along * fitted, axis=0)
        return np.asarray(np.sqrt(np.maximum(left, 0.0)))


def left_over(power: float, along: Floats, gram: Floats) -> float:
    """Return the norm of a column less its projection on others.

    Args:
        power: its square.
        along: products with the others, shape (k,).
        gram: Gram matrix of the others, shape (k, k).
    """
    explained = float(along @ np.linalg.lstsq(gram, along, rcond=1e-12)[0])
    return float(np.sqrt(max(0.0, power - explained)))


def largest_of_each(sensitivities: Sequence[Sensitivity]) -> list[Sensitivity]:
    """Return the largest sensitivity of each candidate at one element, or at one sensor."""
    largest: dict[tuple[str, str], Sensitivity] = {}
    for one in sensitivities:
        cause, location = one.candidate.cause.id, one.candidate.location
        group = len(location.elements) > 1 and location.kind != "sensor"
        if cause in EVENTS or location.log or group:
            continue
        key = cause, str(location)
        if key not in largest or one.change > largest[key].change:
            largest[key] = one
    return list(largest.values())


def whitened(problem: Problem, own: Sequence[Sensitivity]) -> Floats:
    """Return the whitened change of the readings by typical faults, shape (m, k).

    Of long logs and many candidates every s-th reading is used, times the root of s.
    """
    tolerances = problem.noise_model.tolerances
    used = np.flatnonzero(split(problem.measured) <= SELECT)
    count = sum(one.columns.shape[1] for one in own) + tolerances.shape[1]
    stride = 1 + int(len(used) * count**2 / OPERATIONS)
    rows = used[::stride]
    whiten = whitening(
        np.sqrt(stride) * tolerances[rows] / problem.roughness,
        np.ones(len(rows)),
        np.ones(len(rows), dtype=bool),
    )
    size = TYPICAL_FAULTS * np.sqrt(stride)
    stacked = np.column_stack([one.columns[rows] for one in own]).astype(np.float64)
    return whiten(size * stacked)


def effects_of(own: Sequence[Sensitivity], columns: Floats) -> Effects:
    """Return the effects of candidates whose parameters change the readings by columns (m, k)."""
    owner = np.repeat(np.arange(len(own)), [one.columns.shape[1] for one in own])
    return Effects(columns.T @ columns, owner)

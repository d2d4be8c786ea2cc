"""Estimate of the size of a cause that is known to be the only one, as a diagnosis makes it.

The tolerances of the nominal model are marginalised, the noise model is inflated by what the cause
leaves, and the fit is repeated with rougher tolerances or about the likeliest deviations where a
diagnosis does so. No threshold decides whether the cause is found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from reality_gap import CATALOGUE, Candidate, Options
from reality_gap.diagnosis import Estimate
from reality_gap.inference.deferral import split_deferred
from reality_gap.inference.expansion import expand, is_small
from reality_gap.inference.forward_selection import Search, Settings
from reality_gap.inference.intervals import intervals
from reality_gap.inference.likelihood import FAR
from reality_gap.inference.rough_search import search_roughly
from reality_gap.inference.screening import Sensitivity, list_candidates, screen
from reality_gap.inference.tolerances import Tolerance, list_tolerances, tolerance_columns
from reality_gap.simulation.replayer import Replayer
from reality_gap.types import Floats

KNOWN = Settings(threshold=-np.inf, most=1)
"""Accepts the known cause, whatever its evidence."""


class Slopes(NamedTuple):
    """Changes of the readings that a fit starts from.

    Attributes:
        right: sensitivities of the cause.
        tolerances: of the nominal model.
        columns: changes by these and by others, shape (n, p).
        noise: of each reading, in units of which all changes are, shape (n,).
    """

    right: tuple[Sensitivity, ...]
    tolerances: Sequence[Tolerance]
    columns: Floats
    noise: Floats

    def in_noise_of(self, noise: Floats) -> Slopes:
        """Return the same changes in units of another noise (n,).

        The noise of a coarse sensor depends on how long its readings stand still.
        """
        factor = (self.noise / noise)[:, None]
        single = factor.astype(np.float32)
        right = [replace(one, columns=single * one.columns) for one in self.right]
        columns = [factor[:, 0] * one.column for one in self.tolerances]
        tolerances = [
            one._replace(column=column)
            for one, column in zip(self.tolerances, columns, strict=True)
        ]
        return Slopes(tuple(right), tolerances, factor * self.columns, noise)


def screen_known(replayer: Replayer, right: Candidate) -> Slopes:
    """Compute the changes of the readings by a cause and by all tolerances.

    Args:
        replayer: replays of the study.
        right: the cause at its location.
    """
    candidates, _ = split_deferred(
        replayer.system, list_candidates(replayer.system, list(CATALOGUE.values()))
    )
    wanted = [one for one in candidates if _is_tolerance(one) and not one.matches(right)]
    null = replayer.residual([])
    found = screen(replayer, [*wanted, right], null)
    tolerances = list(list_tolerances(found, Options().tolerance))
    columns = tolerance_columns(replayer, tolerances, null)
    own = tuple(one for one in found if one.candidate.matches(right))
    return Slopes(own, tolerances, columns, replayer.measured.noise)


def _is_tolerance(candidate: Candidate) -> bool:
    """Return whether `list_tolerances` may list a candidate."""
    single = len(candidate.location.elements) == 1
    return any(p.tolerance > 0.0 and (single or p.usual) for p in candidate.parameters)


def estimate(replayer: Replayer, slopes: Slopes, name: str) -> Estimate:
    """Estimate a parameter of the known cause, with its 95 % interval.

    Args:
        replayer: replays of the study.
        slopes: changes of the readings.
        name: of the parameter.
    """
    slopes = slopes.in_noise_of(replayer.measured.noise)
    result = _fit(replayer, slopes, slopes.columns)
    best = result.best
    if not is_small(replayer, slopes.columns, best.residual):
        columns, hypothesis = slopes.columns, best.hypothesis
        found = expand(replayer, slopes.tolerances, columns, hypothesis, best.residual)
        if found.expansion.parts and found.power < FAR:
            replayer.expansion = found.expansion
            result = _fit(replayer, slopes, found.columns)
    return intervals(result.problem, result.best)[0][name]


def _fit(replayer: Replayer, slopes: Slopes, columns: Floats) -> Search:
    """Fit the known cause with as rough tolerances as its remainder shows."""
    null = replayer.residual([])
    return search_roughly(replayer, null, slopes.tolerances, columns, slopes.right, KNOWN)

"""Roughness: by how much a model exceeds its tolerances everywhere.

Tolerances are those of a careful drawing. Other models are rougher in all of their numbers. With
the columns N of the tolerances, residuals in units of sensor noise have the covariance
C = I + s^2 N N', and the roughness s is the one that makes what the best causes leave most likely
(empirical Bayes). The search for causes is then repeated with tolerances of s times their size. A
few numbers that are wrong by far are no roughness: the directions of N for which a larger s pays
most are not counted.
"""

from __future__ import annotations

import numpy as np

from reality_gap.inference.whitening import directions
from reality_gap.study.measurements import Measured
from reality_gap.study.splits import SELECT, split
from reality_gap.types import Floats

SCALES = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
"""Values of s that are compared."""
DOUBT = 5.0
"""Evidence that each doubling of s needs [nats]."""
FEW = 0.1
"""Share of the directions that are not counted, at least one."""


def roughness(
    measured: Measured, tolerances: Floats, remainder: Floats, inflation: Floats
) -> float:
    """Return the likeliest roughness s of `SCALES`.

    Args:
        measured: the readings.
        tolerances: N, shape (n, p).
        remainder: residual that causes leave, in units of sensor noise, shape (n,).
        inflation: how many readings count as one, shape (n,); see `NoiseModel`.
    """
    use = split(measured) <= SELECT
    weight = 1.0 / np.sqrt(inflation[use])
    columns = tolerances[use] * weight[:, None]
    power, vectors = directions(columns)
    along = (vectors.T @ (columns.T @ (weight * remainder[use]))) ** 2 / power
    few = max(1, round(FEW * len(power)))
    ordinary = _evidence(along, power, 1.0)
    evidence = [
        float(np.sum(np.sort(_evidence(along, power, s) - ordinary)[:-few]))
        - DOUBT * float(np.log2(s))
        for s in SCALES
    ]
    return SCALES[int(np.argmax(evidence))]


def _evidence(along: Floats, power: Floats, s: float) -> Floats:
    """Return the evidence of a roughness in each direction (k,) [nats].

    Args:
        along: squared residual along each direction, shape (k,).
        power: squared norm of the columns of tolerances there, shape (k,).
        s: roughness.
    """
    large = s**2 * power
    return 0.5 * (along * large / (1.0 + large) - np.log1p(large))

"""How sure a diagnosis is: evidence, tempered until it keeps its word.

Evidence believes that one of the suspects is exactly right, which none ever is: a real wire's
friction is no `frictionloss`. What is wrong with the right cause's form grows with the effect, so
that evidence is divided by a temper that grows with the evidence of the best. Both numbers were set
on tuning seeds; `python -m experiments gap-bench` measures how well the confidence keeps its word.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from reality_gap.fitting import Fit

Array = NDArray[np.float64]

FLAT = 1.5
"""Temper of the smallest evidence."""
SHARE = 0.02
"""How the temper grows with the evidence."""


def probabilities(base: float, fits: Sequence[Fit]) -> Array:
    """Probability of each fit (k,) against the others and against ``base`` alone.

    Args:
        base: evidence of the hypothesis without any of them [nats].
        fits: of rivals beside it.
    """
    evidence = np.array([base, *(f.evidence for f in fits)]) - base
    temper = FLAT + SHARE * max(0.0, float(evidence.max()))
    weight = np.exp((evidence - evidence.max()) / temper)
    return weight[1:] / weight.sum()

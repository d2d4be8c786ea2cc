"""How sure a diagnosis is: evidence, tempered until it keeps its word.

Evidence believes that one of the suspects is exactly right, which none ever is: a real wire's
friction has no such simple law. What is wrong with the right cause's form grows with the effect, so
that evidence is divided by a temper that grows with the evidence of the best. Its two numbers were
set on tuning seeds. `python -m experiments gap-calibrate` finds them on replays of the drawing with
causes in it; `gap-bench` measures how well the confidence keeps its word.
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
    return tempered(np.array([f.evidence for f in fits]) - base, FLAT, SHARE)


def tempered(evidence: Array, flat: float, share: float) -> Array:
    """Probabilities (k,) from evidence (k,) over that of none [nats], with a temper."""
    heights = np.concatenate([[0.0], evidence])
    most = float(heights.max())
    weight = np.exp((heights - most) / (flat + share * most))
    return np.asarray(weight[1:] / weight.sum(), dtype=np.float64)

"""How sure a diagnosis is: evidence, tempered until it keeps its word.

Evidence believes that one of the suspects is exactly right, that every fit found its best, and that
what drawings are off by adds up linearly. None of this is quite so, so that evidence is divided by
a temper. `python -m experiments gap-calibrate` finds it on replays of the drawing with causes in
it; `gap-replayer` measures how well the confidence keeps its word.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from reality_gap.inference.gauss_newton import Fit
from reality_gap.types import Floats

TEMPER = 3.2
"""By what evidence is divided: of `gap-calibrate --trials 50 --seed 0`."""


def probabilities(base: float, fits: Sequence[Fit]) -> Floats:
    """Probability of each fit (k,) against the others and against ``base`` alone.

    Args:
        base: evidence of the hypothesis without any of them [nats].
        fits: of rivals beside it.
    """
    return tempered(np.array([f.evidence for f in fits]) - base, TEMPER)


def unmodelled(named: float, learned: float) -> float:
    """Probability that the gap is none of the causes, but something that has no name.

    The learned residual is one rival more: a catalogue is never whole.

    Args:
        named: evidence of the causes [nats].
        learned: of what was learned in their place.
    """
    return float(tempered(np.array([learned - named]), TEMPER)[0])


def tempered(evidence: Floats, temper: float) -> Floats:
    """Probabilities (k,) from evidence (k,) over that of none [nats], with a temper."""
    heights = np.concatenate([[0.0], evidence])
    weight = np.exp((heights - heights.max()) / temper)
    return np.asarray(weight[1:] / weight.sum(), dtype=np.float64)

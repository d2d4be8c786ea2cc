"""Confidence: calibrated probabilities of hypotheses from their evidence.

Evidence assumes that one of the candidates is exactly right, that each fit found its optimum, and
that the effects of tolerances add up linearly. None of these holds exactly, so that evidence e is
divided by a temper T: p_i = exp(e_i / T) / (1 + sum_j exp(e_j / T)), where 1 stands for the
hypothesis without any of the candidates. `python -m experiments gap-calibrate` finds T from
simulated studies with known causes; `gap-bench` measures how well the confidence is calibrated.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from reality_gap.inference.gauss_newton import Fit
from reality_gap.types import Floats

TEMPER = 3.2
"""T, by which evidence is divided: result of `gap-calibrate --trials 50 --seed 0`."""
MIMICRY = 0.5
"""Probability that a cause is wrong beside unknown causes with much more evidence."""
NEARLY = 0.3
"""Probability that a cause is only nearly right if it leaves many noises."""


def probabilities(base: float, fits: Sequence[Fit]) -> Floats:
    """Return the probability of each fit against the others and against ``base``, shape (k,).

    Args:
        base: evidence of the hypothesis without any of the candidates [nats].
        fits: fits of that hypothesis with one candidate more each.
    """
    return tempered(np.array([f.evidence for f in fits]) - base, TEMPER)


def unmodelled(named: float, learned: float) -> float:
    """Return the probability that the gap has a cause that is not in the catalogue.

    A catalogue is never complete, so that a learned residual is one hypothesis more.

    Args:
        named: evidence of the named causes [nats].
        learned: evidence of the learned residual in their place [nats].
    """
    return float(tempered(np.array([learned - named]), TEMPER)[0])


def doubt_of_partial(named: float, left: float, instead: float) -> float:
    """Return the probability that causes are wrong that leave a part of the gap.

    They are wrong if an unknown cause has the whole effect, so that what is learned of the whole
    gap is compared with the causes and what is learned of their remainder. An unknown cause that
    certainly exists, since it leaves errors, may also have a part of the effect of a named one. The
    more it leaves, the likelier that is.

    Args:
        named: evidence of the named causes [nats].
        left: evidence of the learned residual of their remainder [nats].
        instead: evidence of the learned residual in their place [nats].
    """
    share = left / (named + left) if named + left > 0.0 else 1.0
    return max(unmodelled(named + left, instead), MIMICRY * share)


def doubt_beside_unknown(gained: Floats, left: Floats) -> float:
    """Return the probability that a cause is wrong because of what remains beside it.

    What remains has unknown causes. The smaller the part of a cause is beside theirs, the likelier
    is it that the cause makes up for one of them, in whose place it then is.

    Args:
        gained: what the cause takes from the mean square of each channel, shape (c,) [noise^2].
        left: mean square that all causes leave of each channel, shape (c,) [noise^2].
    """
    gained, excess = np.maximum(gained, 0.0), np.maximum(left - 1.0, 0.0)
    total = float(gained.sum())
    if total == 0.0:
        return MIMICRY if excess.any() else 0.0
    return MIMICRY * float(gained @ (excess / np.maximum(excess + gained, 1e-12))) / total


def doubt_of_form(left: float, allowed: float) -> float:
    """Return the probability that a cause is wrong because of how much all causes leave.

    A cause that is nearly right, such as a limit of the speed in place of a torque that falls with
    it, takes nearly all of a large error and leaves what its form lacks. Whatever the share is, the
    more noises that is, the likelier are such causes.

    Args:
        left: RMS that the causes leave [noise].
        allowed: the largest that is no objection [noise].
    """
    return NEARLY * (1.0 - (allowed / left) ** 2) if left > allowed else 0.0


def tempered(evidence: Floats, temper: float) -> Floats:
    """Return probabilities from evidence, shape (k,).

    Args:
        evidence: evidence over that of none of the hypotheses, shape (k,) [nats].
        temper: T, by which evidence is divided.
    """
    heights = np.concatenate([[0.0], evidence])
    weight = np.exp((heights - heights.max()) / temper)
    return np.asarray(weight[1:] / weight.sum(), dtype=np.float64)

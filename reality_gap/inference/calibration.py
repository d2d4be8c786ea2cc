"""Calibration: small deviations of a model's numbers with which it predicts a log best.

Named causes are what is surely wrong. Beside them, all numbers of a model are slightly wrong: each
mass, damping, friction. None of these errors is a finding, but together they may be most of what
causes leave. With the tolerances s N of a model whose numbers are s times as rough as those of a
good one, the most probable deviations are a ridge regression, in which each number is adjusted in
proportion to its own tolerance and as little as the readings ask for. s is the largest one with
which deviations from the fit split surely predict the selection split better than with those
below, by exact replays.

Where the model is wrong by many noises and the named causes leave much of it, deviations begin at a
joint fit of what a person would free (see `joint_fit`), if that surely predicts better. Which of
its parameters is to blame is not known; together they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from reality_gap.diagnosis import Calibration, Correction
from reality_gap.inference.expansion import suits
from reality_gap.inference.held_out import score
from reality_gap.inference.problem import Problem
from reality_gap.inference.tolerances import Tolerance
from reality_gap.inference.whitening import likeliest_sizes
from reality_gap.simulation.hypothesis import Candidate, Hypothesis, Part, build, has_effects
from reality_gap.simulation.replayer import Expansion, Replayer
from reality_gap.study.splits import FIT, SELECT, split
from reality_gap.types import Bools, Floats

ROUGH = (1.0, 3.0, 10.0, 30.0)
"""Roughnesses s that are tried."""
STEPS = 3
"""Largest number of steps with the same slopes, because effects are not quite linear."""
ENOUGH = 1.0
"""Decrease of the cost from which on another step is taken [nats]."""
SEEN = 0.01
"""Deviations below this are left out [tolerances]."""


class _Fitted(NamedTuple):
    """Deviations in tolerances (p,), and the residual (n,) of their replay."""

    sizes: Floats
    residual: Floats


def calibrate(
    problem: Problem,
    hypothesis: Hypothesis,
    tolerances: Sequence[Tolerance],
    joint: Hypothesis = (),
) -> Calibration | None:
    """Adjust the numbers of a model beside the named causes.

    Args:
        problem: the study and its noise model; tolerances are its first columns.
        hypothesis: the named causes with their values; none for the nominal model.
        tolerances: of the candidates.
        joint: a joint fit with its values; none if there is none.

    Returns:
        The deviations; None if neither they nor the joint fit surely predict the selection split
        better than the named causes alone.
    """
    replayer = problem.replayer
    kept, replayer.expansion = replayer.expansion, Expansion()
    try:
        return _calibrated(problem, hypothesis, tolerances, joint)
    finally:
        replayer.expansion = kept


def _calibrated(
    problem: Problem,
    hypothesis: Hypothesis,
    tolerances: Sequence[Tolerance],
    joint: Hypothesis,
) -> Calibration | None:
    system, measured, role = problem.system, problem.measured, split(problem.measured)
    before = problem.replayer.residual(hypothesis)
    if not np.isfinite(before).all():
        return None
    base, least = hypothesis, before
    if joint:
        left = problem.replayer.residual(joint)
        if score(system.study, measured, before, left, role == SELECT).improvement.low > 0.0:
            base, least = joint, left
    able = _adjustable(problem.replayer, base, tolerances)
    fitter = _Fitter(problem, base, tolerances, able, least)

    rough = 0.0
    for s in ROUGH if able else ():
        after = fitter.fit(s, role == FIT).residual
        if score(system.study, measured, least, after, role == SELECT).improvement.low > 0.0:
            rough, least = s, after
    if rough == 0.0 and base is hypothesis:
        return None
    found = fitter.fit(rough, role <= SELECT) if rough else fitter.none
    scored = score(system.study, measured, before, found.residual)
    parts, sizes = fitter.parts(found.sizes)
    corrections = [
        Correction(tolerances[i].candidate, tolerances[i].parameter, _value(tolerances[i], x), x)
        for i, x in zip(able, sizes, strict=True)
        if abs(x) > SEEN
    ]
    together = base is not hypothesis
    if together:
        corrections += _corrections(base)
    ordered = tuple(sorted(corrections, key=lambda one: -abs(one.tolerances)))
    whole = [*parts, *base]
    effects = tuple(part for part in whole if has_effects(system, *part))
    xml = problem.replayer.plant(whole).spec.to_xml()
    return Calibration(ordered, scored.after, xml, effects, together)


def _corrections(hypothesis: Hypothesis) -> list[Correction]:
    """Return the adjustments of a joint fit; a form has no tolerance, and is none of them."""
    return [
        Correction(candidate, p, values[p.name], (values[p.name] - p.null) / p.tolerance)
        for candidate, values in hypothesis
        for p in candidate.parameters
        if p.tolerance > 0.0 and values[p.name] != p.null
    ]


def _adjustable(
    replayer: Replayer, hypothesis: Hypothesis, tolerances: Sequence[Tolerance]
) -> list[int]:
    """Return the indices of the tolerances of numbers that the model's file has."""
    named = [candidate for candidate, _ in hypothesis]
    return [
        i
        for i, one in enumerate(tolerances)
        if not any(one.candidate.matches(other) for other in named)
        and suits(replayer.system, one)
        and not build(replayer.system, [one.deviation(1.0)]).effects.readings
    ]


def _value(tolerance: Tolerance, size: float) -> float:
    p = tolerance.parameter
    return float(np.clip(p.null + size * tolerance.size, p.low, p.high))


class _Fitter:
    """Infers deviations of p numbers.

    Args:
        problem: the study and its noise model.
        hypothesis: the named causes with their values.
        tolerances: of the candidates.
        able: indices of those that may deviate, p of them.
        before: residual without deviations, shape (n,).
    """

    def __init__(
        self,
        problem: Problem,
        hypothesis: Hypothesis,
        tolerances: Sequence[Tolerance],
        able: Sequence[int],
        before: Floats,
    ) -> None:
        self._problem, self._hypothesis, self._before = problem, hypothesis, before
        self._chosen = [tolerances[i] for i in able]
        columns, others = problem.noise_model.tolerances, len(tolerances)
        self._own = columns[:, list(able)] / problem.roughness
        self._rest = columns[:, others:]

    @property
    def none(self) -> _Fitted:
        """The model without deviations."""
        return _Fitted(np.zeros(len(self._chosen)), self._before)

    def parts(self, sizes: Floats) -> tuple[list[Part], Floats]:
        """Return deviations of these sizes (p,) within their bounds, and those sizes (p,)."""
        values = dict[tuple[str, object], tuple[Candidate, dict[str, float]]]()
        bounded = np.zeros(len(sizes))
        for k, (one, size) in enumerate(zip(self._chosen, sizes, strict=True)):
            value, p = _value(one, float(size)), one.parameter
            key = one.candidate.cause.id, one.candidate.location
            part = values.setdefault(key, (one.candidate, one.candidate.null_values()))
            part[1][p.name] = value
            bounded[k] = (value - p.null) / one.size
        return list(values.values()), bounded

    def fit(self, rough: float, use: Bools) -> _Fitted:
        """Return the most probable deviations of a model of this roughness.

        Args:
            rough: the roughness s.
            use: from which readings to infer them, shape (n,).
        """
        inflation = self._problem.noise_model.inflation
        columns = np.hstack([rough * self._own, self._rest])

        def cost(fitted: _Fitted) -> float:
            misfit = np.sum((fitted.residual**2 / inflation)[use])
            return 0.5 * float(misfit + np.sum((fitted.sizes / rough) ** 2))

        best = self.none
        for _ in range(STEPS):
            linear = best.residual + self._own @ best.sizes
            aim = rough * likeliest_sizes(columns, inflation, use, linear)[: len(best.sizes)]
            parts, sizes = self.parts(aim)
            residual = self._problem.replayer.residual([*parts, *self._hypothesis])
            moved = _Fitted(sizes, residual)
            if not np.isfinite(residual).all() or not cost(moved) < cost(best) - ENOUGH:
                break
            best = moved
        return best

"""Joint search: the causes of a joint fit in place of those that are found one by one."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from reality_gap.inference.forward_selection import Advance, Search, Settings, Step
from reality_gap.inference.gauss_newton import Fit, fit, null_fit, profile, rescore
from reality_gap.inference.joint_fit import USUAL, eliminated, joint_fit
from reality_gap.inference.likelihood import FAR
from reality_gap.inference.problem import Problem
from reality_gap.inference.screening import Sensitivity
from reality_gap.inference.theta import free_parameters

LITTLE = 4.0
"""Mean square that a joint fit leaves at most for a search to begin with it [noise^2]."""


class JointSearch:
    """Joint fits of a log, which depend on no tolerances: the first one is done once.

    Args:
        settings: thresholds.
    """

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._is_done = False
        self._joint: Fit | None = None
        self._chain: list[Fit] = []

    def instead(
        self, plain: Problem, sensitivities: Sequence[Sensitivity], step: Step
    ) -> Advance | None:
        """Return the causes of a joint fit where no single cause explains much, but they do.

        A search for one cause after the other is far longer where there are several large ones,
        and what the first ones imitate stays among its causes.

        Args:
            plain: the problem without inflation.
            sensitivities: of all candidates.
            step: the first step of a search, whose best candidates are fitted.

        Returns:
            None if a single cause leaves few noises, or if a joint fit leaves many.
        """
        first = step.tried[0]
        if mean_square(first) < FAR:
            return None
        if not self._is_done:
            start = next((f for f in step.tried if f.candidates[-1].cause.id in USUAL), None)
            starts = [start.hypothesis if start else []]
            self._joint, self._is_done = joint_fit(plain, sensitivities, starts), True
        if self._joint is None or mean_square(self._joint) > LITTLE:
            return None
        if not self._chain:
            self._chain = eliminated(plain, self._joint, self._settings.weak)
        if mean_square(self._chain[-1]) > LITTLE:
            return None
        found = self._likelier(plain, first, self._chain)
        needed = self._settings.weak * (len(self._chain) - 1) + step.needed
        if found is None or sum(one.gain for one in found.steps) <= needed:
            return None
        begin, *further = found.steps
        last = begin.tried[0].candidates[-1]
        others = (one for one in step.tried if not one.candidates[-1].matches(last))
        alike = tuple(rescore(found.problem, one) for one in (begin.tried[0], *others))
        begin = replace(begin, tried=alike, needed=step.needed)
        return found._replace(steps=(begin, *further))

    def after(self, plain: Problem, result: Search) -> Search:
        """Return a search with a joint fit, whose causes replace its own if they are much likelier.

        There is one where causes leave many noises that tolerances do not explain. Its causes must
        be likelier with tolerances and without them.

        Args:
            plain: the problem without inflation.
            result: a search for causes one by one, or one that begins with those of a joint fit.
        """
        if self._chain:
            result = replace(result, joint=self._chain[-1].hypothesis)
        far = result.problem.noise_model.is_far and mean_square(result.best) > FAR
        if not far or result.stop is not None or not result.steps:
            return result
        singles = [f for f in result.steps[0].tried if f.candidates[-1].cause.id in USUAL]
        start = [*(part for f in singles[:1] for part in f.hypothesis), *result.best.hypothesis]
        starts = [start, *([self._joint.hypothesis] if self._joint else [])]
        joint = joint_fit(plain, result.sensitivities, starts, widely=self._joint is None)
        if joint is None:
            return result
        chain = eliminated(plain, joint, self._settings.weak)
        result = replace(result, joint=chain[-1].hypothesis)
        found = self._likelier(plain, result.best, chain)
        if found is None:
            return result
        problem, steps, best = found
        return replace(result, problem=problem, steps=steps, best=best, together=True)

    def _likelier(self, plain: Problem, best: Fit, chain: Sequence[Fit]) -> Advance | None:
        """Return the causes of a joint fit if they are much likelier than the best others."""
        settings, bare = self._settings, plain.without_tolerances()
        added = max(0, len(chain) - len(best.hypothesis))
        gain = chain[-1].evidence - profile(bare, best).evidence
        if gain <= settings.threshold + settings.weak * added:
            return None
        bases = [profile(bare, null_fit(plain)), *chain]
        problem = plain.inflated(chain[-1].residual)
        steps, base = list[Step](), null_fit(plain)
        for before, fitted in itertools.pairwise(bases):
            more, own = fitted.evidence - before.evidence, extending(base, fitted)
            alike = (rescore(problem, own),)
            steps.append(Step(rescore(problem, base), alike, more, settings.weak))
            base = own
        together = fit(problem, base.hypothesis)
        if together.evidence <= rescore(problem, best).evidence:
            return None
        return Advance(problem, tuple(steps), together)


def extending(base: Fit, fitted: Fit) -> Fit:
    """Return a fit with its causes in the order of the base, and the one that it adds last."""
    old = [
        next(i for i, one in enumerate(fitted.candidates) if one.matches(known))
        for known in base.candidates
    ]
    order = [*old, *(i for i in range(len(fitted.candidates)) if i not in old)]
    owner = np.array([i for i, _ in free_parameters(fitted.hypothesis)])
    columns = np.concatenate([np.flatnonzero(owner == i) for i in order])
    return replace(
        fitted,
        hypothesis=[fitted.hypothesis[i] for i in order],
        jacobian=fitted.jacobian[:, columns],
        theta=fitted.theta[columns],
    )


def mean_square(fitted: Fit) -> float:
    """Return the mean square of what causes leave [noise^2]."""
    return float(np.mean(fitted.residual**2))

"""Joint search: the causes of a joint fit in place of those that were found one by one."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from reality_gap.inference.forward_selection import Search, Settings, Step
from reality_gap.inference.gauss_newton import fit, null_fit, profile, rescore
from reality_gap.inference.joint_fit import USUAL, joint_fit
from reality_gap.inference.likelihood import FAR
from reality_gap.inference.problem import Problem


def with_joint_fit(plain: Problem, result: Search, settings: Settings) -> Search:
    """Return a search with a joint fit, whose causes replace its own if they are much likelier.

    There is one where causes leave many noises, also if these are within tolerances: those explain
    much where wrong causes with many parameters imitate several. Its causes must be likelier with
    tolerances and without them.

    Args:
        plain: the problem without inflation.
        result: a search for causes one by one.
        settings: thresholds.
    """
    if np.mean(result.best.residual**2) < FAR or result.stop is not None or not result.steps:
        return result
    singles = [f for f in result.steps[0].tried if f.candidates[-1].cause.id in USUAL]
    start = [*(part for f in singles[:1] for part in f.hypothesis), *result.best.hypothesis]
    chain = joint_fit(plain, result.sensitivities, start, settings.weak)
    if not chain:
        return result
    result, bare = replace(result, joint=chain[-1].hypothesis), plain.without_tolerances()
    added = max(0, len(chain) - len(result.best.hypothesis))
    gain = chain[-1].evidence - profile(bare, result.best).evidence
    if gain <= settings.threshold + settings.weak * added:
        return result
    steps = [
        Step(base, (fitted,), fitted.evidence - base.evidence, settings.weak)
        for base, fitted in itertools.pairwise([profile(bare, null_fit(plain)), *chain])
    ]
    problem = plain.inflated(chain[-1].residual)
    best = fit(problem, chain[-1].hypothesis)
    if best.evidence <= rescore(problem, result.best).evidence:
        return result
    return replace(result, problem=problem, steps=tuple(steps), best=best, together=True)

"""Joint search: the causes of a joint fit in place of those that were found one by one."""

from __future__ import annotations

import itertools
from dataclasses import replace

from reality_gap.inference.forward_selection import Search, Settings, Step
from reality_gap.inference.gauss_newton import null_fit, profile, rescore
from reality_gap.inference.joint_fit import USUAL, joint_fit
from reality_gap.inference.problem import Problem


def with_joint_fit(plain: Problem, result: Search, settings: Settings) -> Search:
    """Return a search with a joint fit, whose causes replace its own if they are much likelier.

    There is one where the nominal model is wrong by many noises, also if the causes leave few: a
    wrong cause that has many parameters can imitate several.

    Args:
        plain: the problem without inflation.
        result: a search for causes one by one.
        settings: thresholds.
    """
    far = plain.inflated(plain.null_residual).noise_model.is_far
    if not far or result.stop is not None or not result.steps:
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
    best = rescore(problem, chain[-1])
    return replace(result, problem=problem, steps=tuple(steps), best=best, together=True)

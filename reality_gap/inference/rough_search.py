"""Search for causes with tolerances as large as what the causes leave shows; see `roughness`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from reality_gap.inference.deferral import Deferred
from reality_gap.inference.forward_selection import Search, Settings, search
from reality_gap.inference.gauss_newton import Fit
from reality_gap.inference.joint_search import JointSearch, mean_square
from reality_gap.inference.likelihood import independent_noise
from reality_gap.inference.problem import Problem
from reality_gap.inference.roughness import roughness
from reality_gap.inference.screening import Sensitivity
from reality_gap.inference.tolerances import Tolerance
from reality_gap.simulation.replayer import Replayer
from reality_gap.types import Floats

MUCH = 2.0
"""Variance left beside tolerances from which on the first cause may be wrong [noise^2]."""


def search_roughly(
    replayer: Replayer,
    null_residual: Floats,
    tolerances: Sequence[Tolerance],
    columns: Floats,
    sensitivities: Sequence[Sensitivity],
    settings: Settings,
    deferred: Deferred | None = None,
    known: Sequence[Fit] = (),
    handicaps: tuple[float, float] = (0.0, 0.0),
) -> Search:
    """Search for causes, again with larger tolerances as long as these are likelier.

    What a stop leaves beside a cause that it refutes is no deviation, and ends the search. Where
    slopes beside a wrong first cause lead to causes that leave much, and more than those found with
    the slopes of the nominal model, the latter are kept. Where causes that are found one by one
    leave many noises, a joint fit of the usual ones follows; where the first one does, and such a
    fit leaves few, the search begins with it.

    Args:
        replayer: replays hypotheses.
        null_residual: residual of the nominal model, shape (n,).
        tolerances: the tolerances.
        columns: changes by all of these, and by others, shape (n, p).
        sensitivities: of the candidates.
        settings: thresholds.
        deferred: candidates that are screened on demand.
        known: fits of single causes that are tried in any case.
        handicaps: evidence that the first cause needs in addition; see `Problem` [nats].
    """
    rough, joint = 1.0, JointSearch(settings)
    while True:
        noise_model = independent_noise(replayer.measured, rough * columns)
        problem = Problem(replayer, null_residual, noise_model, rough, tolerances, handicaps)
        run = partial(search, problem, sensitivities, settings, deferred)
        result = run(known, joint.instead)
        if result.relinearised and result.problem.noise_model.variance.max() > MUCH:
            fixed = run(result.singles, joint.instead, relinearise=False)
            result = min(result, fixed, key=lambda one: mean_square(one.best))
        inflation = result.problem.noise_model.inflation
        own = result.problem.noise_model.tolerances / rough
        found = roughness(replayer.measured, own, result.best.residual, inflation)
        if found <= rough or result.stop is not None:
            return joint.after(problem, result)
        sensitivities, rough, known = result.sensitivities, found, result.singles

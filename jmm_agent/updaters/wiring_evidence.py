"""Evidence that a muscle is not the one that the nominal model says, from rests alone.

Two muscles may be exchanged, so that each reads and moves the other's path; one may be reversed; or
one may not follow the joints at all, because it is absent or slack. For each hypothesis the rests
are fitted (`jmm_agent.vision.rest_fit`), and the logarithms of the evidence are compared. Exchanged
and reversed muscles are the same rests with other columns of lengths and tensions. The lengths l of
a muscle that does not follow the joints have the density of their own

    l ~ N(f(0), S^2 1 1' + s^2 I),    S = 10 prior.offset,    s = prior.noise times 1 to 100,

in place of that of the fit.

There are some hundreds of hypotheses, so they are first screened with the linearised fit of the
nominal muscles: with its residuals r, Gauss-Newton matrix H and gradient g, a change d of the
lengths of a muscle with covariance C and Jacobian J changes the minimum of the cost by

    d' C^-1 (2 r + d) - (|L^-1 (J' C^-1 d - g)|^2 - |L^-1 g|^2),    H = L L'.

Only the likeliest few are fitted. To be believed, a hypothesis must be better than

* the nominal muscles, with the usual widths of errors and with `WIDE` ones;
* the nominal muscles, where only those concerned have errors `DISPLACED` times as large;
* both with the permanent elongations that were found, of which each costs `EVENT`;
* all other hypotheses: what cannot be told apart is not named;

and no single rest may decide it, because the hand may have been seen where it was not.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple, TypeVar

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, solve_triangular

from jmm_agent.guard.faults import MUSCLE_ABSENT, MUSCLE_REVERSED, MUSCLES_SWAPPED
from jmm_agent.mapping.prior import GroupKernel, MapPrior
from jmm_agent.types import Floats, Ints
from jmm_agent.vision.balance import Balance
from jmm_agent.vision.marker_observation import MarkerObservation, PoseResidual
from jmm_agent.vision.observation_fit import ObservationFitOptions
from jmm_agent.vision.prior_widths import REGULARISATION, PriorWidths
from jmm_agent.vision.rest_fit import Rest, RestProblem, fit_rests

WIDE = 3.0
"""Widths of the errors of a robot that is far from its nominal model, over the usual ones [1]."""
DISPLACED = 5.0
"""Errors of a muscle that is far from its nominal place, over those of the others [1]."""
FREE_OFFSET = 10.0
"""Width of the offset of a muscle that does not follow the joints, over the prior's [1]."""
FREE_NOISES = 1.0, 10.0, 100.0
"""How much such a muscle may move by itself, over the prior's noise [1]."""
EVENT = 5.0
"""Evidence that a permanent elongation costs [nat]: one observation of some hundred shows one."""
STEPS = 12
"""Largest number of steps of a fit."""
FITTED = 3
"""Number of hypotheses that are fitted."""

AnyRest = TypeVar("AnyRest", MarkerObservation, Rest)


class Miswiring(NamedTuple):
    """A muscle, or two, that is not the one of the nominal model.

    Attributes:
        kind: `MUSCLES_SWAPPED`, `MUSCLE_REVERSED` or `MUSCLE_ABSENT`.
        muscles: their indices.
    """

    kind: str
    muscles: tuple[int, ...]


class Suspicion(NamedTuple):
    """A hypothesis that is likelier than the nominal muscles.

    Attributes:
        miswiring: the hypothesis.
        evidence: logarithm of its Bayes factor to the best of the others, but for their number.
        without_one: the least such number with any one rest left out.
    """

    miswiring: Miswiring
    evidence: float
    without_one: float


class RestData(NamedTuple):
    """What was measured at rests.

    Attributes:
        observations: K observations of the hand.
        others: R rests without one.
        elongated: number of permanent elongations of each muscle since each observation (K, m).
    """

    observations: Sequence[MarkerObservation]
    others: Sequence[Rest]
    elongated: Floats

    @property
    def steps(self) -> Floats:
        """Number of permanent elongations of each muscle (m,); zeroings are less than one."""
        moved = np.round(-np.diff(self.elongated, axis=0, append=0.0))
        return np.asarray(np.sum(np.maximum(moved, 0.0), axis=0))

    def never_elongated(self, muscles: tuple[int, ...]) -> RestData:
        """As if some muscles had never been elongated."""
        elongated = self.elongated.copy()
        elongated[:, list(muscles)] = 0.0
        return self._replace(elongated=elongated)

    def without(self, number: int) -> RestData:
        """Without one of the observations."""
        kept = [one for k, one in enumerate(self.observations) if k != number]
        return RestData(kept, self.others, np.delete(self.elongated, number, axis=0))

    def with_wiring(self, found: Miswiring) -> RestData:
        """With the lengths and tensions that the muscles of the nominal model then have."""
        if found.kind == MUSCLE_ABSENT:
            return self.never_elongated(found.muscles)
        count = len(self.observations[0].lengths)
        order, signs = np.arange(count), np.ones(count)
        if found.kind == MUSCLES_SWAPPED:
            order[list(found.muscles)] = found.muscles[::-1]
        else:
            signs[list(found.muscles)] = -1.0
        return RestData(
            [reordered(one, order, signs) for one in self.observations],
            [reordered(one, order, signs) for one in self.others],
            self.never_elongated(found.muscles).elongated,
        )


def reordered(rest: AnyRest, order: Ints, signs: Floats) -> AnyRest:
    """A rest with the lengths and tensions of muscles in another order, and other signs.

    Args:
        rest: the rest.
        order: index of what is now each muscle (m,).
        signs: factors of the lengths (m,): 1 or -1.
    """
    tensions = None if rest.tensions is None else rest.tensions[order]
    return rest._replace(lengths=signs * rest.lengths[order], tensions=tensions)


class WiringEvidence:
    """Compares hypotheses (module docstring).

    Args:
        prior: prior of the map's error.
        usual: widths of the errors of usual robots.
        marker_residual: residual of the marker's pose at a posture.
        limits: lowest and highest angle of each joint (n, 2) [rad].
        options: noise levels and limits of the fit.
        balance: of tensions and loads; None: unknown loads.
    """

    def __init__(
        self,
        prior: MapPrior,
        usual: PriorWidths,
        marker_residual: PoseResidual,
        limits: Floats,
        options: ObservationFitOptions,
        balance: Balance | None,
    ) -> None:
        self._prior, self._usual, self._marker_residual = prior, usual, marker_residual
        self._limits, self._balance = limits, balance
        self._options = replace(options, steps=STEPS)
        self._wide = usual._replace(
            offset=WIDE * usual.offset,
            shape=WIDE * prior.options.zeroed_shape,
            points=WIDE * usual.points,
        )
        self._at_zero = prior.map.lengths(np.zeros(len(limits)))

    def likeliest(self, rests: RestData, least: float) -> Suspicion | None:
        """The likeliest hypothesis; None if nominal muscles are as likely.

        Args:
            rests: what was measured, with at least two observations.
            least: evidence below which nothing is of interest.
        """
        nominal = self._fitted(rests, self._usual)
        screened = self._screened(rests, nominal)[:FITTED]
        if not screened or screened[0][1] < least:
            return None
        found = [(self._best(rests, one, nominal.angles), one) for one, _ in screened]
        found.sort(key=lambda each: -each[0].evidence)
        (best, miswiring), second = found[0], found[1][0].evidence
        displaced = self._fitted(rests, self._usual, nominal.angles, self._displaced(miswiring))
        events = EVENT * float(rests.steps[list(miswiring.muscles)].sum())
        others = max(nominal.evidence - events, displaced.evidence - events, second)
        if best.evidence - others < least:
            return None
        wide = self._fitted(rests, self._wide, displaced.angles)
        evidence = best.evidence - max(others, wide.evidence - events)
        if evidence < least:
            return None
        without = [
            self._without(rests.without(number), miswiring, number, (best, nominal, displaced))
            for number in range(len(rests.observations))
        ]
        return Suspicion(miswiring, evidence, min(without))

    def _without(
        self, kept: RestData, miswiring: Miswiring, number: int, fits: Sequence[_Fitted]
    ) -> float:
        """Evidence without an observation, from fits of hypothesis, nominal and displaced ones."""
        best, nominal, displaced = (np.delete(fit.angles, number, axis=0) for fit in fits)
        factors = self._displaced(miswiring)
        others = (
            self._fitted(kept, self._usual, nominal).evidence,
            self._fitted(kept, self._usual, displaced, factors).evidence,
        )
        events = EVENT * float(kept.steps[list(miswiring.muscles)].sum())
        return self._of(kept, miswiring, best).evidence - max(others) + events

    def _displaced(self, miswiring: Miswiring) -> Floats:
        """Factors (m,) of the errors of muscles that are far from their nominal places."""
        factors = np.ones(len(self._at_zero))
        factors[list(miswiring.muscles)] = DISPLACED
        return factors

    def _best(self, rests: RestData, miswiring: Miswiring, start: Floats) -> _Fitted:
        """Fit of a hypothesis from angles to start from, or from the guesses."""
        near, far = (self._of(rests, miswiring, one) for one in (start, None))
        return max(near, far, key=lambda fit: fit.evidence)

    def _of(self, rests: RestData, miswiring: Miswiring, start: Floats | None) -> _Fitted:
        """Fit of a hypothesis from angles to start from."""
        if miswiring.kind != MUSCLE_ABSENT:
            return self._fitted(rests.with_wiring(miswiring), self._usual, start)
        factors = np.ones(len(self._at_zero))
        factors[list(miswiring.muscles)] = np.inf
        fit = self._fitted(rests.with_wiring(miswiring), self._usual, start, factors)
        free = float(self._free(_lengths(rests))[list(miswiring.muscles)].sum())
        return fit._replace(evidence=fit.evidence + free)

    def _fitted(
        self,
        rests: RestData,
        widths: PriorWidths,
        start: Floats | None = None,
        factors: Floats | None = None,
    ) -> _Fitted:
        """Fit of rests with widths of the errors, from angles (K + R + 1, n) [rad]."""
        observations, others, elongated = rests
        if start is None:
            guesses = [one.guess for one in observations] + [one.guess for one in others]
            start = np.vstack([*guesses, np.zeros(len(self._limits))])
        problem = RestProblem(
            observations,
            others,
            self._prior.with_factors(factors) if factors is not None else self._prior,
            widths,
            self._marker_residual,
            self._balance,
            self._options,
            elongated,
        )
        fit = fit_rests(problem, start, self._limits, self._options, len(observations), None)
        return _Fitted(problem, fit.unknown, problem.log_evidence(fit.unknown))

    def _screened(self, rests: RestData, nominal: _Fitted) -> list[tuple[Miswiring, float]]:
        """All hypotheses with their gain of evidence by the linearised fit, the largest first."""
        lengths = _lengths(rests)
        linear = _Linear(nominal, lengths)
        found = [*linear.exchanged(), *linear.reversed()]
        free = self._free(lengths)
        found += [
            (Miswiring(MUSCLE_ABSENT, (muscle,)), gain + free[muscle])
            for muscle, gain in linear.left_out()
        ]
        steps = rests.steps
        found = [(one, gain + EVENT * steps[list(one.muscles)].sum()) for one, gain in found]
        return sorted(found, key=lambda each: -each[1])

    def _free(self, lengths: Floats) -> Floats:
        """Logarithm of the density of lengths that do not follow the joints (m,)."""
        options, count = self._prior.options, len(lengths)
        missed = lengths - self._at_zero
        offset = (FREE_OFFSET * options.offset) ** 2 * np.ones((count, count))
        found = []
        for share in FREE_NOISES:
            covariance = offset + (share * options.noise) ** 2 * np.eye(count)
            white = np.linalg.solve(covariance, missed)
            log_det = np.linalg.slogdet(covariance)[1]
            found.append(-0.5 * (np.sum(missed * white, axis=0) + log_det))
        return np.asarray(np.logaddexp.reduce(found, axis=0) - np.log(len(found)))


class _Fitted(NamedTuple):
    """A fit: its problem, all angles (K + R + 1, n) [rad], and the logarithm of its evidence."""

    problem: RestProblem
    angles: Floats
    evidence: float


class _Linear:
    """Gains of evidence by the linearised fit of the nominal muscles.

    Args:
        nominal: the fit.
        lengths: measured at its rests (K, m) [m].
    """

    def __init__(self, nominal: _Fitted, lengths: Floats) -> None:
        fit = nominal.problem.linearised(nominal.angles)
        self._fit, self._lengths = fit, lengths
        self._matrix = fit.matrix.copy()
        self._matrix[np.diag_indices_from(self._matrix)] *= 1.0 + REGULARISATION
        self._lower = np.tril(cho_factor(self._matrix, lower=True)[0])
        gradient = nominal.problem.normal_equations(nominal.angles)[1]
        self._pull = solve_triangular(self._lower, -gradient, lower=True)
        self._kernels: dict[int, GroupKernel] = {}
        for kernel in fit.kernels:
            self._kernels |= dict.fromkeys(kernel.muscles.tolist(), kernel)

    def exchanged(self) -> Iterator[tuple[Miswiring, float]]:
        """Of each pair of muscles."""
        changes = {
            muscle: self._change(muscle, self._lengths - self._lengths[:, [muscle]])
            for muscle in self._kernels
        }
        for first, (cost, pulls) in changes.items():
            for second in changes:
                if second <= first:
                    continue
                other_cost, other_pulls = changes[second]
                both = cost[second] + other_cost[first]
                gain = self._gain(both, pulls[:, second] + other_pulls[:, first])
                yield Miswiring(MUSCLES_SWAPPED, (first, second)), gain

    def reversed(self) -> Iterator[tuple[Miswiring, float]]:
        """Of each muscle with the other sign."""
        for muscle in self._kernels:
            cost, pulls = self._change(muscle, -2.0 * self._lengths[:, [muscle]])
            yield Miswiring(MUSCLE_REVERSED, (muscle,)), self._gain(cost[0], pulls[:, 0])

    def left_out(self) -> Iterator[tuple[int, float]]:
        """Of each muscle without its lengths."""
        base = 2.0 * float(np.log(np.diag(self._lower)).sum())
        gradient = self._lower @ self._pull
        for muscle, kernel in self._kernels.items():
            missed, rows = self._fit.missed[:, muscle], self._fit.rows
            white = kernel.whiten(missed)
            arms = self._fit.arms[:, muscle]
            own = np.einsum("kl,ki,lj->kilj", rows.T @ kernel.whiten(rows), arms, arms)
            matrix = self._matrix - own.reshape(self._matrix.shape)
            pull = gradient - ((rows.T @ white)[:, None] * arms).ravel()
            try:
                lower = np.tril(cho_factor(matrix, lower=True)[0])
            except LinAlgError:
                continue  # without it some posture would be unknown
            solved = solve_triangular(lower, pull, lower=True)
            cost = -float(missed @ white) - float(solved @ solved - self._pull @ self._pull)
            log_det = 2.0 * float(np.log(np.diag(lower)).sum()) - base - kernel.log_det
            yield muscle, -0.5 * (cost + log_det)

    def _change(self, muscle: int, change: Floats) -> tuple[Floats, Floats]:
        """Direct change of cost (c,), and L^-1 J' C^-1 d, for changes d (K, c) [m] of lengths."""
        kernel, fit = self._kernels[muscle], self._fit
        white = kernel.whiten(change)
        cost = np.sum(change * white, axis=0) + 2.0 * fit.missed[:, muscle] @ white
        pulled = (fit.rows.T @ white)[:, None, :] * fit.arms[:, muscle, :, None]
        pulls = solve_triangular(
            self._lower, pulled.reshape(len(self._lower), -1), lower=True, check_finite=False
        )
        return cost, pulls

    def _gain(self, cost: float, pull: Floats) -> float:
        moved = self._pull + pull
        return -0.5 * float(cost - (moved @ moved - self._pull @ self._pull))


def _lengths(rests: RestData) -> Floats:
    """Measured lengths (K, m) [m]."""
    seen = [one.lengths for one in rests.observations]
    return np.array(seen + [one.lengths for one in rests.others])

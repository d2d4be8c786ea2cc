"""Next look: the posture at which a look at the hand is expected to tell most of the robot.

Of candidates the one is chosen after which the error of the hand, over the postures by which
updates are judged, is expected to be smallest: `jmm_agent.vision.observation_gain`, times the
probability that the hand is seen, and that no joint rests at its stop, where the balance does not
tell of it. The arm comes to rest elsewhere than commanded while its map is wrong, so these
probabilities are taken over where it may be, by the present uncertainty. Candidates that a joint
limit or the muscles forbid, that need a faster movement than is allowed, or that are as near to the
last learned posture as nothing is learned from, are left out.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import norm

from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import MotorControl
from jmm_agent.next_posture import (
    NextPosture,
    PlannerModel,
    PlannerState,
    checked_candidates,
    some_of,
)
from jmm_agent.statics import Statics, not_reachable
from jmm_agent.tension_distribution import TensionDistribution, not_balanced
from jmm_agent.types import Bools, Floats
from jmm_agent.vision.hand_error import HandPostures, followed
from jmm_agent.vision.map_posterior import MapPosterior
from jmm_agent.vision.observation_gain import ObservationGain, information, observation_gains

SAMPLES = 24
"""Number of postures by which it is estimated how probably the hand is seen."""
LIKELY = 0.5
"""Least probability with which the hand is expected in view [1]."""
PEAK = 1.5
"""Largest speed of a movement over its mean speed [1]."""
POINTS = 8
"""Number of parts of a movement by which its speed is found."""
TOO_NEAR = "too close to the last posture that was learned from"
BEYOND = "beyond a joint limit"
TOO_FAST = "not reached slowly enough in the time that is given"
NOT_HELD = "cannot be held by the muscles"
NOT_IN_VIEW = "the hand is not expected in view"


class PosturePlanner:
    """Chooses where to look next.

    It shares nothing with the agent that changes, so `choose` may run in another thread.

    Args:
        model: of the robot and its camera.
        state: of the agent.
        held: why the muscles cannot hold a posture (n,) [rad]; empty if they can.
    """

    def __init__(
        self, model: PlannerModel, state: PlannerState, held: Callable[[Floats], str]
    ) -> None:
        self._model, self._state, self._held = model, state, held

    def choose(self, candidates: ArrayLike | None = None, within: float = np.inf) -> NextPosture:
        """The posture at which a look is expected to tell most; see `Agent.next_posture`.

        Args:
            candidates: joint angles (C, n) [rad]; some typical postures if left out.
            within: time that a movement may take [s].

        Raises:
            AgentError: the candidates are not finite angles of all joints, or none of them can be
                visited, or each observation is fitted alone.
        """
        model, state = self._model, self._state
        if not model.forecast.enabled:
            raise AgentError(
                "Agent: the next look cannot be chosen with VisionOptions(fit='alone'), which has "
                "no posterior; use another fit."
            )
        if candidates is None:
            return self._chosen(some_of(model.typical, len(state.memory.observations)), within)
        return self._chosen(checked_candidates(candidates, model.kinematics.joints), within)

    def _chosen(self, candidates: Floats, within: float) -> NextPosture:
        durations = np.array([self._duration(q) for q in candidates])
        left_out: dict[str, int] = {}
        free = self._checked(candidates, durations, within, left_out)
        some = candidates[free]
        if len(some):
            posterior = self._model.forecast.posterior(self._state.memory).lengths
            gain = self._gains(posterior, some)
            reached = self._reached(posterior, some)
            in_view = self._in_view(reached, gain.angles)
            whole = self._whole(reached, gain.angles)
            found = self._best(some, gain, in_view, whole, left_out)
            if found is not None:
                return self._named(some, gain, in_view, durations[free], found, left_out)
        reasons = "; ".join(f"{reason} ({count})" for reason, count in left_out.items())
        raise AgentError(
            f"None of {len(candidates)} postures can be visited for a look: {reasons}."
        )

    def _judged(self) -> HandPostures:
        """Postures at which the hand's error counts."""
        judged = self._model.forecast.judged
        if judged is None:
            raise AgentError("Agent: no postures are known at which the hand's error counts.")
        return judged

    def _checked(
        self, candidates: Floats, durations: Floats, within: float, left_out: dict[str, int]
    ) -> Bools:
        """Which candidates (C,) the joints allow; others are counted."""
        low, high = self._model.kinematics.limits.T
        state, free = self._state, np.ones(len(candidates), dtype=bool)
        near = np.zeros(len(candidates), dtype=bool)
        if len(state.memory.angles):
            last = state.memory.angles[-1]
            near = np.linalg.norm(candidates - last, axis=1) < state.distance
        beyond = np.any((candidates < low) | (candidates > high), axis=1)
        wrong = {BEYOND: beyond, TOO_NEAR: near, TOO_FAST: durations > within}
        for reason, which in wrong.items():
            if count := int(np.sum(free & which)):
                left_out[reason] = count
            free &= ~which
        return free

    def _best(
        self,
        some: Floats,
        gain: ObservationGain,
        in_view: Floats,
        whole: Floats,
        left_out: dict[str, int],
    ) -> int | None:
        """Number of the best candidate that the muscles hold; None if they hold none."""
        gained = in_view * whole * (gain.before**2 - gain.after**2)
        likely = in_view >= LIKELY
        order = np.lexsort((-gained, ~likely))
        if not likely.all():
            left_out[NOT_IN_VIEW] = int(np.sum(~likely))
        for number in order:
            if not self._held(some[number]):
                return int(number)
            left_out[NOT_HELD] = left_out.get(NOT_HELD, 0) + 1
        return None

    def _named(
        self,
        some: Floats,
        gain: ObservationGain,
        in_view: Floats,
        durations: Floats,
        best: int,
        left_out: dict[str, int],
    ) -> NextPosture:
        before, after = gain.before, float(gain.after[best])
        reason = (
            f"of {len(some)} postures a look at this one is expected to lower the hand's error "
            f"most, from {1e3 * before:.3g} mm to {1e3 * after:.3g} mm"
        )
        if self._model.shows is not None:
            reason += f"; the hand is seen with a probability of {in_view[best]:.0%}"
        if in_view[best] < LIKELY:
            reason += ", and of no posture that can be held with a higher one than one half"
        numbers = float(durations[best]), float(in_view[best]), before, after
        return NextPosture(
            some[best].copy(), *numbers, left_out, f"{reason[0].upper()}{reason[1:]}."
        )

    def _gains(self, posterior: MapPosterior, some: Floats) -> ObservationGain:
        """What looks at candidates are expected to tell."""
        model = self._model
        prior, judged = model.forecast.prior, self._judged()
        noise = prior.options.noise
        hand, eye = model.frames
        position, rotation = model.noise.position_noise, model.noise.rotation_noise
        weight = np.repeat([position**-2, rotation**-2], 3)
        shown = []
        for q, arms in zip(some, prior.map.jacobian(some), strict=True):
            moves = model.kinematics.frame_jacobian(hand, q, relative_to=eye)
            shown.append(information(arms, moves.T @ (weight[:, None] * moves), noise))
        rows = judged.rows(prior.map, noise)
        follows = followed(prior.map, some, noise, judged.widest)
        return observation_gains(posterior, judged, rows, some, np.array(shown), follows)

    def _reached(self, posterior: MapPosterior, some: Floats) -> Floats:
        """Most probable joint angles (C, n) [rad] to which commands of candidates lead."""
        model, state = self._model, self._state
        prior, widest = model.forecast.prior, self._judged().widest
        off = state.map.lengths(some) - posterior.lengths(some)
        follows = followed(prior.map, some, prior.options.noise, widest)
        return some + np.einsum("cnm,cm->cn", follows, off)

    def _in_view(self, reached: Floats, covariances: Floats) -> Floats:
        """Probability (C,) [1] that the hand is seen at rests with these covariances."""
        shows, (hand, eye) = self._model.shows, self._model.frames
        if shows is None or eye is None:
            return np.ones(len(reached))
        kinematics, found = self._model.kinematics, np.empty(len(reached))
        low, high = kinematics.limits.T
        normal = np.random.default_rng(0).standard_normal((SAMPLES, reached.shape[1]))
        for number, (q, covariance) in enumerate(zip(reached, covariances, strict=True)):
            values, axes = np.linalg.eigh(covariance)
            spread = axes * np.sqrt(np.maximum(values, 0.0))
            angles = np.clip(q + normal @ spread.T, low, high)
            poses = [kinematics.pose(hand, one, relative_to=eye) for one in angles]
            found[number] = np.mean([shows(pose) for pose in poses])
        return found

    def _whole(self, reached: Floats, covariances: Floats) -> Floats:
        """Probability (C,) [1] that no joint comes to rest at its stop, each taken alone."""
        margin, limits = self._state.stop_margin, self._model.kinematics.limits
        spread = np.sqrt(np.maximum(np.diagonal(covariances, axis1=1, axis2=2), 1e-12))
        below = norm.cdf((limits[:, 1] - margin - reached) / spread)
        above = norm.cdf((limits[:, 0] + margin - reached) / spread)
        return np.asarray(np.prod(np.maximum(below - above, 0.0), axis=1))

    def _duration(self, q: Floats) -> float:
        """Least time of a movement to a posture (n,) [rad] within the commands' limits [s]."""
        state = self._state
        shares = np.linspace(0.0, 1.0, POINTS + 1)[:, None]
        lengths = state.map.lengths(state.here + shares * (q - state.here))
        steepest = POINTS * np.abs(np.diff(lengths, axis=0)).max(axis=0)
        return float(PEAK * np.max(steepest / state.limits.rate))


def planner_apart(
    model: PlannerModel,
    statics: Statics | None,
    tensions: TensionDistribution | None,
    motors: MotorControl | None,
    state: PlannerState,
) -> PosturePlanner:
    """Planner with copies of all that two threads must not share.

    Args:
        model: of the robot and its camera.
        statics: of the nominal model; None if unknown.
        tensions: that hold postures; None if loads are unknown.
        motors: gains and limit; None if unknown.
        state: of the agent.
    """
    shared = model.forecast.prior, model.typical, state.map
    memo: dict[int, Any] = {id(part): part for part in shared}
    model, statics, tensions = deepcopy((model, statics, tensions), memo)

    def held(q: Floats) -> str:
        missed = "" if statics is None else not_reachable([statics.hold(q)])
        if missed or tensions is None or motors is None:
            return missed
        pull = tensions.at(state.map, motors, q)
        return not_balanced([pull], state.map.joints, motors)

    return PosturePlanner(model, state, held)

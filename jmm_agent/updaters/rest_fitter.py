"""What rests tell of the robot: the posture at which its lengths were zeroed, and prior widths."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jmm_agent.mapping.prior import MapPrior
from jmm_agent.types import Floats
from jmm_agent.updaters.vision_options import VisionOptions
from jmm_agent.updaters.wiring_evidence import WiringEvidence
from jmm_agent.vision.balance import Balance, Loads
from jmm_agent.vision.camera_unknowns import (
    NOT_UNKNOWN,
    UNKNOWNS,
    camera_of,
    corrected_observations,
)
from jmm_agent.vision.length_drift import LengthDrift
from jmm_agent.vision.observation_fit import MarkerObservation, ObservationFit, PoseResidual
from jmm_agent.vision.permanent_elongation import log_bayes_factors, with_likeliest_step
from jmm_agent.vision.pose_errors import SIZES, JointPrior, is_of_joints
from jmm_agent.vision.prior_widths import PriorWidths, usual_widths
from jmm_agent.vision.rest_fit import CommonErrors, Rest, RestFit, RestProblem, fit_rests

SAME_WIDTH = 0.2
"""Logarithm of the ratio of two widths of the prior within which they are the same [1]."""
MOST_FOR_WIDTHS = 30
"""Number of rests from which on the widths of the prior are known, and not estimated again."""
WIDTH_STEPS = 4
"""Largest number of fits with other widths of the prior."""
MOST_FOR_ZERO = 10
"""Number of rests up to which it is asked whether the lengths were zeroed exactly."""
EXACT_ZERO = 0.15
"""Width of the zero posture of a robot that was zeroed exactly, as a share of the usual one [1]."""
SMALL_ERRORS = 0.4
"""All widths of a robot that has small errors, as a share of the usual ones [1]."""
ZERO_EVIDENCE = 3.0
"""Least logarithm of the Bayes factor for lengths that were zeroed exactly."""
BALANCED = 0.2, 3.0
"""Ratio of loads and torques of tensions between which tensions are believed. Over 18 actual robots
(seeds 0 to 17) it was between 0.44 and 1.03 at the first rest, and 0.65 and 1.16 later; with
tensions ten times too large between 0.06 and 0.11, ten times too small 3.8 or more [1]."""
CERTAIN = 3
"""Number of rests from which on it is said that tensions are not believed."""
KNOWN_ZERO = 1e-6
"""Standard deviation of a zero posture that is not estimated [rad]."""
SAME_CAMERA = 0.1
"""Change of the camera's errors, in standard deviations of their prior, within which they are the
same [1]."""
SAME_REST = 5.0
"""Noises of a pair's lengths within which two rests are the same."""


class RestMemory(NamedTuple):
    """What is known from rests.

    Attributes:
        zero: posture at which the lengths were zeroed (n,) [rad]; None while it is unknown.
        widths: of the prior of the map's error; None: those of the options.
        rests: newest rests without an observation.
        unbalanced: loads over the torques of the tensions, if they are so far from each other that
            no tension is believed; None if they are not.
        camera: errors of the camera (8,) [m, rad, 1, 1], see `camera_unknowns`; None while they are
            unknown.
        drift: of all lengths, and the ages of the observations.
        joints: how far the joints of the drawing are off; None: as the options say.
    """

    zero: Floats | None = None
    widths: PriorWidths | None = None
    rests: tuple[Rest, ...] = ()
    unbalanced: float | None = None
    camera: Floats | None = None
    drift: LengthDrift = LengthDrift()
    joints: JointPrior | None = None


class FittedRests(NamedTuple):
    """Result of a fit.

    Attributes:
        observed: joint angles of the observations.
        elongated: number of permanent elongations of each muscle since each observation (K, m).
        memory: what is then known from all rests.
    """

    observed: ObservationFit
    elongated: Floats
    memory: RestMemory


class RestFitter:
    """Fits observations together with other rests; see `jmm_agent.vision.rest_fit`.

    Args:
        prior: prior of the map's error.
        marker_residual: residual of the marker's pose at a posture.
        limits: lowest and highest angle of each joint (n, 2) [rad].
        options: of the Vision Updater.
        loads: torques that the nominal model needs to hold a posture; None if unknown.

    Attributes:
        nominal: prior as given.
    """

    def __init__(
        self,
        prior: MapPrior,
        marker_residual: PoseResidual,
        limits: Floats,
        options: VisionOptions,
        loads: Loads | None,
    ) -> None:
        self.nominal, self._marker_residual = prior, marker_residual
        self._limits, self._options = limits, options
        self._camera = options.camera if camera_of(marker_residual) else NOT_UNKNOWN
        self._usual = usual_widths(prior)
        self._balance = (
            None if loads is None else Balance(prior.map, loads, limits, options.balance)
        )

    def leave_out(self, factors: Floats | None) -> None:
        """Leave muscles out of all further fits; see `MapPrior.factors`."""
        self.nominal = self.nominal.with_factors(factors)

    def wiring_evidence(self, prior: MapPrior) -> WiringEvidence:
        """Comparison of wirings, with a prior of the nominal model's errors."""
        residual, options = self._marker_residual, self._options.observations
        return WiringEvidence(prior, self._usual, residual, self._limits, options, self._balance)

    @property
    def enabled(self) -> bool:
        """Whether rests are fitted."""
        return self._options.fit == "rests" and self._usual.zero > 0.0

    def prior(self, memory: RestMemory) -> MapPrior:
        """Prior of the map's error, given what is known from rests."""
        if memory.zero is None:
            return self.nominal
        widths = memory.widths or self._usual
        return self.nominal.zeroed(memory.zero, widths.offset, widths.shape, widths.points)

    def drifting_prior(self, memory: RestMemory) -> MapPrior:
        """As `prior`, at the postures of the observations, since which lengths have drifted."""
        return self.prior(memory).with_drift(memory.drift.covariance)

    def remembered(self, memory: RestMemory, rest: Rest) -> RestMemory:
        """What is remembered with one rest more, unless it is the last one again.

        None is while lengths drift, because its lengths are soon those of before.
        """
        lasts = self.enabled and self._balance is not None and memory.drift.speed == 0.0
        most = self._options.balance.rests if lasts else 0
        whole = not np.isinf(rest.lengths).any() and np.isfinite(rest.tensions).all()
        if (
            most < 1
            or not whole
            or (memory.rests and self._is_same(rest.lengths, memory.rests[-1].lengths))
        ):
            return memory
        return memory._replace(rests=(*memory.rests, rest)[-most:])

    def shows_zero(self, memory: RestMemory) -> bool:
        """Whether there are enough rests to estimate the zero posture without an observation."""
        return 0 < self._options.balance.blind <= len(memory.rests)

    def fit(
        self,
        memory: RestMemory,
        observations: Sequence[MarkerObservation],
        start: Floats,
        elongated: Floats,
        learn_widths: bool = True,
    ) -> FittedRests:
        """Fit all rests and the zero posture, with the widths that then are likeliest.

        Few rests may be explained by a zero posture that is far from the model's as well as by a
        shape that is wrong, so the first rests decide whether the lengths were zeroed exactly: if
        the evidence is clear, and it is not only that all errors are smaller than usual. Tensions
        are left out if they cannot be those of the loads, as in another unit, or if both are too
        small to tell.

        Args:
            memory: what was known before.
            observations: K observations.
            start: their angles (K, n) [rad] to start from.
            elongated: number of permanent elongations of each muscle since each (K, m).
            learn_widths: if False, the widths of before are kept.
        """
        steps = WIDTH_STEPS if learn_widths else 0
        found, scale = self._fit(memory, observations, start, elongated, self._balance, steps)
        low, high = BALANCED
        if self._balance is None or low <= scale <= high:
            return found
        found, _ = self._fit(memory, observations, start, elongated, None, steps)
        few = len(observations) + len(memory.rests) < CERTAIN
        wrong = None if few or np.isnan(scale) else scale
        return found._replace(memory=found.memory._replace(unbalanced=wrong))

    def _usual_widths(
        self,
        memory: RestMemory,
        observations: Sequence[MarkerObservation],
        start: Floats,
        elongated: Floats,
        balance: Balance | None,
    ) -> PriorWidths:
        """Widths of robots like this one: the options', or those of robots zeroed exactly."""
        usual, rests = self._usual, memory.rests
        exact = usual._replace(zero=EXACT_ZERO * usual.zero)
        known = memory.widths or usual
        if len(start) + len(rests) > MOST_FOR_ZERO:
            return exact if known.zero < np.sqrt(usual.zero * exact.zero) else usual
        unknown = np.vstack(
            [start, *(rest.guess[None] for rest in rests), 0.0 * self._limits[:, 0]]
        )

        def evidence(widths: PriorWidths) -> float:
            problem = self._problem(memory, observations, elongated, balance, widths, start)
            options = self._options.observations
            fit = fit_rests(problem, unknown, self._limits, options, len(start), None)
            return problem.log_evidence(fit.unknown)

        small = PriorWidths(*(SMALL_ERRORS * np.array(usual)).tolist())
        others = evidence(usual) + ZERO_EVIDENCE, evidence(small)
        bent = exact._replace(shape=2.0 * exact.shape)
        return exact if max(evidence(exact), evidence(bent)) > max(others) else usual

    def problem(
        self,
        memory: RestMemory,
        observations: Sequence[MarkerObservation],
        start: Floats,
        elongated: Floats,
    ) -> RestProblem:
        """Cost of all rests, with the widths, the balance and the camera that are believed.

        Without the fit of rests the zero posture is taken as known, and tensions are left out, as
        in the fit of observations and lengths only. See `fit` for the arguments.
        """
        balance, widths = self._balance, memory.widths or self._usual
        if not self.enabled:
            known = self.nominal.options
            widths = PriorWidths(known.offset, known.shape, KNOWN_ZERO, known.points)
        if not self.enabled or memory.unbalanced is not None:
            balance = None
        return self._problem(memory, observations, elongated, balance, widths, start)

    def unknown(self, memory: RestMemory, angles: Floats) -> Floats:
        """Angles of all rests and the zero posture (K + R + 1, n) [rad], as `RestProblem` has them.

        Args:
            memory: what is known from rests.
            angles: joint angles of the observations (K, n) [rad].
        """
        zero = np.zeros(len(self._limits)) if memory.zero is None else memory.zero
        return np.vstack([angles, *(rest.guess[None] for rest in memory.rests), zero])

    def near_joints(self, memory: RestMemory) -> list[JointPrior]:
        """Errors of the joints that are compared after an observation beside the present ones."""
        if not is_of_joints(self._marker_residual):
            return []
        compared = [self._options.misplaced.times(factor) for factor in SIZES]
        return [one for one in compared if one != self._joints(memory)]

    def without(self, memory: RestMemory, lengths: Floats) -> RestMemory:
        """What is known without the rest that has some lengths (m,) [m]."""
        rests = tuple(rest for rest in memory.rests if not self._is_same(rest.lengths, lengths))
        return memory._replace(rests=rests)

    def _problem(
        self,
        memory: RestMemory,
        observations: Sequence[MarkerObservation],
        elongated: Floats,
        balance: Balance | None,
        widths: PriorWidths,
        start: Floats,
    ) -> RestProblem:
        return RestProblem(
            observations,
            memory.rests,
            self.nominal.with_drift(memory.drift.covariance),
            widths,
            self._marker_residual,
            balance,
            self._options.observations,
            elongated,
            self._common(memory, start),
        )

    def _joints(self, memory: RestMemory) -> JointPrior:
        """How far the joints of the drawing are believed to be off."""
        return self._options.joints if memory.joints is None else memory.joints

    def _common(self, memory: RestMemory, start: Floats) -> CommonErrors | None:
        """Errors that all poses share, at angles (K, n) [rad]; None if there can be none."""
        camera, joints = self._camera, self._joints(memory)
        if not (camera.enabled or joints.enabled):
            return None
        known = np.zeros(UNKNOWNS) if memory.camera is None else memory.camera
        return CommonErrors(camera, joints, known, start)

    def _fit(
        self,
        memory: RestMemory,
        observations: Sequence[MarkerObservation],
        start: Floats,
        elongated: Floats,
        balance: Balance | None,
        steps: int,
    ) -> tuple[FittedRests, float]:
        """Fit with a balance or without, and loads over the torques of the tensions.

        With ``steps`` above 0 the widths are learned, in at most so many fits.
        """
        zero = np.zeros(len(self._limits)) if memory.zero is None else memory.zero
        angles, options = start, self._options.observations
        usual, widths = self._usual, memory.widths or self._usual
        if steps:
            usual = self._usual_widths(memory, observations, start, elongated, balance)
            same_kind = abs(np.log(widths.zero / usual.zero)) < abs(np.log(EXACT_ZERO)) / 2.0
            widths = widths if same_kind else usual
        for _ in range(max(1, steps)):
            problem = self._problem(memory, observations, elongated, balance, widths, angles)
            begin = self.unknown(memory._replace(zero=zero), angles)
            known = steps == 0 or self._widths_are_known(len(begin) - 1)
            wanted = None if known else usual
            found = fit_rests(problem, begin, self._limits, options, len(angles), wanted)
            angles, zero = found.observed.angles, found.zero
            pairs = zip(memory.rests, found.rests, strict=True)
            rests = tuple(rest._replace(guess=guess) for rest, guess in pairs)
            change = np.log(np.array(found.widths) / widths)
            same = np.abs(change).max() < SAME_WIDTH and self._same_camera(memory, found)
            widths, memory = (
                found.widths,
                memory._replace(
                    zero=zero,
                    widths=found.widths,
                    rests=rests,
                    unbalanced=None,
                    camera=found.camera,
                ),
            )
            if same:
                break
        return FittedRests(found.observed, elongated, memory), found.scale

    def fit_with_elongation(
        self,
        memory: RestMemory,
        observations: Sequence[MarkerObservation],
        start: Floats,
        elongated: Floats,
    ) -> FittedRests:
        """Fit all rests, and find which muscles were elongated among the newest observations.

        Rests from before an elongation are forgotten; so is a rest that the newest observation is
        of. See `fit` for the arguments, of which the last is as believed so far.
        """
        options = self._options.observations
        recent = min(options.elongation_recent, len(observations) - 1)
        memory = self.without(memory, observations[-1].lengths)
        if recent < 1 or options.elongation_evidence == np.inf:
            return self.fit(memory, observations, start, elongated)
        found = self.fit(memory, observations, start, elongated, learn_widths=False)
        frame = camera_of(self._marker_residual)
        for _ in range(elongated.shape[1]):
            evidence = log_bayes_factors(
                corrected_observations(observations, found.memory.camera, frame),
                self.drifting_prior(found.memory),
                self._marker_residual,
                options,
                found.observed.angles,
                found.elongated,
                recent,
            )
            more = with_likeliest_step(evidence, found.elongated, options.elongation_evidence)
            if more is None:
                break
            memory = found.memory._replace(rests=())
            found = self.fit(memory, observations, found.observed.angles, more, learn_widths=False)
        if self._widths_are_known(len(observations) + len(found.memory.rests)):
            return found
        return self.fit(found.memory, observations, found.observed.angles, found.elongated)

    def _same_camera(self, memory: RestMemory, found: RestFit) -> bool:
        """Whether a fit moved the camera's errors so little that it need not be repeated."""
        if found.camera is None:
            return True
        moved = found.camera if memory.camera is None else found.camera - memory.camera
        most = SAME_CAMERA * self._camera.widths
        return bool(np.all(np.abs(moved) <= most))

    @staticmethod
    def _widths_are_known(rests: int) -> bool:
        """Whether so many rests were fitted that the widths are not estimated again."""
        return rests >= MOST_FOR_WIDTHS

    def _is_same(self, one: Floats, other: Floats) -> bool:
        """Whether two rests have the same lengths (m,) [m] but for noise, where both are known."""
        apart = np.nan_to_num(np.abs(one - other), nan=0.0)
        return bool(apart.max() <= SAME_REST * self._options.noise)

"""Vision Updater: learns (theta_ik, l_target), theta_ik from the marker on the hand (sec. III-C).

Under stiffness control a muscle with l < l_target does not pull, and follows any command that is
long enough, so that its l_target holds no information. The tightest command that causes the
measured tensions is min(l, l_target), muscle by muscle. It is the default here; the paper's
l_target is an option.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from jmm_agent.mapping.learner import Learner, Pairs
from jmm_agent.mapping.prior import MapPrior
from jmm_agent.types import Floats
from jmm_agent.vision.hold_out import HoldOut, HoldOutOptions
from jmm_agent.vision.observation_fit import (
    MarkerObservation,
    ObservationFit,
    ObservationFitOptions,
    PoseResidual,
    fit_alone,
)
from jmm_agent.vision.permanent_elongation import elongations, fit_with_elongation

PairLengths = Literal["min", "l_target", "l"]
"""Lengths of a pair, see `VisionOptions`."""


@dataclass(frozen=True)
class VisionOptions:
    """Options of the Vision Updater (sec. III-C).

    Attributes:
        distance: least distance from the posture of the last update, L2 norm [rad].
        threshold: C, the largest ||theta_ik - theta_est||_2 that is believed [rad].
        lengths: lengths of a pair: l_target as in the paper, l, or min(l, l_target).
        noise: standard deviation of a pair's lengths [m].
        saturation: a pair with a tension above this is not learned [N].
        stop_margin: a pair with a joint this close to its stop is not learned [rad].
        position_residual: an observation that the fit misses by more than this distance is dropped
            [m].
        rotation_residual: an observation that the fit misses by more than this angle is dropped
            [rad].
        fit: whether observations are fitted together with the muscle lengths, or each alone as in
            the paper.
        observations: options of the fit.
        hold_out: which observations are held out, to undo updates that make the map worse; None:
            none.
    """

    distance: float = 0.15
    threshold: float = 2.0
    lengths: PairLengths = "min"
    noise: float = 0.001
    saturation: float = 450.0
    stop_margin: float = 0.005
    position_residual: float = 0.02
    rotation_residual: float = 0.06
    fit: Literal["together", "alone"] = "together"
    observations: ObservationFitOptions = field(default_factory=ObservationFitOptions)
    hold_out: HoldOutOptions | None = None


class VisionMemory(NamedTuple):
    """What the Vision Updater remembers of K marker observations, the newest last.

    Attributes:
        observations: the observations.
        commands: lengths that were commanded (m,) [m], for each.
        sound: whether no muscle was saturated, for each.
        angles: fitted joint angles (K, n) [rad].
        elongated: number of permanent elongations of each muscle since each observation (K, m).
        pairs: the pairs that they make.
    """

    observations: list[MarkerObservation]
    commands: list[Floats]
    sound: list[bool]
    angles: Floats
    elongated: Floats
    pairs: Pairs


class Seen(NamedTuple):
    """Result of one marker observation.

    Attributes:
        angles: joint angles by vision (n,) [rad], theta_ik.
        error: theta_est - theta_ik (n,) [rad], the paper's joint error.
        learned: whether the map was moved.
        reason: why it was not moved; empty if it was.
    """

    angles: Floats
    error: Floats
    learned: bool
    reason: str


class VisionUpdater:
    """Learns (theta_ik, l_target) when the hand has settled and was seen (sec. III-C).

    Args:
        learner: holds the map.
        prior: prior of the map's error.
        marker_residual: residual of the marker's pose at a posture.
        limits: lowest and highest angle of each joint (n, 2) [rad].
        options: of the updater.

    Attributes:
        elongated: number of permanent elongations of each muscle since each remembered observation
            (K, m).
        pairs: remembered pairs, the newest last.
        hold_out: observations that are not learned from; None if none is held out.
        fired: number of updates.
        dropped: number of observations that were not learned from, by reason.
    """

    def __init__(
        self,
        learner: Learner,
        prior: MapPrior,
        marker_residual: PoseResidual,
        limits: Floats,
        options: VisionOptions,
    ) -> None:
        self._learner, self._prior, self._marker_residual = learner, prior, marker_residual
        self._limits, self._options = limits, options
        self._observations: list[MarkerObservation] = []
        self._commands: list[Floats] = []
        self._sound: list[bool] = []
        self._angles = np.empty((0, len(limits)))
        joints, muscles = len(learner.map.joints), len(learner.map.muscles)
        self.elongated = np.empty((0, muscles))
        self.pairs = Pairs.none(joints, muscles)
        hold_out = options.hold_out
        self.hold_out = None if hold_out is None else HoldOut(hold_out, joints, muscles)
        self.fired = 0
        self.dropped: dict[str, int] = {}

    @property
    def memory(self) -> VisionMemory:
        """All that is remembered; may be set to an earlier value."""
        return VisionMemory(
            self._observations,
            self._commands,
            self._sound,
            self._angles,
            self.elongated,
            self.pairs,
        )

    @memory.setter
    def memory(self, earlier: VisionMemory) -> None:
        self._observations, self._commands, self._sound = earlier[:3]
        self._angles, self.elongated, self.pairs = earlier[3:]

    def seen(
        self,
        pose: Floats,
        estimate: Floats,
        lengths: Floats,
        target: Floats,
        tensions: Floats,
        antagonism: Pairs | None = None,
        learn: bool = True,
    ) -> Seen:
        """Evaluate one observation of the settled hand, and learn from it.

        Args:
            pose: measured pose_marker_in_camera (4, 4).
            estimate: theta_est (n,) [rad].
            lengths: l (m,) [m].
            target: l_target (m,) [m].
            tensions: (m,) [N].
            antagonism: pairs that the Antagonism Updater remembers.
            learn: if False, nothing is remembered and the map stays.
        """
        observations = [*self._observations, MarkerObservation(pose, lengths, estimate)]
        observations = observations[-self._options.observations.memory :]
        fit, elongated = self._fit(observations)
        angles = fit.angles[-1]
        seen = Seen(angles, estimate - angles, False, self._doubt(fit, estimate))
        if not learn:
            return seen
        if seen.reason:
            self.drop(seen.reason)
            return seen
        command = _pair_lengths(self._options.lengths, lengths, target)
        sound = bool(tensions.max() < self._options.saturation)
        pair = Pairs(angles[None], command[None], np.array([self._options.noise]))
        if sound and self.hold_out is not None and self.hold_out.keeps(pair):
            return seen._replace(reason="held back, to test updates on it")
        map_before, before = self._learner.map, self.memory
        keep = len(observations)
        self._observations, self._angles, self.elongated = observations, fit.angles, elongated
        self._commands = [*self._commands, command][-keep:]
        self._sound = [*self._sound, sound][-keep:]
        self._learn(self.pairs.last(0) if antagonism is None else antagonism)
        if self.hold_out is not None and self.hold_out.harmed(map_before, self._learner.map):
            self._learner.map, self.memory = map_before, before
            seen = seen._replace(reason="undone: it made the map worse at held-out observations")
            self.drop(seen.reason)
            return seen
        return seen._replace(learned=True)

    def drop(self, reason: str) -> None:
        """Count an observation that was not learned from.

        Args:
            reason: key in `dropped`.
        """
        self.dropped[reason] = self.dropped.get(reason, 0) + 1

    def _fit(self, observations: list[MarkerObservation]) -> tuple[ObservationFit, Floats]:
        """Joint angles of all observations, and the elongations of each muscle since each."""
        options, residual, limits = self._options.observations, self._marker_residual, self._limits
        none = np.zeros(self.elongated.shape[1])
        elongated = np.vstack([self.elongated, none])[-options.memory :]
        if self._options.fit == "together":
            start = np.vstack([self._angles, observations[-1].guess])[-options.memory :]
            return fit_with_elongation(
                observations, self._prior, residual, limits, options, start, elongated
            )
        alone = fit_alone(observations[-1], residual, limits, options)
        angles = np.vstack([self._angles, alone.angles])[-options.memory :]
        return alone._replace(angles=angles), elongated

    def _doubt(self, fit: ObservationFit, estimate: Floats) -> str:
        """Why the newest observation is not believed; empty if it is."""
        options, angles = self._options, fit.angles[-1]
        position, rotation = fit.residual_norms[-1]
        missed = position > options.position_residual or rotation > options.rotation_residual
        if missed or not fit.converged:
            return "inverse kinematics did not converge"
        if np.linalg.norm(angles - estimate) >= options.threshold:
            return "too far from the estimate"
        if len(self._angles) and (np.linalg.norm(angles - self._angles[-1]) < options.distance):
            return "too close to the last update"
        return ""

    def _learn(self, antagonism: Pairs) -> None:
        """Learn all pairs again, because a new observation changes the fit of the earlier ones.

        Lengths from before a permanent elongation are moved to what they would be now.
        """
        options = self._options
        low = self._limits[:, 0] + options.stop_margin
        high = self._limits[:, 1] - options.stop_margin
        free = np.all((self._angles > low) & (self._angles < high), axis=1)
        use = free & np.array(self._sound)
        if not self._sound[-1]:
            self.drop("a muscle was saturated: no pair")
        elif not free[-1]:
            self.drop("a joint was at its stop: no pair")
        noise = np.full(len(use), options.noise)
        longer = elongations(self._observations, self._prior, self._angles, self.elongated)
        lengths = np.array(self._commands) - longer
        self.pairs = Pairs(self._angles[use], lengths[use], noise[use])
        new = self.pairs.last(int(use[-1]))
        earlier = Pairs(*(part[: len(part) - len(new.noise)] for part in self.pairs))
        self._learner.learn(new, earlier.joined(antagonism))
        self.fired += 1


def _pair_lengths(kind: PairLengths, lengths: Floats, target: Floats) -> Floats:
    if kind == "l_target":
        return target
    return lengths if kind == "l" else np.minimum(lengths, target)

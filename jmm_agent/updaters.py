"""The two updaters: which pair is learned, and when (paper, sec. II-C, III-B, III-C).

* `AntagonismUpdater` learns (theta_est, l): wires that fought each other or hung slack.
* `VisionUpdater` learns (theta_ik, l_target): where the hand was really seen.

Both fire when the lengths have settled and the posture is far enough from their last update.
Under stiffness control a wire with l < l_target does not pull, and obeys any command that is long
enough: its l_target says nothing. The tightest command that gives the measured tensions is
min(l, l_target), muscle by muscle; it is the Vision Updater's default, the paper's stays an option.
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
    Sight,
    fit_alone,
)
from jmm_agent.vision.permanent_elongation import elongations, fit_with_elongation

PairLengths = Literal["min", "l_target", "l"]


@dataclass(frozen=True)
class AntagonismOptions:
    """When and how strongly (theta_est, l) is learned.

    Attributes:
        distance: least distance from the last update's posture, L2 norm [rad].
        noise: how far a pair may be missed [m].
        memory: number of pairs that are remembered.
    """

    distance: float = 0.15
    noise: float = 0.01
    memory: int = 10


@dataclass(frozen=True)
class VisionOptions:
    """When, what and how strongly the Vision Updater learns.

    Attributes:
        distance: least distance from the last update's posture, L2 norm [rad].
        threshold: C, the largest ||theta_ik - theta_est||_2 that is believed [rad].
        lengths: what the pair holds: l_target as in the paper, l, or min(l, l_target).
        noise: how far a pair may be missed [m].
        saturation: a pair with a tension above this is not learned [N].
        stop_margin: nor one with a joint this close to its stop [rad].
        sight_position, sight_rotation: a look that the fit misses by more is dropped [m, rad].
        fit: whether looks are fitted together with the wires, or each alone as in the paper.
        looks: how.
        held_back: looks that are held back to undo updates that make the map worse; None: none.
    """

    distance: float = 0.15
    threshold: float = 2.0
    lengths: PairLengths = "min"
    noise: float = 0.001
    saturation: float = 450.0
    stop_margin: float = 0.005
    sight_position: float = 0.02
    sight_rotation: float = 0.06
    fit: Literal["together", "alone"] = "together"
    observations: ObservationFitOptions = field(default_factory=ObservationFitOptions)
    hold_out: HoldOutOptions | None = None


class AntagonismMemory(NamedTuple):
    """Posture (n,) [rad] of the last update, None before the first, and pairs remembered."""

    last: Floats | None
    pairs: Pairs


class VisionMemory(NamedTuple):
    """Looks remembered, a row or entry each: commands (m,) [m], whether no wire was saturated,
    joint angles (K, n) [rad], how often each wire gave since (K, m); and the pairs they make."""

    observations: list[MarkerObservation]
    commands: list[Floats]
    sound: list[bool]
    angles: Floats
    gave: Floats
    pairs: Pairs


class AntagonismUpdater:
    """Learns (theta_est, l) when the wires have settled (sec. III-B)."""

    def __init__(self, learner: Learner, options: AntagonismOptions) -> None:
        self._learner, self._options = learner, options
        self._last: Floats | None = None
        joints, muscles = len(learner.map.joints), len(learner.map.muscles)
        self.pairs = Pairs.none(joints, muscles)
        self.fired = 0

    @property
    def memory(self) -> AntagonismMemory:
        """All that is remembered; may be set to what it was before."""
        return AntagonismMemory(self._last, self.pairs)

    @memory.setter
    def memory(self, earlier: AntagonismMemory) -> None:
        self._last, self.pairs = earlier

    def settled(self, estimate: Floats, lengths: Floats, remembered: Pairs) -> bool:
        """Learn the pair if it is far enough from the last; True if the map was moved."""
        options = self._options
        if self._last is not None and np.linalg.norm(estimate - self._last) < options.distance:
            return False
        self._last = estimate.copy()
        new = Pairs(estimate[None], lengths[None], np.array([options.noise]))
        self._learner.learn(new, remembered.joined(self.pairs))
        self.pairs = self.pairs.joined(new).last(options.memory)
        self.fired += 1
        return True


class Seen(NamedTuple):
    """What one look brought.

    Attributes:
        angles: joint angles by vision (n,) [rad], theta_ik.
        error: theta_est - theta_ik (n,) [rad], what the paper calls its joint error.
        learned: whether the map was moved.
        reason: why not, if it was not.
    """

    angles: Floats
    error: Floats
    learned: bool
    reason: str


class VisionUpdater:
    """Learns (theta_ik, l_target) when the settled hand was seen (sec. III-C)."""

    def __init__(
        self,
        learner: Learner,
        prior: MapPrior,
        sight: Sight,
        limits: Floats,
        options: VisionOptions,
    ) -> None:
        self._learner, self._prior, self._sight = learner, prior, sight
        self._limits, self._options = limits, options
        self._observations: list[MarkerObservation] = []
        self._commands: list[Floats] = []
        self._sound: list[bool] = []
        self._angles = np.empty((0, len(limits)))
        joints, muscles = len(learner.map.joints), len(learner.map.muscles)
        self.gave = np.empty((0, muscles))
        """How often each wire is believed to have given for good since each look remembered."""
        self.pairs = Pairs.none(joints, muscles)
        hold_out = options.hold_out
        self.hold_out = None if hold_out is None else HoldOut(hold_out, joints, muscles)
        """Looks that were not learned from; None if none is held back."""
        self.fired = 0
        self.dropped: dict[str, int] = {}

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
        """Learn from one look at the settled hand.

        Args:
            pose: pose_marker_in_camera (4, 4), measured.
            estimate: theta_est (n,) [rad].
            lengths, target: l and l_target (m,) [m].
            tensions: (m,) [N].
            antagonism: pairs that the other updater remembers.
            learn: False only looks: nothing is remembered and the map stays.
        """
        options = self._options
        look = MarkerObservation(pose, lengths, estimate)
        observations = [*self._observations, look][-options.observations.memory :]
        fit, gave = self._fit(observations)
        angles = fit.angles[-1]
        seen = Seen(angles, estimate - angles, False, self._doubt(fit, estimate))
        if not learn:
            return seen
        if seen.reason:
            self.drop(seen.reason)
            return seen
        command = _pair_lengths(options.lengths, lengths, target)
        sound = bool(tensions.max() < options.saturation)
        pair = Pairs(angles[None], command[None], np.array([options.noise]))
        if sound and self.hold_out is not None and self.hold_out.keeps(pair):
            return seen._replace(reason="held back, to test updates on it")
        map_before, before = self._learner.map, self.memory
        keep = len(observations)
        self._observations, self._angles, self.gave = observations, fit.angles, gave
        self._commands = [*self._commands, command][-keep:]
        self._sound = [*self._sound, sound][-keep:]
        self._learn(self.pairs.last(0) if antagonism is None else antagonism)
        if self.hold_out is not None and self.hold_out.harmed(map_before, self._learner.map):
            self._learner.map, self.memory = map_before, before
            seen = seen._replace(reason="undone: looks held back say that it made the map worse")
            self.drop(seen.reason)
            return seen
        return seen._replace(learned=True)

    def _fit(self, observations: list[MarkerObservation]) -> tuple[ObservationFit, Floats]:
        """Joint angles of all looks, the newest last; how often each wire gave since each."""
        options, sight, limits = self._options.observations, self._sight, self._limits
        gave = np.vstack([self.gave, np.zeros(self.gave.shape[1])])[-options.memory :]
        if self._options.fit == "together":
            start = np.vstack([self._angles, observations[-1].guess])[-options.memory :]
            return fit_with_elongation(
                observations, self._prior, sight, limits, options, start, gave
            )
        alone = fit_alone(observations[-1], sight, limits, options)
        angles = np.vstack([self._angles, alone.angles])[-options.memory :]
        return alone._replace(angles=angles), gave

    @property
    def memory(self) -> VisionMemory:
        """All that is remembered; may be set to what it was before."""
        return VisionMemory(
            self._observations, self._commands, self._sound, self._angles, self.gave, self.pairs
        )

    @memory.setter
    def memory(self, earlier: VisionMemory) -> None:
        self._observations, self._commands, self._sound, self._angles, self.gave, self.pairs = (
            earlier
        )

    def drop(self, reason: str) -> None:
        """Count a look that brought nothing, and why."""
        self.dropped[reason] = self.dropped.get(reason, 0) + 1

    def _doubt(self, fit: ObservationFit, estimate: Floats) -> str:
        """Why the newest look is not believed; empty if it is."""
        options, angles = self._options, fit.angles[-1]
        position, rotation = fit.sight_error[-1]
        missed = position > options.sight_position or rotation > options.sight_rotation
        if missed or not fit.converged:
            return "inverse kinematics did not converge"
        if np.linalg.norm(angles - estimate) >= options.threshold:
            return "too far from the estimate"
        if len(self._angles) and (np.linalg.norm(angles - self._angles[-1]) < options.distance):
            return "too close to the last update"
        return ""

    def _learn(self, antagonism: Pairs) -> None:
        """Learn all pairs anew: a new look may have changed what the earlier ones mean.

        Lengths of wires that gave since are moved to what they would be now.
        """
        options = self._options
        low = self._limits[:, 0] + options.stop_margin
        high = self._limits[:, 1] - options.stop_margin
        free = np.all((self._angles > low) & (self._angles < high), axis=1)
        use = free & np.array(self._sound)
        if not self._sound[-1]:
            self.drop("a wire was saturated: no pair")
        elif not free[-1]:
            self.drop("a joint was at its stop: no pair")
        noise = np.full(len(use), options.noise)
        given = elongations(self._observations, self._prior, self._angles, self.gave)
        lengths = np.array(self._commands) - given
        self.pairs = Pairs(self._angles[use], lengths[use], noise[use])
        new = self.pairs.last(int(use[-1]))
        earlier = Pairs(*(part[: len(part) - len(new.noise)] for part in self.pairs))
        self._learner.learn(new, earlier.joined(antagonism))
        self.fired += 1


def _pair_lengths(kind: PairLengths, lengths: Floats, target: Floats) -> Floats:
    if kind == "l_target":
        return target
    return lengths if kind == "l" else np.minimum(lengths, target)

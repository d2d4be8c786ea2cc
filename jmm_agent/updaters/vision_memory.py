"""What the Vision Updater remembers, and the result of one observation."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from jmm_agent.mapping.learner import Pairs
from jmm_agent.mapping.prior import with_unknown
from jmm_agent.types import Bools, Floats
from jmm_agent.updaters.assignment import Assignment, ObservationRecord
from jmm_agent.updaters.rest_fitter import FittedRests, RestMemory
from jmm_agent.vision.hand_error import HandErrors
from jmm_agent.vision.marker_observation import MarkerObservation
from jmm_agent.vision.observation_prediction import ObservationPrediction


class EpisodeStart(NamedTuple):
    """What was remembered when an episode began, or when lengths may have been zeroed within it.

    Attributes:
        newest: number of observations that were remembered since.
        elongated: `VisionMemory.elongated` of those before (K, m), as believed then.
        within: whether it is within an episode. No single observation then shows a zeroing, because
            the hand may have been seen where it was not.
    """

    newest: int
    elongated: Floats
    within: bool = False

    @classmethod
    def before_elongations(cls, elongated: Floats, recent: int) -> EpisodeStart | None:
        """Before the first of the muscles that were elongated lately.

        None if there is none, or if all lengths were zeroed lately: what one zeroing leaves is no
        other one.

        Args:
            elongated: number of elongations since each observation (K, m).
            recent: number of newest observations, before which they count; of zeroings twice as
                many.
        """
        steps = np.diff(elongated, axis=0) < 0.0
        stepped = np.asarray(steps[-recent:].any(axis=1))
        if not stepped.any() or steps[-2 * recent :].all(axis=1).any():
            return None
        newest = len(stepped) - int(np.argmax(stepped))
        before = elongated[: len(elongated) - newest]
        return cls(newest, before - before[-1], True)


class VisionMemory(NamedTuple):
    """What the Vision Updater remembers of K marker observations, the newest last.

    Attributes:
        observations: the observations.
        commands: lengths that were commanded (m,) [m], for each.
        sound: whether no muscle was saturated, for each.
        angles: fitted joint angles (K, n) [rad].
        elongated: number of permanent elongations of each muscle since each observation (K, m); a
            zeroing of all lengths counts as `MapPrior.zeroing_share`.
        pairs: the pairs that they make.
        start: what was remembered when the episode began; None once it is known whether lengths
            were zeroed anew then.
        zeroings: number of zeroings that were noticed.
        rests: what is known from all rests.
        assignment: which muscle each channel is; all lengths are in its order.
        unexpected: whether the newest look of this episode was far from its prediction.
    """

    observations: list[MarkerObservation]
    commands: list[Floats]
    sound: list[bool]
    angles: Floats
    elongated: Floats
    pairs: Pairs
    start: EpisodeStart | None = None
    zeroings: int = 0
    rests: RestMemory = RestMemory()
    assignment: Assignment = Assignment()
    unexpected: bool = False

    @classmethod
    def none(cls, joints: int, muscles: int) -> VisionMemory:
        """Without any observation.

        Args:
            joints: number of joints, n.
            muscles: number of muscles, m.
        """
        nothing = np.empty((0, joints)), np.empty((0, muscles)), Pairs.none(joints, muscles)
        return cls([], [], [], *nothing)

    @property
    def records(self) -> Iterator[ObservationRecord]:
        """The observations, with their commands."""
        return map(ObservationRecord, self.observations, self.commands, self.sound)

    @property
    def shown(self) -> Bools:
        """Whose length the newest observation shows as it is now (m,)."""
        if not self.observations:
            return np.zeros(self.elongated.shape[1], dtype=bool)
        lengths = self.observations[-1].lengths
        return np.asarray((self.elongated[-1] == 0.0) & np.isfinite(lengths))

    @property
    def tensions_are_believed(self) -> bool:
        """Whether tensions may be those of the loads, as in the model's units."""
        return self.rests.unbalanced is None

    def balanced_rests(self) -> tuple[Floats, Floats]:
        """Joint angles (K, n) [rad] and tensions (K, m) [N] of the rests that were learned from."""
        seen = zip(self.angles, self.observations, strict=True)
        rests = [(rest.guess, rest.tensions) for rest in self.rests.rests]
        rests += [(q, found.tensions) for q, found in seen if found.tensions is not None]
        whole = [(q, tensions) for q, tensions in rests if np.isfinite(tensions).all()]
        angles = np.array([q for q, _ in whole]).reshape(-1, self.angles.shape[1])
        muscles = self.elongated.shape[1]
        return angles, np.array([tensions for _, tensions in whole]).reshape(-1, muscles)

    def believed(
        self,
        observations: list[MarkerObservation],
        found: FittedRests,
        command: Floats,
        sound: bool,
        recent: int,
    ) -> VisionMemory:
        """With a new observation that is believed.

        If it seems that a muscle was elongated, further ones show whether all were zeroed instead.

        Args:
            observations: the new one last.
            found: their fit.
            command: of the new one (m,) [m].
            sound: whether no muscle was saturated then.
            recent: number of newest observations, before which elongations count.
        """
        keep = len(observations)
        if self.start is None:
            start = EpisodeStart.before_elongations(found.elongated, recent)
        else:
            start = self.start._replace(newest=self.start.newest + 1)
        return self._replace(
            observations=observations,
            commands=[*self.commands, command][-keep:],
            sound=[*self.sound, sound][-keep:],
            angles=found.observed.angles,
            elongated=found.elongated,
            start=start,
            rests=found.memory,
        )

    def without(self, number: int) -> VisionMemory:
        """Without an observation, by its number; the pairs stay until they are made again."""
        keep, start, drift = np.arange(len(self.angles)) != number, self.start, self.rests.drift
        if start is not None:
            before = len(self.angles) - start.newest
            if number >= before:
                start = start._replace(newest=start.newest - 1)
            else:
                row = len(start.elongated) - before + number
                start = start._replace(elongated=np.delete(start.elongated, row, axis=0))
        if len(drift.ages) == len(self.angles):
            drift = drift._replace(ages=drift.ages[keep])
        return self._replace(
            observations=[one for one, kept in zip(self.observations, keep, strict=True) if kept],
            commands=[one for one, kept in zip(self.commands, keep, strict=True) if kept],
            sound=[one for one, kept in zip(self.sound, keep, strict=True) if kept],
            angles=self.angles[keep],
            elongated=self.elongated[keep],
            start=start,
            rests=self.rests._replace(drift=drift),
        )

    def begun(self, least: int) -> VisionMemory:
        """At the begin of an episode, before which lengths may have been zeroed anew.

        Args:
            least: number of observations from which on that is looked for.
        """
        drift = self.rests.drift._replace(time=np.nan)
        start = EpisodeStart(0, self.elongated) if len(self.observations) >= least else None
        rests = self.rests._replace(rests=(), drift=drift)
        return self._replace(rests=rests, start=start, unexpected=False)

    def zeroed(self, share: float) -> VisionMemory:
        """After a zeroing of all lengths; shapes stay.

        Args:
            share: `MapPrior.zeroing_share`.
        """
        rests = self.rests._replace(rests=())
        return self._replace(elongated=self.elongated + share, start=None, rests=rests)

    def repaired(self, muscle: int) -> VisionMemory:
        """After a muscle, by its number, was mounted anew; its shape stays."""
        since, start = np.zeros(self.elongated.shape[1]), self.start
        since[muscle] = 1.0
        if start is not None:
            start = start._replace(elongated=start.elongated + since)
        rests = self.rests._replace(rests=())
        return self._replace(elongated=self.elongated + since, start=start, rests=rests)

    def doubted(self, muscle: int) -> VisionMemory:
        """With the lengths of a muscle, by its number, as unknown."""
        observations = [
            one._replace(lengths=with_unknown(one.lengths, muscle)) for one in self.observations
        ]
        commands = [with_unknown(command, muscle) for command in self.commands]
        rests = [
            one._replace(lengths=with_unknown(one.lengths, muscle)) for one in self.rests.rests
        ]
        return self._replace(
            observations=observations,
            commands=commands,
            pairs=self.pairs.with_unknown(muscle),
            rests=self.rests._replace(rests=tuple(rests)),
        )


class Rested(NamedTuple):
    """What was learned from a rest in which the hand was not seen.

    Attributes:
        angles: joint angles (n,) [rad].
        moved: as `Seen.moved`.
    """

    angles: Floats
    moved: bool


class Seen(NamedTuple):
    """Result of one marker observation.

    Attributes:
        angles: joint angles by vision (n,) [rad], theta_ik.
        error: theta_est - theta_ik (n,) [rad], the paper's joint error.
        learned: whether the map was moved.
        reason: why it was not moved; empty if it was.
        zeroed: whether it showed that all lengths were zeroed anew.
        detail: how far the measured pose is from that of ``angles``, if that is the reason.
        moved: whether it showed that the lengths were zeroed at quite another posture than was
            believed. Angles that were estimated before are then wrong.
        predicted: what was expected before it was learned; None if nothing was learned from it, or
            if each observation is fitted alone.
        hand_error: expected errors of the hand with the map before the update and after it; None if
            the update was not judged.
    """

    angles: Floats
    error: Floats
    learned: bool
    reason: str
    zeroed: bool = False
    detail: str = ""
    moved: bool = False
    predicted: ObservationPrediction | None = None
    hand_error: HandErrors | None = None

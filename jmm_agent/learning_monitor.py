"""Names what keeps an agent from learning, so that learning never stops without a word.

Readings lead to learning in this order: the lengths settle while the hand is free, a frame is taken
during the rest, the hand's marker is found in it, and the observation is believed. Each step that
fails for long is named. Faults of the robot that a guard names are not repeated here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from jmm_agent.guard.faults import (
    HAND_NOT_FREE,
    NEVER_SETTLED,
    NO_FRAME,
    NOTHING_LEARNED,
    Fault,
)
from jmm_agent.settling import SettlingDetector
from jmm_agent.updaters.forecast import NO_BETTER
from jmm_agent.updaters.observation_check import UNCERTAIN
from jmm_agent.vision.hand_pose import MOVING, REPEATED

USUAL = ("too close to the last update", UNCERTAIN, NO_BETTER, MOVING, REPEATED)
"""Reasons not to learn from an observation that show no fault: the posture is known already, a
coarse pose agrees with the map, the map is as good as it gets, or a tracker measures the hand's
pose all the time."""


@dataclass(frozen=True)
class LearningMonitorOptions:
    """How long a step on the way to learning may fail before that is named.

    Attributes:
        resting: time at targets without settling, over one or several rests [s].
        unsettled: time without settling, also while the arm is moved [s].
        without_frame: time at rest without a frame of that rest, over one or several rests [s].
        observations: number of observations in a row that were not learned from.
        hand_not_free: time during which the hand was not free [s].
    """

    resting: float = 8.0
    unsettled: float = 60.0
    without_frame: float = 5.0
    observations: int = 10
    hand_not_free: float = 60.0


class LearningMonitor:
    """Watches the steps that lead from readings to learning.

    Args:
        options: how long each may fail.

    Attributes:
        faults: what keeps the agent from learning now.
    """

    def __init__(self, options: LearningMonitorOptions) -> None:
        self._options = options
        self._fired, self._dropped = 0, dict[str, int]()
        self.reset()

    def reset(self) -> None:
        """Forget all, as before a new episode."""
        self._resting = self._unsettled = self._without_frame = self._not_free = 0.0
        self._why_no_frame = ""
        self._failed: dict[str, int] = {}
        self._detail = ""
        self.faults: list[Fault] = []

    def moved(self, dt: float, at_target: bool) -> None:
        """Count a step in which the lengths have not settled.

        Args:
            dt: its duration [s].
            at_target: whether the trajectory has ended.
        """
        self._unsettled += dt
        self._resting += dt if at_target else 0.0

    def rested(self, dt: float, without_frame: str) -> None:
        """Count a step in which the lengths have settled.

        Args:
            dt: its duration [s].
            without_frame: why the frame of this rest that is awaited is not there; empty if none
                is awaited.
        """
        self._resting = self._unsettled = 0.0
        self._without_frame = self._without_frame + dt if without_frame else 0.0
        self._why_no_frame = without_frame

    def held(self, dt: float, free: bool) -> None:
        """Count a step of which nothing can be learned if the hand is not free.

        Args:
            dt: its duration [s].
            free: whether the hand is free.
        """
        self._not_free = 0.0 if free else self._not_free + dt

    def observed(self, fired: int, dropped: Mapping[str, int], detail: str = "") -> None:
        """Count the observations since the last call.

        Args:
            fired: number of updates of the Vision Updater.
            dropped: number of observations that it did not learn from, by reason.
            detail: more about the reason of the newest one; may be empty.
        """
        self._detail = detail
        new = {key: count - self._dropped.get(key, 0) for key, count in dropped.items()}
        failed = {key: count for key, count in new.items() if count > 0 and key not in USUAL}
        if fired != self._fired and not failed:
            self._failed.clear()
        for reason, count in failed.items():
            self._failed[reason] = self._failed.get(reason, 0) + count
        self._fired, self._dropped = fired, dict(dropped)

    def update(self, time: float, settling: SettlingDetector, muscles: Sequence[str]) -> None:
        """Bring `faults` up to date.

        Args:
            time: now [s].
            settling: detects when the lengths settle.
            muscles: names of the muscles.
        """
        known = {fault.kind: fault for fault in self.faults}
        options = self._options
        self.faults = []
        if self._resting > options.resting or self._unsettled > options.unsettled:
            where, detail = "muscles", ""
            if NEVER_SETTLED not in known and (unrest := settling.unrest) is not None:
                where, detail = muscles[unrest.muscle], unrest.sentence
            self._name(NEVER_SETTLED, where, time, detail, known)
        if self._without_frame > options.without_frame:
            self._name(NO_FRAME, "camera", time, self._why_no_frame, known)
        if sum(self._failed.values()) >= options.observations:
            reasons = "; ".join(f"{reason} ({count})" for reason, count in self._failed.items())
            detail = f"{reasons}; {self._detail}" if self._detail else reasons
            self._name(NOTHING_LEARNED, "observations", time, detail, known)
        if self._not_free > options.hand_not_free:
            detail = f"the hand was not free for {options.hand_not_free:g} s"
            self._name(HAND_NOT_FREE, "hand", time, detail, known)

    def _name(
        self, kind: str, where: str, time: float, detail: str, known: Mapping[str, Fault]
    ) -> None:
        """Add a fault, or the same one if it was found before."""
        self.faults.append(known.get(kind) or Fault(kind, where, time, detail))

"""Faults of learning: what keeps an agent from it, and that muscle lengths were zeroed anew."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from jmm_agent.guard.faults import (
    JOINT_CONTRADICTED,
    JOINTS_MISPLACED,
    LENGTHS_DRIFT,
    TENSIONS_WRONG,
    TRACKER_CLOCK,
    ZEROED,
    Fault,
)
from jmm_agent.learning_monitor import LearningMonitor, LearningMonitorOptions
from jmm_agent.settling import SettlingDetector
from jmm_agent.updaters import VisionUpdater

LEARNED = 8
"""Number of observations of the hand in the map from which on it is trusted."""
UNLEARNED = 0.5
"""Error of a joint angle that is usual before [rad]."""

_log = logging.getLogger(__name__)


class StepState(NamedTuple):
    """State of a control step, as far as learning depends on it.

    Attributes:
        time: of the step [s].
        passed: its duration [s].
        hand_is_free: whether the hand is free.
        at_target: whether the trajectory has ended.
        why_unobserved: why the observation of this rest that is awaited is not there; empty if none
            is awaited.
        why_not_learned: detail of why the newest observation was not learned from; may be empty.
        contradicted: joints whose encoders contradict the lengths, and by how much [rad].
        clock_problem: what is wrong with the times of measured poses; empty if nothing.
    """

    time: float
    passed: float
    hand_is_free: bool
    at_target: bool
    why_unobserved: str
    why_not_learned: str
    contradicted: Mapping[str, float]
    clock_problem: str


class LearningWatch:
    """Watches settling and the Vision Updater in each control step.

    Args:
        vision: the Vision Updater.
        settling: detects when the lengths settle.
        muscles: names of the muscles.
        options: how long learning may fail.
    """

    def __init__(
        self,
        vision: VisionUpdater,
        settling: SettlingDetector,
        muscles: Sequence[str],
        options: LearningMonitorOptions,
    ) -> None:
        self._vision, self._settling, self._muscles = vision, settling, muscles
        self._monitor = LearningMonitor(options)
        self._zeroings, self._zeroed = 0, list[Fault]()
        self._contradicted: dict[str, Fault] = {}
        self._tracker: Fault | None = None
        self._tensions: Fault | None = None
        self._drift: Fault | None = None
        self._bones: Fault | None = None

    @property
    def faults(self) -> list[Fault]:
        """Faults that are found now."""
        found = [*self._monitor.faults, *self._zeroed, *self._contradicted.values()]
        lasting = self._tracker, self._tensions, self._drift, self._bones
        return [*found, *(one for one in lasting if one is not None)]

    def reset(self) -> None:
        """Forget all, as before a new episode."""
        self._monitor.reset()
        self._zeroed = []
        self._contradicted = {}
        self._tracker = self._tensions = self._drift = self._bones = None

    def update(self, step: StepState) -> None:
        """Name what keeps the agent from learning.

        Args:
            step: state of the control step, in which the robot has no fault.
        """
        monitor = self._monitor
        monitor.held(step.passed, step.hand_is_free)
        if np.isfinite(self._settling.since):
            monitor.rested(step.passed, step.why_unobserved)
        elif step.hand_is_free:
            monitor.moved(step.passed, step.at_target)
        monitor.observed(self._vision.fired, self._vision.dropped, step.why_not_learned)
        monitor.update(step.time, self._settling, self._muscles)
        self._name_joints(step)
        self._name_tensions(step.time)
        self._name_drift(step.time)
        self._name_bones(step.time)
        if not step.clock_problem:
            self._tracker = None
        elif self._tracker is None:
            self._tracker = Fault(TRACKER_CLOCK, "tracker", step.time, step.clock_problem)

    def _name_tensions(self, time: float) -> None:
        """Name tensions that cannot be those of the loads."""
        ratio = self._vision.memory.rests.unbalanced
        if ratio is None:
            self._tensions = None
        elif self._tensions is None:
            self._tensions = Fault(TENSIONS_WRONG, "muscles", time, _imbalance(ratio))
            _log.warning("%s.", self._tensions.detail)

    def _name_drift(self, time: float) -> None:
        """Name a drift of all lengths, with its speed."""
        speed = self._vision.memory.rests.drift.speed
        if speed == 0.0:
            self._drift = None
            return
        detail = (
            f"they drift by about {6e4 * speed:.2g} mm a minute, or were zeroed by as little; that "
            "is learned as long as the hand is observed; check whether encoders slip or wires creep"
        )
        if self._drift is None:
            _log.warning("The muscle lengths drift: %s.", detail)
            self._drift = Fault(LENGTHS_DRIFT, "muscles", time, detail)
        self._drift = self._drift._replace(detail=detail)

    def _name_bones(self, time: float) -> None:
        """Name joints that are not where they are drawn."""
        joints = self._vision.memory.rests.joints
        if joints is None or not joints.enabled:
            self._bones = None
            return
        detail = (
            f"joints are off by about {1e3 * joints.offset:.2g} mm along each axis, and their axes "
            f"by {np.degrees(joints.turn):.2g} deg, or marker and lens are not as modelled; the "
            "map is learned in spite of it, but a hand that is sent to a pose by the model misses "
            "it; measure bones and marker again"
        )
        if self._bones is None:
            _log.warning("The bones do not fit the model: %s.", detail)
            self._bones = Fault(JOINTS_MISPLACED, "bones", time, detail)
        self._bones = self._bones._replace(detail=detail)

    def _name_joints(self, step: StepState) -> None:
        """Name joints whose encoders contradict the lengths, which the map may have wrong.

        Before the map is learned it may be wrong by some degrees, and only more is named.
        """
        learned = len(self._vision.memory.observations) >= LEARNED
        least = 0.0 if learned else UNLEARNED
        self._contradicted = {
            joint: self._contradicted.get(joint) or _contradiction(joint, away, step.time)
            for joint, away in step.contradicted.items()
            if abs(away) > least
        }

    def name_zeroing(self, time: float) -> None:
        """Name a zeroing that a marker observation has shown.

        Args:
            time: of the control step [s].
        """
        if self._vision.zeroings > self._zeroings:
            detail = "offsets of all muscles are learned again; what was learned of shape stays"
            self._zeroed = [Fault(ZEROED, "muscles", time, detail)]
            _log.warning("The muscle lengths were zeroed anew since they were learned: %s.", detail)
        self._zeroings = self._vision.zeroings


def _imbalance(ratio: float) -> str:
    """What is wrong with tensions, of whose torques the loads are a multiple."""
    if ratio <= 0.0:
        return "the tensions are zero, or pull against the loads of the model; check their sign"
    return (
        f"the loads of the model are {ratio:.2g} times the torques of the tensions; check the "
        "unit of the tensions, and the model's masses"
    )


def _contradiction(joint: str, away: float, time: float) -> Fault:
    detail = (
        f"the encoder differs by {np.degrees(away):+.0f} deg from the angle by the muscle lengths: "
        "its sign or zero, a length, or the map is wrong"
    )
    return Fault(JOINT_CONTRADICTED, joint, time, detail)

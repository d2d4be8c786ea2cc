"""Faults of learning: what keeps an agent from it, and that muscle lengths were zeroed anew."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jmm_agent.guard.faults import ZEROED, Fault
from jmm_agent.learning_monitor import LearningMonitor, LearningMonitorOptions
from jmm_agent.settling import SettlingDetector
from jmm_agent.updaters import VisionUpdater

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
    """

    time: float
    passed: float
    hand_is_free: bool
    at_target: bool
    why_unobserved: str


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

    @property
    def faults(self) -> list[Fault]:
        """Faults that are found now."""
        return [*self._monitor.faults, *self._zeroed]

    def reset(self) -> None:
        """Forget all, as before a new episode."""
        self._monitor.reset()
        self._zeroed = []

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
        monitor.observed(self._vision.fired, self._vision.dropped)
        monitor.update(step.time, self._settling, self._muscles)

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

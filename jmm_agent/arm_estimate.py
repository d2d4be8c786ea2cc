"""Estimate of the arm: joint angles, and the readings of the muscles that are in use.

The estimator calculates with lengths as they were without what tendons stretch by load. Of a muscle
that is not in use it gets the length that the map expects; learned from is what was measured, see
`MusclesInUse`.
"""

from __future__ import annotations

import numpy as np

from jmm_agent.guard.muscle_monitor import FilteredReadings
from jmm_agent.kalman_filter import JointEstimator
from jmm_agent.mapping.learner import Learner
from jmm_agent.muscles_in_use import MusclesInUse
from jmm_agent.observation import CONTROL_PERIOD, SensorReadings
from jmm_agent.types import Floats
from jmm_agent.vision.hand_pose import ArmSample

START_UPDATES = 50
"""Updates of the estimator with the first lengths, before the first command."""
START_CHANGE = 1e-3
"""Change by an update that ends these updates on a live robot [rad]."""


class ArmEstimate:
    """Passes the readings of the muscles in use to the estimator, and to what is learned.

    Args:
        learner: holds the map.
        estimator: estimates the joint angles.
        in_use: which muscles are in use.

    Attributes:
        measured: newest lengths (m,) [m], of muscles that are not in use, too.
    """

    measured: Floats

    def __init__(self, learner: Learner, estimator: JointEstimator, in_use: MusclesInUse) -> None:
        self._learner, self._estimator, self._in_use = learner, estimator, in_use

    def usable(self, readings: SensorReadings, filtered: FilteredReadings) -> SensorReadings:
        """Readings to calculate with.

        Args:
            readings: of a control step.
            filtered: what a guard believes of them.
        """
        in_use, self.measured = self._in_use, filtered.lengths
        self._estimator.doubt(filtered.doubted | ~in_use.mask)
        lengths = in_use.usable(filtered.lengths, self._estimator.lengths)
        return readings._replace(lengths=lengths, tensions=in_use.pulling(filtered.tensions))

    def start(self, readings: SensorReadings, live: bool) -> None:
        """Estimate where the arm is, at the first control step of an episode.

        Args:
            readings: of the step.
            live: whether no step may take long.
        """
        lengths = self._at_reference(readings)
        for _ in range(START_UPDATES):
            before = self._estimator.q
            self._estimator.update(lengths, CONTROL_PERIOD, readings.joint_angles)
            if live and np.abs(self._estimator.q - before).max() < START_CHANGE:
                break

    def update(self, readings: SensorReadings, passed: float) -> None:
        """Estimate where the arm is.

        Args:
            readings: of a control step.
            passed: time since the readings before [s].
        """
        lengths = self._at_reference(readings)
        self._estimator.update(lengths, passed, readings.joint_angles)

    def sample(self, readings: SensorReadings, target: Floats) -> ArmSample:
        """What is learned from at rest.

        Args:
            readings: of a control step.
            target: target lengths (m,) [m] without what muscles stretch by load.
        """
        angles = self._estimator.joint_encoders.usable(readings.joint_angles)
        state = readings.time, np.inf, self._estimator.q
        lengths = self._in_use.known(self._at_reference(readings), self.measured)
        return ArmSample(*state, lengths, target, readings.tensions, angles)

    def _at_reference(self, readings: SensorReadings) -> Floats:
        """Measured lengths (m,) [m] as they were without what tendons stretch by load."""
        jmm = self._learner.map
        if jmm.tendons is None:
            return readings.lengths
        return readings.lengths + jmm.stretch(readings.tensions)

"""Limits of commands that need no guard: rate of the target lengths, and tension of the motors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import MotorControl
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.types import Floats

FASTEST = 0.5
"""Time in which a target length may pass the whole range of its muscle [s]."""
LEAST = 0.1
"""Least range that counts for the rate, as a share of the largest range of all muscles."""
SAMPLES = 256
"""Number of postures that show the ranges of the muscles."""


@dataclass(frozen=True, eq=False)
class CommandLimits:
    """Limits of the commands of an agent; those of the tension come last.

    Attributes:
        rate: largest change of each target length [m/s], one for all muscles or of shape (m,);
            infinite for none. The first command of an episode starts from the measured lengths.
        motors: whose ``limit`` no command exceeds at the lengths just measured; None for no limit
            of the tension.

    Raises:
        AgentError: a rate is not positive.
    """

    rate: float | Floats = np.inf
    motors: MotorControl | None = None

    def __post_init__(self) -> None:
        rate = np.asarray(self.rate, dtype=float)
        if rate.ndim > 1 or not np.all(rate > 0.0):
            raise AgentError(
                f"CommandLimits: the rate is {self.rate} m/s; it must be positive, one number or "
                "one for each muscle."
            )

    @classmethod
    def of(
        cls, jmm: JointMuscleMap, joint_limits: Floats, motors: MotorControl | None = None
    ) -> CommandLimits:
        """Limits that derive from a robot: each muscle's whole range within half a second.

        Args:
            jmm: the map of the robot.
            joint_limits: lower and upper limits of the joints (n, 2) [rad].
            motors: of the robot; None for no limit of the tension.
        """
        low, high = np.asarray(joint_limits, dtype=float).T
        postures = np.random.default_rng(0).uniform(low, high, (SAMPLES, len(low)))
        ranges = np.ptp(jmm.lengths(postures), axis=0)
        return cls(np.maximum(ranges, LEAST * ranges.max()) / FASTEST, motors)

    def with_stiffness(self, stiffness: Floats | None) -> CommandLimits:
        """These limits for motors that have another K_stiff now.

        Args:
            stiffness: K_stiff (m,) [N/m]; None: that of ``motors``.
        """
        if self.motors is None or stiffness is None:
            return self
        return replace(self, motors=replace(self.motors, each=stiffness))

    def applied(
        self, target_lengths: Floats, previous: Floats, lengths: Floats, duration: float
    ) -> Floats:
        """Target lengths (m,) [m] within the limits.

        Args:
            target_lengths: wanted (m,) [m].
            previous: target lengths of the command before (m,) [m].
            lengths: measured lengths (m,) [m].
            duration: since the command before [s].
        """
        change = self.rate * duration
        limited = np.clip(target_lengths, previous - change, previous + change)
        if self.motors is None:
            return limited
        return np.maximum(limited, self.motors.shortest_target(lengths))

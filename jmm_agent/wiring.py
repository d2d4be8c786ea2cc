"""Wiring of a running agent: readings and commands of muscles that were found to be others.

Two muscles that are exchanged are exchanged back. One that is left out is used no longer, see
`jmm_agent.muscles_in_use`. A muscle without tension whose motor winds it up is lost: the agent
names it at once, also without a guard.
"""

from __future__ import annotations

import logging

import numpy as np

from jmm_agent.guard.faults import (
    MUSCLE_ABSENT,
    MUSCLE_REVERSED,
    MUSCLE_SNAPPED,
    MUSCLE_UNSTABLE,
    MUSCLES_SWAPPED,
    Fault,
    MotorControl,
)
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Bools, Floats, Ints
from jmm_agent.updaters.assignment import Assignment, step_between
from jmm_agent.updaters.wiring_evidence import Miswiring

SLACK = 0.25
"""Tension that counts as none, as a share of T_bias [1]."""
WOUND = 0.5
"""By how much a motor winds a lost muscle up, as a share of its range between the limits [1]."""
LOST_AFTER = 1.0
"""How long a muscle has had no tension before it is lost [s]."""
SAMPLES = 200
"""Number of postures, uniform between the joint limits, over which that range is taken."""

WHY = {
    MUSCLE_ABSENT: "it holds nothing or does not follow the joints",
    MUSCLE_REVERSED: "its lengths have the wrong sign",
    MUSCLE_SNAPPED: "it has snapped",
    MUSCLE_UNSTABLE: "it was elongated more than twice",
}
"""Why a muscle is left out, by the kind of its fault."""

_log = logging.getLogger(__name__)


class Wiring:
    """Applies what is known of the wiring, and finds muscles that are lost.

    Args:
        jmm: the joint-muscle mapping before learning.
        limits: lowest and highest angle of each joint (n, 2) [rad].

    Attributes:
        assignment: as applied.
        faults: named, in order.
        watching: whether lost muscles are looked for.
    """

    def __init__(self, jmm: JointMuscleMap, limits: Floats) -> None:
        low, high = limits.T
        postures = np.random.default_rng(0).uniform(low, high, (SAMPLES, len(limits)))
        self._muscles, self._ranges = jmm.muscles, np.ptp(jmm.lengths(postures), axis=0)
        self.assignment = Assignment()
        self.faults: list[Fault] = []
        self.watching = True
        self._lost: tuple[Miswiring, ...] = ()
        self.reset()

    def reset(self) -> None:
        """Forget the state of the muscles, as before a new episode."""
        count = len(self._muscles)
        self._slack, self._residual = np.zeros(count), np.zeros(count)
        self._taut = np.zeros(count, dtype=bool)
        self._time = np.nan

    def forget(self) -> None:
        """Forget which muscles were lost, as when another memory is loaded."""
        self._lost = ()

    def mended(self, muscle: int) -> None:
        """Forget that a muscle, by its number, was lost."""
        self._lost = tuple(one for one in self._lost if one.muscles != (muscle,))

    @property
    def left_out(self) -> Bools:
        """Muscles that are left out (m,)."""
        return self.assignment.mask(len(self._muscles))

    @property
    def changes(self) -> bool:
        """Whether anything differs from the nominal model."""
        return bool(self.assignment.order or self.assignment.left_out)

    def apply(self, learned: Assignment, time: float) -> Ints | None:
        """Apply what is known now.

        Args:
            learned: by the Vision Updater.
            time: of the last control step [s].

        Returns:
            Index before of what is now each muscle (m,); None if nothing has changed.
        """
        count = len(self._muscles)
        assignment = learned.losing(self.assignment._replace(named=self._lost), count)
        assignment = assignment._replace(refused=())
        if assignment == self.assignment:
            return None
        before, self.assignment = self.assignment, assignment
        self._lost = tuple(one for one in self._lost if one in assignment.named)
        self._name(before, time)
        return step_between(before, assignment, count)

    def readings(self, channels: SensorReadings) -> SensorReadings:
        """Readings (m,) of the agent's muscles.

        Args:
            channels: readings of the robot's channels.
        """
        if self.assignment.order:
            order = self.assignment.channels(len(self._muscles))
            lengths, tensions = np.asarray(channels.lengths), np.asarray(channels.tensions)
            heat = channels.temperatures
            if lengths.shape == tensions.shape == order.shape:
                channels = channels._replace(
                    lengths=lengths[order],
                    tensions=tensions[order],
                    temperatures=None if heat is None else np.asarray(heat)[order],
                )
        return channels

    def command(self, target_lengths: Floats) -> Floats:
        """Command (m,) [m] of the robot's channels.

        Args:
            target_lengths: of the agent's muscles (m,) [m].
        """
        if not self.assignment.order:
            return target_lengths
        command = np.empty_like(target_lengths)
        command[self.assignment.channels(len(self._muscles))] = target_lengths
        return command

    def stiffness(self, muscles: Floats | None) -> Floats | None:
        """K_stiff (m,) [N/m] of the robot's channels, by that of the agent's muscles."""
        if muscles is None or not self.assignment.order:
            return muscles
        return muscles[np.argsort(self.assignment.channels(len(self._muscles)))]

    def watch(
        self, readings: SensorReadings, expected: Floats, motors: MotorControl, in_use: Bools
    ) -> None:
        """Find muscles that are lost.

        Args:
            readings: of the agent's muscles, as they were measured.
            expected: lengths by the map at the estimate (m,) [m].
            motors: gains and limit.
            in_use: muscles that have not been left out yet (m,).
        """
        passed = readings.time - self._time
        self._time = readings.time
        lengths, tensions = np.asarray(readings.lengths), np.asarray(readings.tensions)
        if not self.watching or not 0.0 < passed < LOST_AFTER or lengths.shape != self._slack.shape:
            return
        residual = lengths - expected
        slack = np.abs(tensions) < SLACK * motors.bias
        self._taut |= tensions >= motors.bias
        begins = slack & (self._slack == 0.0)
        self._residual = np.where(begins, residual, self._residual)
        self._slack = np.where(slack, self._slack + passed, 0.0)
        wound = self._residual - residual > WOUND * self._ranges
        lost = wound & (self._slack >= LOST_AFTER) & in_use
        for muscle in np.flatnonzero(lost).tolist():
            kind = MUSCLE_SNAPPED if self._taut[muscle] else MUSCLE_ABSENT
            found = Miswiring(kind, (muscle,))
            if found not in self._lost:
                self._lost = (*self._lost, found)

    def reason(self, muscle: int) -> tuple[str, str]:
        """Kind of the fault of a muscle that is left out, and why it is, in some words.

        Args:
            muscle: its number.
        """
        kinds = [one.kind for one in self.assignment.named if muscle in one.muscles]
        kind = next((one for one in reversed(kinds) if one in WHY), MUSCLE_ABSENT)
        return kind, WHY[kind]

    def _name(self, before: Assignment, time: float) -> None:
        """Name what is new."""
        kept = (
            len(before.named) if self.assignment.named[: len(before.named)] == before.named else 0
        )
        self.faults = self.faults[:kept]
        for found in self.assignment.named[kept:]:
            names = [self._muscles[muscle] for muscle in found.muscles]
            detail = self._sentence(found, names)
            self.faults.append(Fault(found.kind, " and ".join(names), time, detail))
            _log.warning("%s.", detail)

    def _sentence(self, found: Miswiring, names: list[str]) -> str:
        """What was found, and what the agent does."""
        out = set(found.muscles) <= set(self.assignment.left_out)
        then = "it is left out" if out else "it stays in use, because too few others are left"
        if found.kind == MUSCLES_SWAPPED:
            return (
                f"{names[0]} and {names[1]} are exchanged: each reads and moves the path of the "
                "other; the agent has exchanged them back: leave the connectors as they are while "
                "it uses this memory"
            )
        return f"{names[0]}: {WHY[found.kind]}; {then}"

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
from jmm_agent.muscle_order import MuscleOrder
from jmm_agent.muscles_in_use import MusclesInUse
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
        self.assignment, self._order = Assignment(), self._order_of(Assignment())
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
        self._order = self._order_of(assignment)
        self._lost = tuple(one for one in self._lost if one in assignment.named)
        self._name(before, time)
        return step_between(before, assignment, count)

    def _order_of(self, assignment: Assignment) -> MuscleOrder | None:
        """Order of the channels; None if each muscle has its own."""
        if not assignment.order:
            return None
        order, ones = assignment.channels(len(self._muscles)), np.ones(len(self._muscles))
        return MuscleOrder(self._muscles, len(order), order, order, order, ones, ones, ones)

    def readings(self, channels: SensorReadings) -> SensorReadings:
        """Readings (m,) of the agent's muscles.

        Args:
            channels: readings of the robot's channels.

        Raises:
            AgentError: muscles are exchanged, and there are not m lengths and m tensions.
        """
        return channels if self._order is None else self._order.readings(channels)

    def command(self, target_lengths: Floats, channels: SensorReadings) -> Floats:
        """Command (m,) [m] of the robot's channels.

        Args:
            target_lengths: of the agent's muscles (m,) [m].
            channels: readings of the robot's channels.
        """
        if self._order is None:
            return target_lengths
        return self._order.command(target_lengths, channels)

    def stiffness(self, muscles: Floats | None) -> Floats | None:
        """K_stiff (m,) [N/m] of the robot's channels, by that of the agent's muscles."""
        if muscles is None or self._order is None:
            return muscles
        return self._order.stiffness(muscles, idle=0.0)  # every channel has a muscle

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

    def use(self, in_use: MusclesInUse, before: Bools, time: float) -> bool:
        """Use the muscles that the wiring leaves, and those again that it has got back.

        Args:
            in_use: which muscles are in use; changed.
            before: muscles that were left out before `apply` (m,).
            time: of the last control step [s].

        Returns:
            Whether other muscles are in use than before.
        """
        changed, left_out = False, self.left_out
        for number, muscle in enumerate(self._muscles):
            if left_out[number] and in_use.learned.sum() > 1:
                kind, why = self.reason(number)
                changed |= in_use.leave_out(muscle, time, why, kind)
            elif before[number] and not left_out[number]:
                changed |= in_use.repaired(muscle, offset_is_open=False)
        return changed

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
            if not self._is_left_out(found):  # that is logged where a muscle leaves use
                _log.warning("%s.", detail)

    def _is_left_out(self, found: Miswiring) -> bool:
        return {*found.muscles} <= {*self.assignment.left_out}

    def _sentence(self, found: Miswiring, names: list[str]) -> str:
        """What was found, and what the agent does."""
        then = (
            "it is left out"
            if self._is_left_out(found)
            else "it stays in use, because too few others are left"
        )
        if found.kind == MUSCLES_SWAPPED:
            return (
                f"{names[0]} and {names[1]} are exchanged: each reads and moves the path of the "
                "other; the agent has exchanged them back: leave the connectors as they are while "
                "it uses this memory"
            )
        return f"{names[0]}: {WHY[found.kind]}; {then}"

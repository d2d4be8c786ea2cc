"""Encoders that stick, jump or die, tension sensors that drop out, wires that snap."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jmm_agent.guard.faults import (
    ENCODER_DEAD,
    ENCODER_JUMP,
    ENCODER_STUCK,
    MUSCLE_SNAPPED,
    TENSION_SENSOR_DEAD,
    MotorControl,
)
from jmm_agent.types import Bools, Floats


@dataclass(frozen=True)
class MuscleMonitorOptions:
    """From when on a reading is not believed.

    Attributes:
        stuck_after: an encoder that is known to be noisy sticks if it reads the same so long [s].
        noisy_steps: so many steps with an unchanged command tell whether an encoder is noisy.
        still: a reading that was the same so long may have been late, and may catch up [s].
        speed: no wire moves faster [m/s]; a reading that does has jumped.
        offset: a reading that is off by less after its jumps is believed again [m].
        moved_share: so is one that differs from what the other wires tell by as much as before it
            jumped, give or take this share of the jump [1] ...
        moved_after: ... for so long: the wire moved, and its encoder was right [s].
        moved_before: that is, so many steps before, for a yank takes some.
        slack_share: a tension below this share of T_bias is none [1].
        numb_after: for so long, and the sensor is dead [s] ...
        wound_up: ... unless the wire shortened by this meanwhile: then it has snapped [m].
        doubt_after: without tension for so long a wire is doubted, whatever the reason [s].
    """

    stuck_after: float = 0.4
    noisy_steps: int = 50
    still: float = 0.1
    speed: float = 0.6
    offset: float = 0.006
    moved_share: float = 0.3
    moved_after: float = 1.0
    moved_before: int = 25
    slack_share: float = 0.25
    numb_after: float = 0.5
    wound_up: float = 0.02
    doubt_after: float = 0.05


class FilteredReadings(NamedTuple):
    """Readings that can be used, and which of them are not to be believed.

    Attributes:
        lengths: measured lengths (m,) [m]; the last usable one where there is no number.
        tensions: measured tensions (m,) [N]; what the motors were told where they are numb.
        doubted: whose length is not to be believed (m,).
        numb: whose tension is not to be believed (m,).
        unsafe: which wires must not pull by their encoder (m,).
    """

    lengths: Floats
    tensions: Floats
    doubted: Bools
    numb: Bools
    unsafe: Bools


class MuscleMonitor:
    """Watches each wire by its own encoder and tension sensor.

    Args:
        muscles: names of the m muscles.
        motors: how commands become tensions.
        options: thresholds.
    """

    def __init__(
        self, muscles: tuple[str, ...], motors: MotorControl, options: MuscleMonitorOptions
    ) -> None:
        self._muscles, self._motors, self._options = muscles, motors, options
        self._quiet = np.zeros(len(muscles))
        self._jitter = np.zeros(len(muscles))
        self.reset()

    def reset(self) -> None:
        """Forget all readings, as at the start of an episode; keep which encoders are noisy."""
        count = len(self._muscles)
        self._begun = False
        self._offset = np.zeros(count)
        self._residuals: deque[Floats] = deque(maxlen=self._options.moved_before)
        self._residual_before_jump = np.zeros(count)
        self._as_before = np.zeros(count)
        self._unchanged = np.zeros(count)
        self._slack_time = np.zeros(count)
        self._slack_residual = np.zeros(count)
        self._dead, self._stuck, self._numb, self._snapped = np.zeros((4, count), dtype=bool)

    def update(
        self, dt: float, lengths: Floats, tensions: Floats, command: Floats, expected: Floats
    ) -> FilteredReadings:
        """Take what was measured while ``command`` was held.

        Args:
            dt: time since the last readings [s].
            lengths, tensions: as they were read (m,) [m], [N]; may be no numbers.
            command: target lengths (m,) [m].
            expected: lengths (m,) [m] by the map where the arm is believed to be.
        """
        if not self._begun:
            self._reading, self._command = expected.copy(), command.copy()
        self._dead = ~np.isfinite(lengths)
        reading = np.where(self._dead, self._reading, lengths)
        residual = reading - expected
        self._watch_encoders(dt, reading, command)
        self._watch_jumps(dt, residual)
        tensions = self._watch_tensions(dt, reading, tensions, command, residual)
        self._reading, self._command, self._begun = reading, command.copy(), True
        self._residuals.append(residual)
        unsafe = self._dead | self._stuck | self._jumped | self._snapped
        undecided = (self._slack_time >= self._options.doubt_after) & ~self._numb
        slack = self._slack_time > 0.0
        return FilteredReadings(reading, tensions, unsafe | undecided, self._numb | slack, unsafe)

    @property
    def _jumped(self) -> Bools:
        return self._offset != 0.0

    def _watch_encoders(self, dt: float, reading: Floats, command: Floats) -> None:
        options = self._options
        moved, waited = reading - self._reading, self._unchanged + dt
        fresh = moved != 0.0
        since = np.where(waited < options.still, dt, waited)
        if self._begun:
            jumped = np.abs(moved) > options.speed * since
            first = jumped & ~self._jumped
            self._residual_before_jump[first] = self._residuals[0][first]
            self._offset += np.where(jumped, moved, 0.0)
            self._offset[np.abs(self._offset) < options.offset] = 0.0
            quiet = (command == self._command) & ~self._stuck & ~self._dead
            self._quiet += quiet
            self._jitter += quiet & fresh
        self._unchanged = np.where(fresh, 0.0, waited)
        noisy = (self._quiet >= options.noisy_steps) & (self._jitter > 0.5 * self._quiet)
        self._stuck = noisy & (self._unchanged >= options.stuck_after) & ~self._dead

    def _watch_jumps(self, dt: float, residual: Floats) -> None:
        """Believe encoders again that jumped with their wires, as the other wires tell."""
        options = self._options
        change = np.abs(residual - self._residual_before_jump)
        as_before = self._jumped & (change < options.moved_share * np.abs(self._offset))
        self._as_before = np.where(as_before, self._as_before + dt, 0.0)
        self._offset[self._as_before >= options.moved_after] = 0.0

    def _watch_tensions(
        self, dt: float, reading: Floats, tensions: Floats, command: Floats, residual: Floats
    ) -> Floats:
        options = self._options
        missing = ~np.isfinite(tensions)
        slack = ~missing & (np.nan_to_num(tensions) < options.slack_share * self._motors.bias)
        begins = slack & (self._slack_time == 0.0)
        self._slack_residual[begins] = residual[begins]
        self._slack_time = np.where(slack, self._slack_time + dt, 0.0)
        wound_up = residual - self._slack_residual < -options.wound_up
        lasting = self._slack_time >= options.doubt_after
        self._snapped = lasting & (self._snapped | (wound_up & ~self._numb))
        self._numb = missing | ((self._slack_time >= options.numb_after) & ~self._snapped)
        demanded = np.minimum(self._motors.demanded(reading, command), self._motors.limit)
        return np.where(self._numb, demanded, tensions)

    def found(self) -> Iterator[tuple[str, str]]:
        """Kind and muscle of every fault that is seen now."""
        intact = ~self._snapped & ~self._dead
        for kind, muscles in (
            (ENCODER_DEAD, self._dead),
            (MUSCLE_SNAPPED, self._snapped),
            (TENSION_SENSOR_DEAD, self._numb),
            (ENCODER_STUCK, self._stuck & intact),
            (ENCODER_JUMP, self._jumped & intact & ~self._stuck & self._decided),
        ):
            for index in np.flatnonzero(muscles):
                yield kind, self._muscles[index]

    @property
    def _decided(self) -> Bools:
        """Whether it is known of a wire that it has not snapped."""
        return (self._slack_time == 0.0) | self._numb

"""Monitor of each muscle: stuck, jumped or dead encoders, dead tension sensors, snapped muscles."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from statistics import median
from typing import NamedTuple

import numpy as np

from jmm_agent.guard.encoder_noise import EncoderNoise
from jmm_agent.guard.faults import (
    ENCODER_DEAD,
    ENCODER_JUMP,
    ENCODER_STUCK,
    MUSCLE_SNAPPED,
    TENSION_SENSOR_DEAD,
    MotorControl,
)
from jmm_agent.guard.recent import ROUNDING, Recent
from jmm_agent.types import Bools, Floats

STEPS = 9
"""Number of newest control steps whose median is the usual one."""


@dataclass(frozen=True)
class MuscleMonitorOptions:
    """Thresholds from which on readings of a muscle are not believed.

    Attributes:
        stuck_after: a noisy encoder is stuck if its reading stays the same for this time [s], and
            longer if its noise is small beside its resolution, see `encoder_noise`.
        quiet: a muscle is at rest if its command has changed by less than this speed [m/s] ...
        quiet_after: ... for this time [s].
        still: after a reading stayed the same for this time it may catch up at once [s].
        speed: a reading that changes faster has jumped [m/s]; no muscle does.
        offset: a reading is believed again if all its jumps add up to less than this [m].
        moved_share: a reading is also believed again if its residual against the map at the
            estimate is as before the jump, within this share of the jump [1] ...
        moved_after: ... for this time: then the muscle moved, and its encoder was right [s].
        moved_before: time before the jump at which that residual is taken, because a yank lasts
            some time [s].
        slack_share: a tension below this share of T_bias counts as none [1].
        numb_after: a sensor without tension for this time is dead [s], ...
        wound_up: ... unless the muscle has shortened by this meanwhile: then it has snapped [m].
        doubt_after: a muscle without tension for this time is in doubt for any reason [s].
    """

    stuck_after: float = 0.4
    quiet: float = 0.001
    quiet_after: float = 0.1
    still: float = 0.1
    speed: float = 0.6
    offset: float = 0.006
    moved_share: float = 0.3
    moved_after: float = 1.0
    moved_before: float = 0.5
    slack_share: float = 0.25
    numb_after: float = 0.5
    wound_up: float = 0.02
    doubt_after: float = 0.05


class FilteredReadings(NamedTuple):
    """Readings of m muscles of which each can be used, and which of them are in doubt.

    Attributes:
        lengths: measured lengths (m,) [m]; the last finite one if there is none.
        tensions: measured tensions (m,) [N]; the commanded ones for dead sensors.
        doubted: muscles whose length is in doubt (m,).
        numb: muscles whose tension is in doubt (m,).
        unsafe: muscles that must not pull by their encoder (m,).
    """

    lengths: Floats
    tensions: Floats
    doubted: Bools
    numb: Bools
    unsafe: Bools


class MuscleMonitor:
    """Watches each muscle by its own encoder and tension sensor.

    Args:
        muscles: names of the m muscles.
        motors: how commands become tensions.
        options: thresholds.

    Attributes:
        motors: as given; may be replaced.
    """

    def __init__(
        self, muscles: tuple[str, ...], motors: MotorControl, options: MuscleMonitorOptions
    ) -> None:
        self._muscles, self.motors, self._options = muscles, motors, options
        self._noise = EncoderNoise(len(muscles))
        self._residuals = Recent[Floats](options.moved_before)
        self.reset()

    def reset(self) -> None:
        """Forget all readings, as at the start of an episode; keep which encoders are noisy."""
        count = len(self._muscles)
        self._quiet = np.zeros(count)
        self._steps: deque[float] = deque(maxlen=STEPS)
        self.jump()
        self._offset, self._jumped = np.zeros(count), np.zeros(count, dtype=bool)
        self._residuals.clear()
        self._residual_before_jump = np.zeros(count)
        self._as_before = np.zeros(count)
        self._unchanged = np.zeros(count)
        self._slack_time = np.zeros(count)
        self._slack_residual = np.zeros(count)
        self._dead, self._stuck, self._numb, self._snapped = np.zeros((4, count), dtype=bool)

    def jump(self) -> None:
        """Forget the last readings, with which the next ones cannot be compared."""
        self._begun = False
        self._noise.jump()

    def forget(self, muscles: Bools) -> None:
        """Forget what was found of muscles (m,) that were mounted anew."""
        for found in (self._offset, self._as_before, self._unchanged, self._slack_time):
            found[muscles] = 0.0
        for found in (self._jumped, self._stuck, self._numb, self._snapped):
            found[muscles] = False

    def update(
        self, dt: float, lengths: Floats, tensions: Floats, command: Floats, expected: Floats
    ) -> FilteredReadings:
        """Add the readings of one control step.

        Args:
            dt: time since the last readings [s].
            lengths: as they were read (m,) [m]; some may be not finite.
            tensions: as they were read (m,) [N]; some may be not finite.
            command: target lengths (m,) [m] while they were measured.
            expected: muscle lengths (m,) [m] by the map at the estimate.
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
        self._residuals.add(dt, residual)
        unsafe = self._unsafe
        undecided = (self._slack_time >= self._options.doubt_after - ROUNDING) & ~self._numb
        slack = self._slack_time > 0.0
        return FilteredReadings(reading, tensions, unsafe | undecided, self._numb | slack, unsafe)

    @property
    def _unsafe(self) -> Bools:
        """Muscles that must not pull by their encoder (m,)."""
        return self._dead | self._stuck | self._jumped | self._snapped

    def _watch_encoders(self, dt: float, reading: Floats, command: Floats) -> None:
        """Find jumps and stuck encoders."""
        options = self._options
        moved, waited = reading - self._reading, self._unchanged + dt
        fresh = moved != 0.0
        self._steps.append(dt)  # the stamps of two readings may be closer than the readings
        since = np.where(waited < options.still, max(dt, median(self._steps)), waited)
        if self._begun:
            self._add_jumps(moved, np.abs(moved) > options.speed * since)
            quiet = np.abs(command - self._command) <= options.quiet * dt
            self._quiet = np.where(quiet, self._quiet + dt, 0.0)
            sound = ~(self._stuck | self._dead | self._jumped)
            self._noise.update(dt, moved, (self._quiet > options.quiet_after) & sound)
        self._unchanged = np.where(fresh, 0.0, waited)
        stuck = self._unchanged >= options.stuck_after - ROUNDING
        if stuck.any():
            stuck &= self._noise.are_stuck() & ~self._dead
            self._noise.forgive(stuck)
        self._stuck = stuck

    def _add_jumps(self, moved: Floats, jumped: Bools) -> None:
        """Add the changes (m,) [m] of readings that jumped (m,) to their offsets."""
        first = jumped & ~self._jumped
        if first.any():
            self._residual_before_jump[first] = self._residuals.oldest[first]
        if jumped.any():
            self._offset += np.where(jumped, moved, 0.0)
            self._offset[np.abs(self._offset) < self._options.offset] = 0.0
            self._jumped = self._offset != 0.0

    def _watch_jumps(self, dt: float, residual: Floats) -> None:
        """Believe encoders again that jumped because their muscles moved."""
        options = self._options
        if not self._jumped.any():
            self._as_before[:] = 0.0
            return
        change = np.abs(residual - self._residual_before_jump)
        as_before = self._jumped & (change < options.moved_share * np.abs(self._offset))
        self._as_before = np.where(as_before, self._as_before + dt, 0.0)
        self._offset[self._as_before >= options.moved_after - ROUNDING] = 0.0
        self._jumped = self._offset != 0.0

    def _watch_tensions(
        self, dt: float, reading: Floats, tensions: Floats, command: Floats, residual: Floats
    ) -> Floats:
        """Find dead sensors and snapped muscles; tensions (m,) [N] that can be used."""
        options = self._options
        if ((tensions >= options.slack_share * self.motors.bias) & (tensions < np.inf)).all():
            self._slack_time[:] = 0.0
            self._snapped[:] = self._numb[:] = False
            return tensions.copy()
        missing = ~np.isfinite(tensions)
        slack = ~missing & (np.nan_to_num(tensions) < options.slack_share * self.motors.bias)
        begins = slack & (self._slack_time == 0.0)
        self._slack_residual[begins] = residual[begins]
        self._slack_time = np.where(slack, self._slack_time + dt, 0.0)
        wound_up = residual - self._slack_residual < -options.wound_up
        lasting = self._slack_time >= options.doubt_after - ROUNDING
        self._snapped = lasting & (self._snapped | (wound_up & ~self._numb))
        lasting = self._slack_time >= options.numb_after - ROUNDING
        self._numb = missing | (lasting & ~self._snapped)
        demanded = np.minimum(self.motors.demanded(reading, command), self.motors.limit)
        return np.where(self._numb, demanded, tensions)

    def found(self) -> Iterator[tuple[str, str]]:
        """Kind and muscle of every fault that is found now."""
        if not (self._unsafe | self._numb).any():
            return
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
        """Whether it is known that a muscle has not snapped (m,)."""
        return (self._slack_time == 0.0) | self._numb

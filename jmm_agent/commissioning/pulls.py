"""Sequence of commands that pulls each muscle in turn, and what was measured meanwhile.

1. All muscles hold the lengths that they have, for a second; the noise is measured. A muscle that
   pulls too much is released.
2. Muscles at T_bias are tightened until all pull a little: a muscle at T_bias responds to nothing.
3. Each muscle is shortened by a stroke and let out again, while all others hold. The responses are
   means at rest, against the mean of the rests before and after, so that a slow drift cancels.
   A stroke ends where a tension exceeds its limit. A muscle that does not pull is first shortened
   until it does, unless others move; or else lengthened, because its motor may be reversed.

Times are those of the stamps; a gap in them stops the sequence for as long.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence

import numpy as np

from jmm_agent.commissioning.options import CommissionOptions
from jmm_agent.commissioning.pull_control import FEWEST, MUCH, NOISES, Cycles, Means, PullControl
from jmm_agent.commissioning.pull_record import PullRecord
from jmm_agent.guard.faults import MotorControl
from jmm_agent.observation import SensorReadings
from jmm_agent.time_line import TimeLine, TimeLineOptions
from jmm_agent.types import Floats

RELEASED = 4.0
"""How far a muscle is released at most, in travels, and how many travels in a second [1]."""
SLACK = 0.5
"""Tension below which a muscle is slack, as a share of T_bias [1]."""
PULLS = 0.5
"""Tension beyond T_bias from which on a muscle responds to its command, as a share of the tension
to which muscles are tightened beyond T_bias [1]."""
MOVED = 0.15
"""Change of another muscle's length at which a muscle is shortened no farther, as a share of the
stroke [1]."""
TAUT = 0.03
"""Change of another muscle's tension, likewise, as a share of the limit [1]."""


class PullSequence(PullControl):
    """Gives the next command from readings, until it is done.

    Args:
        muscles: names of the m muscles.
        motors: gains and limit.
        travel: how far the muscles move between the joint limits [m].
        options: how they are pulled; the defaults if left out.
        held: target lengths (m,) [m] that the motors hold now; the first readings if left out. A
            first command that contradicts the motors' own encoders moves the arm at once.

    Attributes:
        stage: what is done now, in a few words.
        done: whether the sequence has ended; later commands hold.
    """

    def __init__(
        self,
        muscles: Sequence[str],
        motors: MotorControl,
        travel: float,
        options: CommissionOptions | None = None,
        held: Floats | None = None,
    ) -> None:
        super().__init__(tuple(muscles), motors, travel, options or CommissionOptions())
        self.stage, self.done = "rest", False
        count = len(self._muscles)
        self._clock, self._begin = TimeLine(TimeLineOptions()), -np.inf
        self._held_before = None if held is None else np.array(held, dtype=float)
        self._strokes, self._released = np.zeros((2, count))
        self._taken_up, self._signs = np.full(count, np.nan), np.ones(count)
        self._ended, self._slack = np.zeros((2, count), dtype=bool)
        self._first, self._before = np.zeros(count), np.full((count, count), np.nan)
        self._responses = np.full((2, count, count), np.nan)
        self._rest: Means = self._lengths, self._tensions
        self._procedure = self._all()

    def step(self, readings: SensorReadings) -> Floats:
        """Run one control step.

        Args:
            readings: of m muscles. Those that are not later than the ones before are skipped.

        Returns:
            Target muscle lengths (m,) [m] for the next control period.

        Raises:
            AgentError: readings of the wrong shape, or none of the lengths is finite.
        """
        first = not np.isfinite(self._begin)
        tick = self._clock.tick(readings.time)
        if tick is None:
            return self._command.copy()
        readings = readings._replace(time=tick.time)
        readings = readings.checked(-np.inf, len(self._muscles), gaps=True)
        if first:
            self._check_first(readings)
        self._clock.accept(tick)
        if self.done:
            return self._command.copy()
        if first:
            held = self._held_before
            self._command = readings.lengths.copy() if held is None else held.copy()
            self._begin = self._time = readings.time
            self._accept(readings)
            self._first[:] = readings.lengths
            return next(self._procedure)
        try:
            return self._procedure.send(readings)
        except StopIteration:
            self.done = True
            return self._command.copy()

    @property
    def record(self) -> PullRecord:
        """What was measured until now."""
        others = np.where(np.eye(len(self._muscles), dtype=bool), np.nan, self._responses[0])
        others[self._running] = np.nan
        moved = float(np.max(np.abs(others), where=np.isfinite(others), initial=0.0))
        return PullRecord(
            self._muscles,
            self._strokes.copy(),
            self._responses[0].copy(),
            self._responses[1].copy(),
            self._noise[0].copy(),
            self._noise[1].copy(),
            self._rest[0].copy(),
            self._rest[1].copy(),
            self._taken_up.copy(),
            self._ended.copy(),
            self._released.copy(),
            self._largest,
            moved,
            max(0.0, self._time - self._begin),
            self._travel,
            self._motors,
            self._before.copy(),
            self._running.copy(),
            self._first.copy(),
        )

    def _all(self) -> Cycles:
        """The whole sequence."""
        yield from self._settled()
        yield from self._tightened()
        before = self._rest = yield from self._mean()
        self._at_rest = before[1].copy()
        count = yield from self._held(self._options.measure)
        for muscle, name in enumerate(self._muscles):
            self.stage = f"pull {name}"
            before = yield from self._pulled(muscle, before)
        self._noise /= np.sqrt(len(count))
        self.stage = "done"

    def _settled(self) -> Cycles:
        """Hold, release muscles that pull too much, and measure the noise."""
        begin, found = self._time, list[tuple[Floats, Floats]]()
        while self._time < begin + self._options.rest or len(found) < 2 * FEWEST:
            yield from self._cycle()
            step = RELEASED * self._travel * self._dt
            loose = self._too_much & (self._released < RELEASED * self._travel)
            self._command[loose] += step
            self._released[loose] += step
            found.append((self._lengths.copy(), self._tensions.copy()))
        quiet = found[len(found) // 3 :]
        for noise, values in zip(self._noise, zip(*quiet, strict=True), strict=True):
            noise[:] = np.diff(np.array(values), axis=0).std(axis=0) / np.sqrt(2.0)

    def _tightened(self) -> Cycles:
        """Shorten muscles at T_bias until all of them pull."""
        options, begin = self._options, self._time
        self.stage = "tighten"
        wanted = self._motors.bias + options.pretension * self._limit
        most = options.tightened * self._travel
        shortened = np.zeros(len(self._muscles))
        tensions = np.mean(self._recent, axis=0)[1]
        self._slack[:] = np.abs(tensions) < SLACK * self._motors.bias
        while self._time < begin + options.tighten:
            slack = (np.mean(self._recent, axis=0)[1] < wanted) & (shortened < most)
            slack &= ~self._running & ~self._slack
            if not slack.any() or self._too_much.any():
                break
            step = 2.0 * most / options.tighten * self._dt
            self._command[slack] -= step
            shortened[slack] += step
            yield from self._cycle()
        useless = (np.mean(self._recent, axis=0)[1] < wanted) & (shortened >= most)
        hold = self._command + np.where(useless, shortened, 0.0)
        while (self._command < hold).any():
            step = 2.0 * most / options.tighten * self._dt
            self._command[:] = np.minimum(self._command + step, hold)
            yield from self._cycle()

    def _pulled(self, muscle: int, before: Means) -> Generator[Floats, SensorReadings, Means]:
        """Pull one muscle and let it out again; the mean readings after that."""
        if not self._pulls(muscle):
            yield from self._engaged(muscle)
            before = yield from self._mean()
        hold, sign = float(self._command[muscle]), self._signs[muscle]
        during = yield from self._stroked(muscle, hold - sign * self._stroke)
        fell = before[1][muscle] - during[1][muscle] > 0.5 * TAUT * self._motors.limit
        stroke = hold - float(self._command[muscle])
        if fell and sign > 0.0:
            yield from self._moved(muscle, hold)
            other = yield from self._stroked(muscle, hold + self._stroke)
            if other[1][muscle] - before[1][muscle] > before[1][muscle] - during[1][muscle]:
                during, stroke = other, hold - float(self._command[muscle])
        self._ended[muscle] = abs(stroke) < 0.999 * self._stroke
        yield from self._moved(muscle, hold)
        after = yield from self._mean()
        self._strokes[muscle], self._before[:, muscle] = stroke, before[1]
        for response, *means in zip(self._responses, before, during, after, strict=True):
            response[:, muscle] = means[1] - 0.5 * (means[0] + means[2])
        return after

    def _stroked(self, muscle: int, target: float) -> Generator[Floats, SensorReadings, Means]:
        """Move one command, and the mean readings after that."""
        yield from self._moved(muscle, target, ends=True)
        return (yield from self._mean())

    def _moved(self, muscle: int, target: float, ends: bool = False) -> Cycles:
        """Move one command; a pull ends where a tension is too high."""
        while self._command[muscle] != target and not (ends and self._too_much.any()):
            self._move(muscle, target)
            yield from self._cycle()

    def _move(self, muscle: int, target: float) -> None:
        """Move one command by what it may change in a control period."""
        step = self._stroke / self._options.ramp * self._dt
        self._command[muscle] += np.clip(target - self._command[muscle], -step, step)

    def _pulls(self, muscle: int) -> bool:
        """Whether the tension of a muscle is beyond T_bias, so that it responds to its command."""
        tension = np.mean(self._recent, axis=0)[1, muscle]
        least = self._motors.bias + PULLS * self._options.pretension * self._limit
        return bool(least < tension < MUCH * self._limit)

    def _engaged(self, muscle: int) -> Cycles:
        """Shorten a muscle until it pulls, or else lengthen it: its motor may be reversed."""
        hold = float(self._command[muscle])
        options = self._options
        pulls = False
        tension = float(np.mean(self._recent, axis=0)[1, muscle])
        slack = self._slack[muscle] and abs(tension) < SLACK * self._motors.bias
        for sign, share in ((1.0, options.reach), (-1.0, options.tightened)):
            target = hold - sign * share * self._travel
            pulls = yield from self._sought(muscle, target)
            if pulls:
                self._signs[muscle] = sign
                break
            yield from self._moved(muscle, hold)
        if slack:
            self._taken_up[muscle] = hold - self._command[muscle] if pulls else np.inf

    def _sought(self, muscle: int, target: float) -> Generator[Floats, SensorReadings, bool]:
        """Move one command until its muscle pulls, or others move or pull; whether that was so."""
        begin = np.mean(self._recent, axis=0)
        others = ~self._running
        others[muscle] = False
        least = np.array([[MOVED * self._stroke], [TAUT * self._limit]])
        least = least + NOISES * self._noise
        while self._command[muscle] != target:
            self._move(muscle, target)
            yield from self._cycle()
            change = np.abs(np.mean(self._recent, axis=0) - begin)
            if self._pulls(muscle) or (change > least)[:, others].any():
                return True
        return False

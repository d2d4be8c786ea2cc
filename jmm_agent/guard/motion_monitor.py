"""Monitors of late commands and of external forces on the hand, by the tensions of all muscles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jmm_agent.guard.faults import MotorControl
from jmm_agent.guard.recent import ROUNDING, Recent
from jmm_agent.types import Bools, Floats


@dataclass(frozen=True)
class DelayMonitorOptions:
    """Thresholds of late commands.

    Attributes:
        longest: largest delay that is found [s].
        spacing: difference of the delays that are compared [s].
        window: time over which differences of tensions are averaged [s].
        least: RMS difference of tensions below which nothing is concluded [N].
        share: an older command explains tensions if it leaves less than this share of the
            difference that the newest command leaves [1].
        shortest: smallest delay that counts as late [s], if it is at least two control periods.
    """

    longest: float = 0.2
    spacing: float = 0.02
    window: float = 1.0
    least: float = 10.0
    share: float = 0.5
    shortest: float = 0.04


class DelayMonitor:
    """Compares measured tensions with what the newest and what older commands demand.

    Args:
        motors: how commands become tensions.
        options: thresholds.

    Attributes:
        late: whether commands are late.
        motors: as given; may be replaced.
    """

    def __init__(self, motors: MotorControl, options: DelayMonitorOptions) -> None:
        self.motors, self._options = motors, options
        count = round(options.longest / options.spacing) + 1
        self._delays = (options.spacing * np.arange(count)).tolist()
        self._commands = Recent[Floats](options.longest + 3.0 * ROUNDING)
        self._squares = Recent[Floats](options.window)
        self.reset()

    def reset(self) -> None:
        """Forget all commands."""
        self.late = False
        self.jump()

    def jump(self) -> None:
        """Forget all commands, but not whether they are late."""
        self._commands.clear()
        self._squares.clear()

    def update(
        self, dt: float, lengths: Floats, tensions: Floats, command: Floats, usable: Bools
    ) -> bool:
        """Add the readings of one control step.

        Args:
            dt: time since the last readings [s].
            lengths: measured muscle lengths (m,) [m].
            tensions: measured muscle tensions (m,) [N].
            command: the newest target lengths at that time (m,) [m].
            usable: muscles whose readings can be used (m,).

        Returns:
            Whether commands are late.
        """
        self._commands.add(dt, command.copy())
        if not self._commands.full or not usable.any():
            return self.late
        numbers, commands = zip(*self._commands.at(self._delays), strict=True)
        demanded = self.motors.demanded(lengths, np.array(commands))
        errors = np.minimum(demanded, self.motors.limit) - tensions
        if not usable.all():
            errors = errors[:, usable]
        self._squares.add(dt, np.mean(errors * errors, axis=1))
        if self._squares.full:
            self._compare(numbers)
        return self.late

    def _compare(self, numbers: Sequence[int]) -> None:
        """Compare the mean squares that the newest and older commands leave.

        Args:
            numbers: of the command that stands for each delay, from the newest, which is 0.
        """
        options = self._options
        squares = np.mean(np.array(self._squares.values), axis=0).tolist()
        late = zip(numbers, self._delays, squares, strict=True)
        shortest = options.shortest - ROUNDING
        older = [left for number, delay, left in late if number >= 2 and delay >= shortest]
        if not older:
            return
        least, share, newest = options.least**2, options.share**2, squares[0]
        if newest > least and min(older) < share * newest:
            self.late = True
        elif max(older) > least and newest < share * max(older):
            self.late = False


@dataclass(frozen=True)
class DisturbanceMonitorOptions:
    """Thresholds of pushes.

    Attributes:
        every: least time between two estimates of the force [s].
        average: time over which estimates are averaged, the newest and earlier ones [s].
        between: time between the newest and the earlier ones [s].
        onset: time within which a push begins or ends [s].
        least: smallest change of the force that is a push [N].
        factor: smallest change of the force that is a push, in usual changes [1].
        usual_change: usual change of the force, before it is learned [N].
        usual_memory: time over which the usual change is learned [s].
        end: share of the push by which the force must fall for the push to end [1].
        longest: a force that lasts longer is a load, not a push [s].
        observable: directions in which the joints move the hand by less than this share of the
            direction in which they move it most are left out [1]: no torque shows a force there.
    """

    every: float = 0.04
    average: float = 0.12
    between: float = 0.08
    onset: float = 0.5
    least: float = 22.0
    factor: float = 3.0
    usual_change: float = 20.0
    usual_memory: float = 20.0
    end: float = 0.5
    longest: float = 30.0
    observable: float = 0.03


class DisturbanceMonitor:
    """Estimates the external force on the hand, and finds fast changes of it.

    At rest -G' T + g + J' F = 0 with the muscle Jacobian G, tensions T, torques g of gravity and
    the Jacobian J of the hand. Errors of the map cause an apparent force F, which changes slowly
    as the arm moves; a push begins and ends within a fifth of a second.

    A hand that fewer than three joints move, or a singular posture, leaves directions in which no
    torque shows a force. F is then the smallest force that explains the torques.

    Args:
        options: thresholds.

    Attributes:
        pushed: whether the hand is pushed.
    """

    def __init__(self, options: DisturbanceMonitorOptions) -> None:
        self._options = options
        self._variance = options.usual_change**2
        self._forces = Recent[Floats](2.0 * options.average + options.between)
        self.reset()

    def reset(self) -> None:
        """Forget all forces; keep their usual change."""
        self._forces.clear()
        self._before = self._push = np.zeros(3)
        self._lasted = np.inf
        self.pushed = False

    def jump(self) -> None:
        """Forget the forces before, but not whether the hand is pushed."""
        self._forces.clear()

    def update(
        self,
        dt: float,
        torques: Floats,
        hand_jacobian: Floats,
        rotation: Floats,
        trusted: bool = True,
    ) -> bool:
        """Add one estimate of the force.

        Args:
            dt: time since the last estimate [s]; after more than `onset` the earlier estimates are
                dropped, because they cannot be compared with new ones.
            torques: remaining torques of tensions and gravity in the joints (n,) [N m].
            hand_jacobian: velocity of the hand in its own axes per joint velocity (3, n) [m/rad].
            rotation: orientation of the hand in the world (3, 3).
            trusted: whether the map is trusted; if not, every change is an error of the map.

        Returns:
            Whether the hand is pushed.
        """
        options, forces = self._options, self._forces
        if dt > options.onset:
            forces.clear()
        force = force_of(torques, hand_jacobian, options.observable)
        forces.add(min(dt, options.every), rotation @ force)  # more if a muscle was in doubt
        self._lasted += dt
        earlier = forces.older(options.average + options.between)
        if not forces.full or not earlier:
            return self.pushed
        before = np.mean(earlier, axis=0)
        force = np.mean(forces.newer(options.average), axis=0)
        if self._lasted < options.onset:  # the force is still changing
            self._push = force - self._before
            return self.pushed
        change = force - before
        if self._ends(change) if self.pushed else self._begins(change, dt, trusted):
            self.pushed, self._lasted = not self.pushed, 0.0
            self._push, self._before = change, before
        return self.pushed

    def _begins(self, change: Floats, dt: float, trusted: bool) -> bool:
        """Whether a change of the force (3,) [N] is a push; if not, it is learned as usual."""
        options, size = self._options, float(np.linalg.norm(change))
        least = max(options.least, options.factor * float(np.sqrt(self._variance)))
        if trusted and size > least:
            return True
        share = min(1.0, dt / options.usual_memory)
        self._variance += share * (size**2 - self._variance)
        return False

    def _ends(self, change: Floats) -> bool:
        """Whether a change of the force (3,) [N] ends the push, or the push has lasted too long."""
        back = -float(change @ self._push) / float(self._push @ self._push)
        return back > self._options.end or self._lasted > self._options.longest


def force_of(torques: Floats, hand_jacobian: Floats, observable: float) -> Floats:
    """External force (3,) [N] on the hand, in its axes, that torques in the joints balance.

    Args:
        torques: remaining torques (n,) [N m].
        hand_jacobian: velocity of the hand in its own axes per joint velocity (3, n) [m/rad].
        observable: as in `DisturbanceMonitorOptions`.
    """
    matrix = hand_jacobian @ hand_jacobian.T
    squares = np.linalg.eigvalsh(matrix)  # of the singular values, ascending
    if hand_jacobian.shape[1] >= 3 and squares[0] > observable**2 * squares[-1]:
        return np.asarray(np.linalg.solve(matrix, hand_jacobian @ -torques), dtype=float)
    return np.asarray(np.linalg.lstsq(hand_jacobian.T, -torques, rcond=observable)[0])

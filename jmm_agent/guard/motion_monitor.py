"""Monitors of late commands and of external forces on the hand, by the tensions of all muscles."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from jmm_agent.guard.faults import MotorControl
from jmm_agent.types import Bools, Floats


@dataclass(frozen=True)
class DelayMonitorOptions:
    """Thresholds of late commands.

    Attributes:
        delays: largest delay that is found, in steps.
        window: number of steps over which differences of tensions are averaged.
        least: RMS difference of tensions below which nothing is concluded [N].
        share: an older command explains tensions if it leaves less than this share of the
            difference that the newest command leaves [1].
        shortest: smallest delay that counts as late, in steps.
    """

    delays: int = 10
    window: int = 50
    least: float = 10.0
    share: float = 0.5
    shortest: int = 2


class DelayMonitor:
    """Compares measured tensions with what the newest and what older commands demand.

    Args:
        motors: how commands become tensions.
        options: thresholds.

    Attributes:
        late: whether commands are late.
    """

    def __init__(self, motors: MotorControl, options: DelayMonitorOptions) -> None:
        self._motors, self._options = motors, options
        self.reset()

    def reset(self) -> None:
        """Forget all commands."""
        self._commands: deque[Floats] = deque(maxlen=self._options.delays + 1)
        self._squares: deque[Floats] = deque(maxlen=self._options.window)
        self.late = False

    def update(self, lengths: Floats, tensions: Floats, command: Floats, usable: Bools) -> bool:
        """Add the readings of one control step.

        Args:
            lengths: measured muscle lengths (m,) [m].
            tensions: measured muscle tensions (m,) [N].
            command: the newest target lengths at that time (m,) [m].
            usable: muscles whose readings can be used (m,).

        Returns:
            Whether commands are late.
        """
        options = self._options
        self._commands.appendleft(command.copy())
        if len(self._commands) <= options.delays or not usable.any():
            return self.late
        demanded = self._motors.demanded(lengths, np.array(self._commands))
        errors = np.minimum(demanded, self._motors.limit) - tensions
        self._squares.append(np.mean(errors[:, usable] ** 2, axis=1))
        if len(self._squares) < options.window:
            return self.late
        rms = np.sqrt(np.mean(self._squares, axis=0))
        older = rms[options.shortest :]
        if rms[0] > options.least and older.min() < options.share * rms[0]:
            self.late = True
        elif older.max() > options.least and rms[0] < options.share * older.max():
            self.late = False
        return self.late


@dataclass(frozen=True)
class DisturbanceMonitorOptions:
    """Thresholds of pushes.

    Attributes:
        every: number of steps between two estimates of the force.
        average: number of estimates that are averaged, the newest and earlier ones.
        between: number of estimates between the newest and the earlier ones.
        onset: time within which a push begins or ends [s].
        least: smallest change of the force that is a push [N].
        factor: smallest change of the force that is a push, in usual changes [1].
        usual_change: usual change of the force, before it is learned [N].
        usual_memory: time over which the usual change is learned [s].
        end: share of the push by which the force must fall for the push to end [1].
        longest: a force that lasts longer is a load, not a push [s].
    """

    every: int = 2
    average: int = 3
    between: int = 2
    onset: float = 0.5
    least: float = 22.0
    factor: float = 3.0
    usual_change: float = 20.0
    usual_memory: float = 20.0
    end: float = 0.5
    longest: float = 30.0


class DisturbanceMonitor:
    """Estimates the external force on the hand, and finds fast changes of it.

    At rest -G' T + g + J' F = 0 with the muscle Jacobian G, tensions T, torques g of gravity and
    the Jacobian J of the hand. Errors of the map cause an apparent force F, which changes slowly
    as the arm moves; a push begins and ends within a fifth of a second.

    Args:
        options: thresholds.

    Attributes:
        pushed: whether the hand is pushed.
    """

    def __init__(self, options: DisturbanceMonitorOptions) -> None:
        self._options = options
        self._variance = options.usual_change**2
        self.reset()

    def reset(self) -> None:
        """Forget all forces; keep their usual change."""
        options = self._options
        self._forces: deque[Floats] = deque(maxlen=2 * options.average + options.between)
        self._before = self._push = np.zeros(3)
        self._lasted = np.inf
        self.pushed = False

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
        matrix = hand_jacobian @ hand_jacobian.T
        forces.append(rotation @ np.linalg.solve(matrix, hand_jacobian @ -torques))
        self._lasted += dt
        if len(forces) < (forces.maxlen or 0):
            return self.pushed
        past = np.array(forces)
        before, force = past[: options.average].mean(axis=0), past[-options.average :].mean(axis=0)
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
        self._variance += dt / options.usual_memory * (size**2 - self._variance)
        return False

    def _ends(self, change: Floats) -> bool:
        """Whether a change of the force (3,) [N] ends the push, or the push has lasted too long."""
        back = -float(change @ self._push) / float(self._push @ self._push)
        return back > self._options.end or self._lasted > self._options.longest

"""Commands that come late, and pushes: what tensions tell beyond single wires."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from jmm_agent.guard.faults import MotorControl
from jmm_agent.types import Bools, Floats


@dataclass(frozen=True)
class DelayMonitorOptions:
    """When commands count as late.

    Attributes:
        delays: how many steps late commands may be.
        window: number of steps that are judged together.
        least: RMS difference of tensions that says anything [N].
        share: an older command explains tensions if it leaves this share of the difference [1].
        shortest: number of steps from which on it is called late.
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
        """Take what was measured (m,) [m], [N] while ``command`` (m,) [m] was the newest; whether
        commands are late. Only ``usable`` wires (m,) are asked."""
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
    """When a force on the hand counts as a push.

    Attributes:
        every: number of steps between two estimates of the force.
        average: number of estimates that are averaged, now and before.
        between: number of estimates between those.
        onset: time in which a push comes and goes [s].
        least: no smaller change of the force is a push [N].
        factor: nor one below this many times its usual change [1].
        usual_change: what is thought of that at first [N].
        usual_memory: time over which it is learned [s].
        end: share of the push by which the force must go back for the push to be over [1].
        longest: a force that stays for longer is no push, but a load [s].
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
    """Finds the force on the hand that balances tensions and gravity best, and sees it change.

    At rest -G' T + g + J' F = 0 with the muscle Jacobian G, gravity's torques g and the hand's
    Jacobian J. A map with errors shows a force F that is not there, but as the arm moves that
    changes slowly; a push comes and goes within a fifth of a second.
    """

    def __init__(self, options: DisturbanceMonitorOptions) -> None:
        self._options = options
        self._variance = options.usual_change**2
        self.reset()

    def reset(self) -> None:
        """Forget all forces; keep how much they usually change."""
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
        """Take one estimate; whether the hand is pushed.

        Args:
            dt: time since the last estimate [s]; after more than `onset` all begins anew, for
                what comes cannot be compared with what was before.
            torques: what tensions and gravity leave in the joints (n,) [N m].
            hand_jacobian: velocity of the hand in its own axes per joint (3, n) [m/rad].
            rotation: of the hand in the world (3, 3).
            trusted: whether the map is; as long as it is not, every change is the map's error.
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
        if self._lasted < options.onset:  # the force is still on its way to what it will be
            self._push = force - self._before
            return self.pushed
        change = force - before
        if self._ends(change) if self.pushed else self._begins(change, dt, trusted):
            self.pushed, self._lasted = not self.pushed, 0.0
            self._push, self._before = change, before
        return self.pushed

    def _begins(self, change: Floats, dt: float, trusted: bool) -> bool:
        """Whether a change of the force (3,) [N] is a push; learns how much it usually changes."""
        options, size = self._options, float(np.linalg.norm(change))
        least = max(options.least, options.factor * float(np.sqrt(self._variance)))
        if trusted and size > least:
            return True
        self._variance += dt / options.usual_memory * (size**2 - self._variance)
        return False

    def _ends(self, change: Floats) -> bool:
        """Whether a change of the force (3,) [N] takes the push back, or it has been too long."""
        back = -float(change @ self._push) / float(self._push @ self._push)
        return back > self._options.end or self._lasted > self._options.longest

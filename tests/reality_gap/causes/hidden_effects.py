"""Real machines with an effect each; see `hidden_arm`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reality_gap.types import Floats
from tests.reality_gap.causes.hidden_arm import LIMIT, PERIOD, ROTOR, SETTLE, STEP, Machine


@dataclass
class WeakAtSpeed(Machine):
    """A motor whose largest torque falls to none at a no-load speed of 2 rad/s."""

    motors: bool = True

    def command(self, time: float) -> Floats:
        """Commands up to the limit."""
        return 2.2 * super().command(time)

    def clip(self, force: Floats, speed: Floats) -> Floats:
        """The elbow's limit falls with the speed in whose direction it drives."""
        low, high = -LIMIT.copy(), LIMIT.copy()
        high[1] *= min(max(1.0 - speed[1] / 2.0, 0.0), 1.0)
        low[1] *= min(max(1.0 + speed[1] / 2.0, 0.0), 1.0)
        return np.clip(force, low, high)


@dataclass
class SlowServo(Machine):
    """A servo whose set point moves at 1.2 rad/s at most."""

    def force(self, error: Floats, speed: Floats, target: Floats) -> Floats:
        """The error from the set point, which follows the target."""
        here = self.memory.setdefault("point", target.copy())
        most = np.array([np.inf, 1.2 * STEP])
        point = here + np.clip(target - here, -most, most)
        self.memory["point"] = point
        return super().force(error + point - target, speed, target)


@dataclass
class CoupledMotor(Machine):
    """The elbow's motor sits at the base, and turns by 0.15 of the shoulder, too."""

    def encoder(self, q: Floats, force: Floats) -> Floats:
        """The elbow's encoder is on its motor."""
        return q[:2] + np.array([0.0, 0.15 * q[0]])

    def force(self, error: Floats, speed: Floats, target: Floats) -> Floats:
        """The speed is that of the motor."""
        return super().force(error, speed + np.array([0.0, 0.15 * speed[0]]), target)

    def transmit(self, force: Floats) -> Floats:
        """Its belt runs over the shoulder."""
        return force + np.array([0.15 * force[1], 0.0])


@dataclass
class LinkedTip(Machine):
    """A linkage lets the tip follow the elbow by a ratio of 0.6."""

    tip: bool = True

    def passive(self, q: Floats, v: Floats, force: Floats) -> Floats:
        """A stiff spring between tip and elbow."""
        pull = 40.0 * (0.6 * q[1] - q[2]) + 0.9 * (0.6 * v[1] - v[2])
        return np.array([0.0, -0.6 * pull, pull])


class Bristle:
    """Dry friction as a spring that slips; see P. Dahl, 1968."""

    def __init__(self, width: float) -> None:
        self.width, self.bend = width, 0.0

    def __call__(self, speed: float, level: float) -> float:
        """Friction of this step, which opposes the speed."""
        keep = np.exp(-abs(speed) * STEP / self.width)
        self.bend = np.sign(speed) * (1.0 - keep) + self.bend * keep
        return -level * self.bend


@dataclass
class SticksAtRest(Machine):
    """The elbow has 0.8 N m of dry friction at rest, and none at speed."""

    def passive(self, q: Floats, v: Floats, force: Floats) -> Floats:
        """Stribeck friction with a velocity of 0.2 rad/s."""
        bristle = self.memory.setdefault("bristle", Bristle(3e-4))
        level = 0.8 * np.exp(-((v[1] / 0.2) ** 2))
        return np.array([0.0, bristle(float(v[1]), float(level))])


@dataclass
class RubbingGear(Machine):
    """The shoulder's gear loses a quarter of its torque."""

    def passive(self, q: Floats, v: Floats, force: Floats) -> Floats:
        """Friction in proportion to the torque."""
        bristle = self.memory.setdefault("bristle", Bristle(4e-3))
        return np.array([bristle(float(v[0]), 0.25 * abs(float(force[0]))), 0.0])


@dataclass
class ElasticGear(Machine):
    """The elbow's gear gives way by 10 mrad per N m, in front of its rotor with the encoder."""

    motors: bool = True
    rotors: tuple[str, ...] = ("elbow",)

    def encoder(self, q: Floats, force: Floats) -> Floats:
        """The rotor is ahead of the link."""
        return np.array([q[0], self.memory.setdefault("rotor", np.array([q[1], 0.0]))[0]])

    def passive(self, q: Floats, v: Floats, force: Floats) -> Floats:
        """The spring pulls the link instead of the motor, which accelerates its rotor."""
        position, speed = self.memory["rotor"]
        torque = (position - q[1]) / 0.01
        speed += STEP * (force[1] - torque) / ROTOR
        self.memory["rotor"] = np.array([position + STEP * speed, speed])
        return np.array([0.0, torque - force[1]])


@dataclass
class MirroredReading(Machine):
    """The log has the elbow's position with the wrong sign."""

    motors: bool = True

    def encoder(self, q: Floats, force: Floats) -> Floats:
        """No motor needs it."""
        return q[:2] * np.array([1.0, -1.0])


@dataclass
class DeadBand(Machine):
    """The elbow's servo ignores errors below 0.02 rad."""

    def force(self, error: Floats, speed: Floats, target: Floats) -> Floats:
        """The error less its part within the band."""
        seen = error.copy()
        seen[1] -= np.clip(error[1], -0.02, 0.02)
        return super().force(seen, speed, target)


@dataclass
class DeadMotor(Machine):
    """The elbow's motor ignores commands below 0.4 N m."""

    motors: bool = True

    def target(self, command: Floats) -> Floats:
        """The command less its part within the dead zone."""
        found = command.copy()
        found[1] -= np.clip(command[1], -0.4, 0.4)
        return found


@dataclass
class StruckArm(Machine):
    """A wheel with a bump presses on the lower link each 1.3 s, or at other times."""

    strikes: tuple[float, ...] = tuple(0.4 + 1.3 * k for k in range(20))

    def passive(self, q: Floats, v: Floats, force: Floats) -> Floats:
        """Torques of a force of -5 N along z at the middle of the lower link for 0.2 s.

        It rises and falls within 40 ms.
        """
        steps = self.memory.setdefault("steps", np.zeros(1))
        time = float(steps[0]) * STEP - SETTLE
        steps += 1.0
        edges = (min(time - begin, begin + 0.2 - time) / 0.04 for begin in self.strikes)
        down = 5.0 * sum(min(max(edge, 0.0), 1.0) for edge in edges)
        lower = 0.125 * np.cos(q[0] + q[1])
        return down * np.array([0.3 * np.cos(q[0]) + lower, lower])


@dataclass
class FastClock(Machine):
    """The clock of the sensors runs 1 % fast."""

    def log_time(self, time: Floats) -> Floats:
        """Later and later stamps."""
        return 1.01 * time


@dataclass
class EarlyStamps(Machine):
    """All readings are stamped 30 ms before they are taken."""

    def log_time(self, time: Floats) -> Floats:
        """Earlier stamps."""
        return time - 1.5 * PERIOD

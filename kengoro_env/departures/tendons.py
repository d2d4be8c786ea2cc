"""Departures of the tendons and their motors: stretch, elongation, dry friction, inertia."""

from __future__ import annotations

from dataclasses import dataclass

from kengoro_env.robot.draft import Draft, Event


@dataclass(frozen=True)
class TendonStretch:
    """Tendons are hardening springs.

    The tension is T = x / compliance + hardening x^2 for a stretch x > 0, and 0 for a slack tendon.

    Attributes:
        compliance: stretch per tension at small tensions [m/N].
        hardening: coefficient of the quadratic term [N/m^2].
    """

    compliance: float = 0.0
    hardening: float = 0.0

    def edit(self, draft: Draft) -> None:
        """Give every tendon a spool and its stiffness."""
        if self.compliance == 0.0:
            return
        for tendon in draft.tendons.values():
            tendon.stiffness = (1.0 / self.compliance, self.hardening, 0.0)


@dataclass(frozen=True)
class Elongation:
    """Permanent elongation of one tendon.

    Attributes:
        muscle: name of the muscle.
        length: added length [m].
        time: time of the elongation since the reset [s]; 0: from the start.
    """

    muscle: str = ""
    length: float = 0.0
    time: float = 0.0

    def edit(self, draft: Draft) -> None:
        """Elongate the tendon, or add the event."""
        if self.length == 0.0:
            return
        tendon = draft.tendon(self.muscle)
        if self.time > 0.0:
            draft.events.append(Event(self.time, self.muscle, self.length))
        else:
            tendon.elongation = self.length


@dataclass(frozen=True)
class DryFriction:
    """Dry friction along every tendon, which grows with its tension as over relay points.

    Attributes:
        constant: friction without tension [N].
        ratio: friction per tension [1].
    """

    constant: float = 0.0
    ratio: float = 0.0

    def edit(self, draft: Draft) -> None:
        """Give every tendon its friction."""
        if self.constant == 0.0 and self.ratio == 0.0:
            return
        for tendon in draft.tendons.values():
            tendon.friction, tendon.friction_ratio = self.constant, self.ratio


@dataclass(frozen=True)
class MotorInertia:
    """Inertia of the motors.

    Attributes:
        inertia: rotor inertia seen at the tendon, through gear and drum [kg].
    """

    inertia: float = 0.0

    def edit(self, draft: Draft) -> None:
        """Give every motor its inertia."""
        if self.inertia == 0.0:
            return
        for tendon in draft.tendons.values():
            tendon.motor_inertia = self.inertia

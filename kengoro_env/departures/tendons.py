"""Departures of the wires and their motors: stretch, elongation, dry friction, inertia."""

from __future__ import annotations

from dataclasses import dataclass

from kengoro_env.robot.draft import Draft, Event


@dataclass(frozen=True)
class TendonStretch:
    """Wires are one-sided springs that harden: x = compliance T at small tension T.

    Tension is T = x / compliance + hardening x^2 for a stretch x > 0, and 0 for a slack wire.

    Attributes:
        compliance: stretch per tension at small tensions [m/N].
        hardening: how the wire stiffens [N/m^2].
    """

    compliance: float = 0.0
    hardening: float = 0.0

    def edit(self, draft: Draft) -> None:
        """Put every wire on a spool and let it stretch."""
        if self.compliance == 0.0:
            return
        for tendon in draft.tendons.values():
            tendon.stiffness = (1.0 / self.compliance, self.hardening, 0.0)


@dataclass(frozen=True)
class Elongation:
    """A wire gives for good: it is longer by ``length`` [m] from ``time`` [s] on (0: always)."""

    muscle: str = ""
    length: float = 0.0
    time: float = 0.0

    def edit(self, draft: Draft) -> None:
        """Lengthen the wire now, or note when it will give."""
        if self.length == 0.0:
            return
        tendon = draft.tendon(self.muscle)
        if self.time > 0.0:
            draft.events.append(Event(self.time, self.muscle, self.length))
        else:
            tendon.elongation = self.length


@dataclass(frozen=True)
class DryFriction:
    """Dry friction along every wire that grows with its tension, as over relay points.

    Attributes:
        constant: friction without tension [N].
        ratio: friction per tension [1].
    """

    constant: float = 0.0
    ratio: float = 0.0

    def edit(self, draft: Draft) -> None:
        """Give every wire its friction."""
        if self.constant == 0.0 and self.ratio == 0.0:
            return
        for tendon in draft.tendons.values():
            tendon.friction, tendon.friction_ratio = self.constant, self.ratio


@dataclass(frozen=True)
class MotorInertia:
    """Motors have inertia.

    Attributes:
        inertia: rotor inertia seen at the wire, through gear and drum [kg].
    """

    inertia: float = 0.0

    def edit(self, draft: Draft) -> None:
        """Give every motor its inertia."""
        if self.inertia == 0.0:
            return
        for tendon in draft.tendons.values():
            tendon.motor_inertia = self.inertia

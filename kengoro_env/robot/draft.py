"""A robot before it is compiled: its model, its wires and its senses, still open to departures.

MuJoCo's ``MjSpec`` knows nothing of encoders, delays or motors on spools; a `Draft` holds the spec
and these beside it. A departure edits a draft, sets values and never scales what it reads.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Protocol

import mujoco

from kengoro_env.errors import KengoroError


class UnknownNameError(KengoroError):
    """A muscle, joint, departure or option that does not exist."""

    def __init__(self, kind: str, name: object, known: Iterable[str]) -> None:
        super().__init__(kind, name, tuple(known))  # which is what a process sends to another

    def __str__(self) -> str:
        kind, name, known = self.args
        return f"unknown {kind} {name!r}; known: {', '.join(known)}"


@dataclass
class TendonSpec:
    """What departs from an ideal wire on an ideal motor. All zero or None: the drawing's wire.

    Attributes:
        stiffness: (k1, k2, k3) of the one-sided elastic wire, T = k1 x + k2 x^2 + k3 x^3 for a
            stretch x > 0 [N/m, N/m^2, N/m^3]; None for a wire that does not stretch.
        motor_inertia: inertia of the motor seen at the wire [kg].
        friction: dry friction along the wire that is always there [N].
        friction_ratio: dry friction per tension [1].
        elongation: how much longer the wire is than on the day it was mounted [m].
        wraps: bones that the wire wraps over: {index of the path's segment: (geom, side site)}.
    """

    stiffness: tuple[float, float, float] | None = None
    motor_inertia: float = 0.0
    friction: float = 0.0
    friction_ratio: float = 0.0
    elongation: float = 0.0
    wraps: dict[int, tuple[str, str]] = field(default_factory=dict)


@dataclass
class SensorErrors:
    """How the robot's senses depart from the truth.

    Attributes:
        length_offset: encoder offset by muscle [m].
        length_noise: standard deviation of each reading [m].
        length_quantum: smallest step of a reading [m]; 0 for none.
        tension_noise: standard deviation of each reading [N].
        tension_offset: offset by muscle [N].
        frame_delay: age of the newest frame that the agent gets [s].
        zero_posture: joint angles at which the lengths were zeroed, by joint [rad].
    """

    length_offset: dict[str, float] = field(default_factory=dict)
    length_noise: float = 0.0
    length_quantum: float = 0.0
    tension_noise: float = 0.0
    tension_offset: dict[str, float] = field(default_factory=dict)
    frame_delay: float = 0.0
    zero_posture: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Event:
    """A wire that gives for good while the robot runs: ``elongation`` [m] at ``time`` [s]."""

    time: float
    muscle: str
    elongation: float


@dataclass
class Draft:
    """A robot before it is compiled.

    Attributes:
        spec: the MuJoCo model, the drawing at first.
        wires: by muscle, in the order of the model's tendons.
        senses: encoders, tension sensors, camera timing, zero posture.
        events: what happens to wires during an episode.
    """

    spec: mujoco.MjSpec
    tendons: dict[str, TendonSpec]
    sensor_errors: SensorErrors = field(default_factory=SensorErrors)
    events: list[Event] = field(default_factory=list)

    @classmethod
    def of(cls, spec: mujoco.MjSpec) -> Draft:
        """A draft without departures on a copy of ``spec``."""
        return cls(spec.copy(), {tendon.name: TendonSpec() for tendon in spec.tendons})

    def tendon(self, muscle: str) -> TendonSpec:
        """The wire of a muscle; `UnknownNameError` lists the muscles there are."""
        if muscle not in self.tendons:
            raise UnknownNameError("muscle", muscle, self.tendons)
        return self.tendons[muscle]


class Departure(Protocol):
    """What makes a robot depart from its drawing: a frozen dataclass with one verb."""

    def edit(self, draft: Draft) -> None:
        """Write this departure into ``draft``; with null parameters leave it as it is."""

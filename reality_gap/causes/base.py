"""What a cause is: a mechanism that a model lacks, where it may act, and its parameters.

A cause acts in two ways. ``edit`` writes into the model what MuJoCo can express; ``attach`` adds
what it cannot, as effects on commands, steps and readings. Null parameters do neither.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import mujoco

from reality_gap.study.system import System
from reality_gap.types import Floats

Values = Mapping[str, float]


@dataclass(frozen=True)
class SearchHints:
    """What helps the search with a parameter whose effect is not smooth; most need none.

    Attributes:
        starts: values to start a fit from, such as possible onsets of an event. The prior of such a
            parameter is flat.
        secants: sizes of the only parameter of a cause at which it is screened, too, where large
            changes act otherwise than small ones, such as a tendon that goes slack.
        far_starts: values to start a fit from where the readings do not follow their slopes.
        shape: whether it does nothing while the other parameters are at their null values.
    """

    starts: tuple[float, ...] = ()
    secants: tuple[float, ...] = ()
    far_starts: tuple[float, ...] = ()
    shape: bool = False


@dataclass(frozen=True)
class Parameter:
    """One number of a cause.

    Attributes:
        name: in a verdict's ``parameters``.
        unit: SI.
        scale: size of a typical fault; also the step of the finite difference. Signed: a
            parameter that can only be positive has a positive scale.
        tolerance: standard deviation of what every honest drawing is off by; nobody calls it a
            fault. 0 for parameters that no drawing has at all, as the onset of an event.
        low, high: bounds.
        null: the value at which the cause does nothing.
        hints: for the search; see `SearchHints`.
        usual: what every machine has of it and its drawing lacks, as friction of wires; it is in
            all replays, a value is on top of it, and the tolerance is the deviation from it, of one
            element and, to the same side, of all in a group.
    """

    name: str
    unit: str
    scale: float
    tolerance: float
    low: float
    high: float
    null: float = 0.0
    hints: SearchHints = SearchHints()
    usual: float = 0.0


@dataclass(frozen=True)
class Location:
    """Where a cause acts: names of model elements, one or a group that shares the parameters.

    Attributes:
        kind: "tendon", "joint", "site", "body", "sensor", "actuator", "camera" or "model".
        elements: names.
        note: what else tells two places with the same elements apart, such as a path's segment.
    """

    kind: str
    elements: tuple[str, ...]
    note: str = ""

    def __str__(self) -> str:
        return ", ".join(self.elements) + (f" ({self.note})" if self.note else "")


@dataclass(frozen=True)
class Record:
    """What a replay saw in one episode, on an even grid; readings may be edited in place.

    Attributes:
        time: (k,) [s].
        sensors: (k, nsensordata).
        force: (k, nactuator) of the actuators.
        length, velocity: (k, ntendon) of the tendons.
        qpos, qvel: (k, nq), (k, nv).
        model: the model that was replayed.
    """

    time: Floats
    sensors: Floats
    force: Floats
    length: Floats
    velocity: Floats
    qpos: Floats
    qvel: Floats
    model: mujoco.MjModel

    def column(self, sensor: str, component: int = 0) -> int:
        """Index of a sensor's component in ``sensors``."""
        return int(self.model.sensor(sensor).adr[0]) + component


class Command(Protocol):
    """Changes what is commanded: ``time`` (k,), ``command`` (k, nu) at every physics step.

    The time is that of the study: an episode begins where the one before it ended.
    """

    def __call__(self, model: mujoco.MjModel, time: Floats, command: Floats) -> Floats:
        """The commands that really act, (k, nu); does not write into ``command``."""


class Hook(Protocol):
    """Acts before physics steps. A new one is made for every episode."""

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """May write ``data.qfrc_applied``, ``xfrc_applied`` or numbers of ``model`` (a copy).

        ``data.ctrl`` is written anew before the hooks of each step, so that a hook may add to it.
        ``qfrc_applied`` and ``xfrc_applied`` are zeroed before each step, for hooks add to them.
        """


class ReadingEffect(Protocol):
    """Changes what is read."""

    def __call__(self, record: Record) -> None:
        """Edit ``record.sensors`` in place."""


@dataclass(frozen=True)
class Acting:
    """A hook and when it acts.

    Attributes:
        make: makes it; called with the compiled model at the start of each episode.
        start, end: outside of this time of the study it does nothing [s].
        period: it is called this often at least [s]; 0 for every step.
        wrenches: where it does nothing but push bodies, by the clock alone: what it does to all of
            them (k, nbody, 6) [N, N m] at times (k,) [s]. Such a replay needs no Python.
    """

    make: Callable[[mujoco.MjModel], Hook]
    start: float = -math.inf
    end: float = math.inf
    period: float = 0.0
    wrenches: Callable[[mujoco.MjModel, Floats], Floats] | None = None


@dataclass
class Effects:
    """What acts beside the model.

    Attributes:
        commands: applied in order to the commands of an episode.
        hooks: called before each physics step.
        senses: applied in order to the record of an episode.
    """

    commands: list[Command] = field(default_factory=list)
    hooks: list[Acting] = field(default_factory=list)
    readings: list[ReadingEffect] = field(default_factory=list)

    def act(
        self,
        make: Callable[[mujoco.MjModel], Hook],
        start: float = -math.inf,
        end: float = math.inf,
        period: float = 0.0,
        wrenches: Callable[[mujoco.MjModel, Floats], Floats] | None = None,
    ) -> None:
        """Add a hook that acts from ``start`` to ``end`` [s] of the study; see `Acting`."""
        self.hooks.append(Acting(make, start, end, period, wrenches))


@dataclass(frozen=True)
class Cause:
    """A mechanism that a model may lack.

    Attributes:
        id: part of the interface; see `reality_gap.causes.CATALOGUE`.
        title: for people.
        explanation: one sentence: what the mechanism is and how it shows.
        places: where it may act in a system; empty where it cannot.
        parameters: of one place.
        edit: writes it into a model, as far as MuJoCo can express it.
        attach: adds the rest to the effects beside the model.
        fine: whether simpler causes at the same wire or joint promise something where this one
            acts, so that in a machine of many wires it is looked at there only.
        event: whether it comes from outside at a time of its own; what the machine's own posture
            explains nearly as well is none.
        sticky: whether a large one looks different from a small one, as what sticks until it slips;
            where one such cause explains much, others are fitted whatever their slopes promise.
    """

    id: str
    title: str
    explanation: str
    locations: Callable[[System], tuple[Location, ...]]
    parameters: Callable[[System, Location], tuple[Parameter, ...]]
    edit: Callable[[mujoco.MjSpec, System, Location, Values], None] | None = None
    attach: Callable[[Effects, System, Location, Values], None] | None = None
    fine: bool = False
    event: bool = False
    sticky: bool = False

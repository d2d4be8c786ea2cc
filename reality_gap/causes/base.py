"""Cause: a mechanism that a nominal model lacks, its possible locations and its parameters.

A cause acts in two ways. ``edit`` writes into the model what MuJoCo can express. ``attach`` adds
the rest as effects on commands, on physics steps and on readings. At the null values of its
parameters a cause changes nothing, and its effect must be continuous there.

A cause is one file of this folder. The file ``heavy_gravity.py`` could contain:

    from __future__ import annotations

    import mujoco

    from reality_gap.causes.base import Cause, Location, Parameter, Values
    from reality_gap.study.system import System


    def _locations(system: System) -> tuple[Location, ...]:
        return (Location("model", ("gravity",)),)


    def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
        return (Parameter("excess", "1", scale=0.01, tolerance=1e-4, low=-0.5, high=0.5),)


    def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
        spec.option.gravity = spec.option.gravity * (1 + values["excess"])


    CAUSE = Cause(
        id="heavy_gravity",
        title="wrong gravity",
        explanation="Gravity is stronger or weaker than in the model.",
        locations=_locations,
        parameters=_parameters,
        edit=_edit,
    )

The line ``"heavy_gravity",`` in ``reality_gap.causes.MODULES`` adds it to the catalogue; the tests
of the catalogue then include it. ``tension_offset.py`` is a short example with ``attach``, and the
folder ``support`` has functions that several causes share.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, Protocol

import mujoco

from reality_gap.study.data import ReadState
from reality_gap.study.system import System
from reality_gap.types import Floats

Values = Mapping[str, float]
"""Values of a cause's parameters by name, in SI units."""


@dataclass(frozen=True)
class SearchHints:
    """Hints for fitting a parameter whose effect is not smooth; most parameters need none.

    Attributes:
        starts: values from which fits start, such as possible onsets of an event. The prior of a
            parameter with starts is flat.
        secants: values at which the cause is screened in addition to a small one, because large
            values act differently from small ones, or because small ones do not act at all.
        far_starts: values from which further fits start if the replays are far from linear in the
            parameter.
        nearby: differences from a fitted value from which further fits start, because the misfit
            has minima side by side, as where a machine sticks or is sampled.
        shape: whether the parameter has no effect while the others are at their null values.
        screened: values of a shape at which the others are screened, in addition to its null.
        bounded: whether a shape that is fitted at a bound stands for another cause, as those of
            other parameters do. Without, the bounds of a shape say "hardly" and "very".
        period: for the period of an event that repeats, where its times are counted from: the start
            of the "study" or of each "episode". Only those starts are screened at which the data
            repeat most; starts of other times belong to the largest period and scale with it.
        absence: whether all of a property is taken away at ``low``; a fit that ends there is as
            good as any other.
    """

    starts: tuple[float, ...] = ()
    secants: tuple[float, ...] = ()
    far_starts: tuple[float, ...] = ()
    nearby: tuple[float, ...] = ()
    shape: bool = False
    screened: tuple[float, ...] = ()
    bounded: bool = False
    period: Literal["study", "episode"] | None = None
    absence: bool = False


@dataclass(frozen=True)
class Parameter:
    """One number of a cause.

    Attributes:
        name: key in ``parameters`` of a verdict.
        unit: SI unit.
        scale: size of a typical fault [unit]; also the step of finite differences. It is positive
            for a parameter that must not be negative.
        tolerance: standard deviation by which every good model is wrong [unit]; deviations of this
            size are no fault. 0 for a parameter without such a deviation, such as an onset.
        low, high: bounds [unit].
        null: value at which the cause does nothing [unit].
        hints: hints for the search; see `SearchHints`.
        usual: value that every machine has although its nominal model lacks it, such as a little
            friction in each tendon [unit]. All replays include it, a fitted value is added to it,
            and ``tolerance`` is the deviation from it.
        least: deviations up to this size are never named, because a correct model shows them, too,
            such as a delay of half a time step [unit].
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
    least: float = 0.0


@dataclass(frozen=True)
class Location:
    """Where a cause acts: one element of the model, or a group that shares the parameters.

    Attributes:
        kind: "tendon", "joint", "site", "body", "sensor", "actuator", "camera" or "model".
        elements: names of the elements.
        note: distinguishes locations with the same elements, for example by a segment of a path.
        log: name of the only log in which the cause acts; empty if it acts in all logs.
        joint: name of the joint that an actuator moves; empty for other locations.
    """

    kind: str
    elements: tuple[str, ...]
    note: str = ""
    log: str = ""
    joint: str = field(default="", compare=False)

    def acts_on(self, other: Location) -> bool:
        """Return whether both are the same, or an actuator and the joint that it moves."""
        return self._moved() == other._moved()

    def _moved(self) -> Location:
        return replace(self, kind="joint", elements=(self.joint,)) if self.joint else self

    def __str__(self) -> str:
        where = ", ".join(self.elements) + (f" ({self.note})" if self.note else "")
        return f"{where} in {self.log}" if self.log else where


@dataclass(frozen=True)
class Record:
    """What a replay recorded in one episode, on an even grid of time.

    Attributes:
        time: shape (k,) [s].
        sensors: sensor data, shape (k, nsensordata); effects may edit them in place.
        force: forces of the actuators, shape (k, nactuator).
        length, velocity: of the tendons, shape (k, ntendon) [m] and [m/s].
        qpos, qvel: shapes (k, nq) and (k, nv).
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
        """Return the column in ``sensors`` of a component of a sensor."""
        return int(self.model.sensor(sensor).adr[0]) + component


class Command(Protocol):
    """Effect on commands."""

    def __call__(self, model: mujoco.MjModel, time: Floats, command: Floats) -> Floats:
        """Return the commands that act on the machine.

        Args:
            model: the model that is replayed.
            time: time in the study at each physics step, shape (k,) [s]; an episode begins where
                the previous one ended.
            command: nominal commands, shape (k, nu); must not be edited.

        Returns:
            Commands, shape (k, nu).
        """


class Hook(Protocol):
    """Effect on physics steps; a new hook is made for each episode."""

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Act before a physics step.

        A hook may write numbers of ``model``, which is a copy, and may add to ``data.ctrl``,
        ``data.qfrc_applied`` and ``data.xfrc_applied``. Before the hooks of each step, ``ctrl`` is
        set to the command, and the applied forces are set to zero.
        """


class ReadingEffect(Protocol):
    """Effect on readings."""

    def __call__(self, record: Record) -> None:
        """Edit ``record.sensors`` in place."""


class StartEffect(Protocol):
    """Effect on the states in which joints begin, where their own readings show these."""

    def __call__(self, states: dict[str, ReadState]) -> None:
        """Replace the states that were read by the true ones, in place.

        Args:
            states: by joint.
        """


class MotionEffect(Protocol):
    """Effect on the measured motion along which efforts are computed by inverse dynamics."""

    def __call__(self, model: mujoco.MjModel, qpos: Floats, qvel: Floats, qacc: Floats) -> None:
        """Replace the measured motion by the true one, in place.

        Args:
            model: the model.
            qpos: positions, shape (k, nq) [m or rad].
            qvel: velocities, shape (k, nv) [m/s or rad/s].
            qacc: accelerations, shape (k, nv) [m/s^2 or rad/s^2].
        """


class EffortEffect(Protocol):
    """Effect on efforts, where these are compared by inverse dynamics."""

    def __call__(self, model: mujoco.MjModel, time: Floats, effort: Floats) -> None:
        """Edit ``effort`` in place.

        Args:
            model: the model whose inverse dynamics were computed.
            time: time in the study of each sample, shape (k,) [s].
            effort: force of each degree of freedom, shape (k, nv) [N or N m].
        """


@dataclass(frozen=True)
class ScheduledHook:
    """A hook and the time during which it acts.

    Attributes:
        make: creates the hook from the compiled model at the start of each episode.
        start, end: time in the study outside of which the hook does nothing [s].
        period: longest time between two calls [s]; 0 to be called at each step.
        wrenches: for a hook that only pushes bodies as a function of time: the wrenches on all
            bodies, shape (k, nbody, 6) [N, N m], at times of shape (k,) [s]. Such a replay runs
            without Python.
    """

    make: Callable[[mujoco.MjModel], Hook]
    start: float = -math.inf
    end: float = math.inf
    period: float = 0.0
    wrenches: Callable[[mujoco.MjModel, Floats], Floats] | None = None


@dataclass
class Effects:
    """Effects that act in addition to the model.

    Attributes:
        commands: applied to the commands of an episode, in order.
        hooks: called before physics steps.
        readings: applied to the record of an episode, in order.
        of_forces: those of them that add a function of ``record.force`` to positions or velocities.
            Forces jump with the commands, and readings are taken under the command before.
        starts: applied in reverse order to the states in which an episode begins.
        motions: applied in order to the measured motion, where efforts are computed.
        efforts: applied in order to computed efforts; these have no other readings.
    """

    commands: list[Command] = field(default_factory=list)
    hooks: list[ScheduledHook] = field(default_factory=list)
    readings: list[ReadingEffect] = field(default_factory=list)
    of_forces: list[ReadingEffect] = field(default_factory=list)
    starts: list[StartEffect] = field(default_factory=list)
    motions: list[MotionEffect] = field(default_factory=list)
    efforts: list[EffortEffect] = field(default_factory=list)

    def add_hook(
        self,
        make: Callable[[mujoco.MjModel], Hook],
        start: float = -math.inf,
        end: float = math.inf,
        period: float = 0.0,
        wrenches: Callable[[mujoco.MjModel, Floats], Floats] | None = None,
    ) -> None:
        """Add a hook; the arguments are those of `ScheduledHook`."""
        self.hooks.append(ScheduledHook(make, start, end, period, wrenches))


def even_odds(location: Location) -> float:
    """Return log odds of 0 nats: the cause is as likely as others."""
    return 0.0


@dataclass(frozen=True)
class Cause:
    """A mechanism that a model may lack.

    Attributes:
        id: unique name, which verdicts and extended models contain.
        title: short name for reports.
        explanation: one sentence for reports: what the mechanism is and how it shows.
        locations: returns where it may act in a system; empty if it cannot act there.
        parameters: returns its parameters at a location.
        edit: writes it into a model as far as MuJoCo can express it.
        attach: adds the rest to the effects that act in addition to the model.
        fine: whether a simpler cause at the same tendon or joint shows wherever this one acts; in
            machines with many tendons it is then screened only where a simpler cause shows.
        event: whether it comes from outside at its own time; it is not named if a function of the
            posture explains the data nearly as well.
        sticky: whether large values look different from small ones, as with dry friction. If one
            sticky cause explains much, others are fitted regardless of their screening.
        prior: returns the log odds of the cause at a location against others [nats]; negative
            where it explains much by chance.
        includes: ids of causes that are special cases of it at the same location, or at an actuator
            that moves the same joint. It is preferred to them if it adds to them what a further
            cause must add.
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
    prior: Callable[[Location], float] = even_odds
    includes: tuple[str, ...] = ()


def unlisted_cause(
    id: str = "",
    edit: Callable[[mujoco.MjSpec, System, Location, Values], None] | None = None,
    attach: Callable[[Effects, System, Location, Values], None] | None = None,
) -> Cause:
    """Return a cause outside of the catalogue, which is replayed or fitted and never named.

    Args:
        id: name; needed only if it is fitted.
        edit: see `Cause`; a function of a module, or a `functools.partial` of one, because
            processes exchange causes.
        attach: likewise.
    """
    return Cause(id, "", "", _no_locations, _no_parameters, edit, attach)


def _no_locations(system: System) -> tuple[Location, ...]:
    return ()


def _no_parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    return ()

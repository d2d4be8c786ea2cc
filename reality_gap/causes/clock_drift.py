"""Clock drift: the clock of the sensors runs faster or slower than that of the commands.

Logs of two computers begin together and drift apart: the reading with the time stamp ``t`` was
taken at the time ``t / (1 + drift)`` of the commands. Each episode begins without a difference.
Quartz clocks differ by up to 1e-4, but the RC oscillators of microcontrollers by a few percent.
"""

from __future__ import annotations

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, SearchHints, Values
from reality_gap.causes.support import clocks
from reality_gap.study.system import System

USUAL = 2e-5
"""Standard deviation of the relative frequencies of two good clocks."""
LATE = 0.004
"""Usual difference at the end of a log [s], which is that of a usual delay."""
SECANTS = (0.05, 0.2)
"""Differences at the end of a log at which the cause is screened in addition to a small one [s]."""


def _locations(system: System) -> tuple[Location, ...]:
    if system.study.inverse or not system.sensed:
        return ()
    return (Location("model", ("sensors",)),)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    per = 1.0 / system.duration
    secants = tuple(sign * late * per for late in SECANTS for sign in (1.0, -1.0))
    hints = SearchHints(secants=secants)
    return (Parameter("drift", "1", LATE * per, USUAL, -0.5, 0.5, hints=hints),)


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    def drift(record: Record) -> None:
        since = record.time - record.time[0]
        clocks.read_at(record, system.sensed, since / (1.0 + values["drift"]), since)

    effects.readings.append(drift)


CAUSE = Cause(
    id="clock_drift",
    title="drift of the sensors' clock",
    explanation="The clock of the sensors runs faster or slower than that of the commands.",
    locations=_locations,
    parameters=_parameters,
    attach=_attach,
)

"""A hypothesis: causes at places with values, and the machine that they make of the study's."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import mujoco

from reality_gap.causes import CATALOGUE
from reality_gap.causes.base import Cause, Effects, Location, Parameter, Values
from reality_gap.study.system import System


@dataclass(frozen=True)
class Candidate:
    """A cause at a place."""

    cause: Cause
    location: Location
    parameters: tuple[Parameter, ...]

    def __str__(self) -> str:
        return f"{self.cause.id} at {self.location}"

    def nulls(self) -> dict[str, float]:
        """The values at which it does nothing."""
        return {parameter.name: parameter.null for parameter in self.parameters}


def same(a: Candidate, b: Candidate) -> bool:
    """Whether two suspects are the same cause at the same place."""
    return a.cause.id == b.cause.id and a.location == b.location


@dataclass(frozen=True)
class Plant:
    """A machine: its model, and what acts beside it.

    Attributes:
        spec: the model.
        effects: what MuJoCo cannot express.
        edits: what was written into the model; plants with the same edits have the same model.
    """

    spec: mujoco.MjSpec
    effects: Effects
    edits: tuple[Hashable, ...] = ()


def build(system: System, parts: Sequence[tuple[Candidate, Values]]) -> Plant:
    """The study's machine with suspects in it, each with its values; null ones are left out.

    They are built in in the order of the catalogue: what changes readings comes last.
    """
    spec, effects, edits = system.study.spec(), Effects(), []
    order = {name: i for i, name in enumerate(CATALOGUE)}
    for candidate, values in sorted(parts, key=lambda part: order.get(part[0].cause.id, 0)):
        if all(values[p.name] == p.null for p in candidate.parameters):
            continue
        cause, location = candidate.cause, candidate.location
        if cause.edit is not None:
            cause.edit(spec, system, location, values)
            edits.append((cause.id, location, tuple(sorted(values.items()))))
        if cause.attach is not None:
            cause.attach(effects, system, location, values)
    return Plant(spec, effects, tuple(edits))


def acts_beside(system: System, candidate: Candidate, values: Values) -> bool:
    """Whether a suspect with these values does something that MuJoCo cannot express."""
    effects = build(system, [(candidate, values)]).effects
    return bool(effects.commands or effects.hooks or effects.readings)

"""Own amounts: a property of all joints or links, wrong in each of them by an amount of its own.

Every real joint has friction and a rotor. Where the joints of a machine differ in size, no shared
amount fits, and a search that adds one joint after the other ends before the last one.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache, partial

import mujoco

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Values
from reality_gap.study.system import System

OWN = "each its own"
"""Note of the location of all joints or links, with one parameter for each, named by it."""

KINDS = ("joint", "body")
"""Kinds of elements that have such a location."""


def with_own_amounts(cause: Cause) -> Cause:
    """Return a cause that may also act on all joints or links at once, on each by its own amount.

    Args:
        cause: acts on single ones; the first parameter there is the amount.
    """
    return replace(
        cause,
        locations=partial(_locations, cause),
        parameters=partial(_parameters, cause),
        edit=partial(_edit, cause) if cause.edit else None,
        attach=partial(_attach, cause) if cause.attach else None,
    )


def single_locations(location: Location) -> tuple[Location, ...]:
    """Return the locations of the single elements of a location with the note `OWN`."""
    return tuple(replace(location, elements=(name,), note="") for name in location.elements)


def _locations(cause: Cause, system: System) -> tuple[Location, ...]:
    found = cause.locations(system)
    single = [one for one in found if len(one.elements) == 1 and not one.note]
    kinds = dict.fromkeys(one.kind for one in single if one.kind in KINDS)
    by_kind = {kind: tuple(o.elements[0] for o in single if o.kind == kind) for kind in kinds}
    own = [Location(kind, names, OWN) for kind, names in by_kind.items() if len(names) > 1]
    return (*found, *own)


def _parameters(cause: Cause, system: System, location: Location) -> tuple[Parameter, ...]:
    if location.note != OWN:
        return cause.parameters(system, location)
    amounts = (parameters[0] for _, parameters in _each(cause, system, location))
    return tuple(replace(p, name=name) for name, p in zip(location.elements, amounts, strict=True))


@lru_cache(maxsize=8)
def _each(
    cause: Cause, system: System, location: Location
) -> tuple[tuple[Location, tuple[Parameter, ...]], ...]:
    """Return the single locations of one with the note `OWN`, with the parameters there.

    Each model that is built needs them again.
    """
    return tuple((one, cause.parameters(system, one)) for one in single_locations(location))


def _singles(
    cause: Cause, system: System, location: Location, values: Values
) -> list[tuple[Location, Values]]:
    """Return the locations of the cause itself with the values of all its parameters there.

    Joints without an amount are left out.
    """
    if location.note != OWN:
        return [(location, values)]
    found = list[tuple[Location, Values]]()
    for one, (amount, *others) in _each(cause, system, location):
        value = values[one.elements[0]]
        if value != amount.null:
            found.append((one, {amount.name: value} | {p.name: p.null for p in others}))
    return found


def _edit(
    cause: Cause, spec: mujoco.MjSpec, system: System, location: Location, values: Values
) -> None:
    assert cause.edit is not None
    for one, own in _singles(cause, system, location, values):
        cause.edit(spec, system, one, own)


def _attach(
    cause: Cause, effects: Effects, system: System, location: Location, values: Values
) -> None:
    assert cause.attach is not None
    for one, own in _singles(cause, system, location, values):
        cause.attach(effects, system, one, own)

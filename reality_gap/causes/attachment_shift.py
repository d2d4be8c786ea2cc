"""A point of a wire's path that is not where the drawing has it.

The shift is in the axes in which the drawing gives the point's position, so that it adds to the
numbers of the file. What counts is the length over the postures, not the three numbers.
"""

from __future__ import annotations

from functools import partial

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Location, Parameter, SearchHints, Values
from reality_gap.causes.support import encoder_zero
from reality_gap.study.system import System

EVERY = "every wire"
AXES = ("x", "y", "z")
AFAR = (-0.02, -0.01, -0.005, 0.005, 0.01, 0.02)
"""Shifts along one axis [m]: wires that go slack on the way make a valley of each side."""


def _locations(system: System) -> tuple[Location, ...]:
    sites = tuple(dict.fromkeys(site for tendon in system.tendons for site in tendon.sites))
    every = (Location("model", sites, EVERY),) if len(sites) > 1 else ()
    return tuple(Location("site", (site,)) for site in sites) + every


def _name(location: Location, site: str, axis: str) -> str:
    return f"{site}.{axis}" if location.note == EVERY else axis


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    hints = SearchHints(far_starts=AFAR if len(location.elements) == 1 else ())
    return tuple(
        Parameter(_name(location, site, axis), "m", 0.002, 0.00007, -0.03, 0.03, hints=hints)
        for site in location.elements
        for axis in AXES
    )


def _geometry(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    for name in location.elements:
        site = spec.site(name)
        shift = np.array([values[_name(location, name, axis)] for axis in AXES])
        site.pos = site.pos + shift
        site.fromto = site.fromto + np.tile(shift, 2)  # not a number unless the file has it


CAUSE = Cause(
    id="attachment_shift",
    title="displaced attachment",
    explanation="A point of a wire's path is elsewhere on its body, so that its lever arms differ.",
    locations=_locations,
    parameters=_parameters,
    edit=partial(encoder_zero.edit, _geometry),
    attach=partial(encoder_zero.attach, _geometry),
)

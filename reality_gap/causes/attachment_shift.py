"""Attachment shift: a site of a tendon's path is displaced on its body.

The shift is in the axes of the site's ``pos`` in the model file, so that it adds to the numbers of
the file. Several shifts may have nearly the same effect on the tendon's length at all postures;
they then cannot be distinguished.
"""

from __future__ import annotations

from functools import partial

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Location, Parameter, SearchHints, Values
from reality_gap.causes.support import encoder_zero, typical_scales
from reality_gap.study.system import System

EVERY = "every tendon"
"""Note of the location that shifts all sites at once."""
AXES = ("x", "y", "z")
AFAR = (-0.055, -0.028, -0.014, 0.014, 0.028, 0.055)
"""Shifts along one axis from which further fits start, over the size of the largest link. A tendon
that goes slack between two shifts makes a local minimum on each side."""
SCALE, TOLERANCE, LARGEST = 0.0055, 0.0002, 0.08
"""Typical shift, its tolerance and its bound, over the size of the largest link."""


def _locations(system: System) -> tuple[Location, ...]:
    sites = tuple(dict.fromkeys(site for tendon in system.tendons for site in tendon.sites))
    every = (Location("model", sites, EVERY),) if len(sites) > 1 else ()
    return tuple(Location("site", (site,)) for site in sites) + every


def _name(location: Location, site: str, axis: str) -> str:
    return f"{site}.{axis}" if location.note == EVERY else axis


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    size = typical_scales.link_size(system)
    far = tuple(share * size for share in AFAR) if len(location.elements) == 1 else ()
    sizes = (SCALE * size, TOLERANCE * size, -LARGEST * size, LARGEST * size)
    hints = SearchHints(far_starts=far)
    return tuple(
        Parameter(_name(location, site, axis), "m", *sizes, hints=hints)
        for site in location.elements
        for axis in AXES
    )


def _geometry(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    for name in location.elements:
        site = spec.site(name)
        shift = np.array([values[_name(location, name, axis)] for axis in AXES])
        site.pos = site.pos + shift
        site.fromto = site.fromto + np.tile(shift, 2)  # NaN unless the file has it


CAUSE = Cause(
    id="attachment_shift",
    title="displaced attachment",
    explanation="A point of a tendon's path is displaced, so that the lever arms differ.",
    locations=_locations,
    parameters=_parameters,
    edit=partial(encoder_zero.edit_zeroed, _geometry),
    attach=partial(encoder_zero.attach_zeroed, _geometry),
)

"""Paths of wires in a spec: read, and laid anew with something in them.

MuJoCo's specs cannot insert into a tendon's path, so the tendon is deleted and made again with all
that it had. It becomes the last of the tendons: what asks a compiled model for it asks by name, as
actuators and sensors of the spec do.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import mujoco
import numpy as np

_WRAP = mujoco.mjtWrap
_ATTRIBUTES = (
    "actfrclimited",
    "actfrcrange",
    "armature",
    "damping",
    "frictionloss",
    "group",
    "limited",
    "margin",
    "material",
    "range",
    "rgba",
    "solimp_friction",
    "solimp_limit",
    "solref_friction",
    "solref_limit",
    "springlength",
    "springyield",
    "stiffness",
    "userdata",
    "width",
)


@dataclass(frozen=True)
class Stop:
    """An element of a path.

    Attributes:
        kind: of `mujoco.mjtWrap`.
        name: of the site, geom or joint.
        side: of a geom, the site on the side that the wire takes; may be empty.
        number: coefficient of a joint, divisor of a pulley.
    """

    kind: mujoco.mjtWrap
    name: str = ""
    side: str = ""
    number: float = 1.0


@dataclass(frozen=True)
class _Tendon:
    name: str
    default: Any
    attributes: dict[str, Any]
    path: tuple[Stop, ...]


def go_round(
    spec: mujoco.MjSpec, tendon: str, between: tuple[str, str], geom: str, side: str
) -> None:
    """Let a wire pass a geom on one side.

    Args:
        spec: edited in place.
        tendon: name.
        between: two sites that follow each other in its path; where something is between them
            already, nothing happens.
        geom: a sphere or cylinder.
        side: a site outside the geom, on the side that the wire takes.
    """
    old = _read(spec.tendon(tendon))
    sites = [stop.name if stop.kind == _WRAP.mjWRAP_SITE else "" for stop in old.path]
    pairs = list(pairwise(sites))
    if between not in pairs:
        return
    at = pairs.index(between) + 1
    round_it = Stop(_WRAP.mjWRAP_CYLINDER, geom, side)
    spec.delete(spec.tendon(tendon))
    _lay(spec, replace(old, path=(*old.path[:at], round_it, *old.path[at:])))


def _read(tendon: mujoco.MjsTendon) -> _Tendon:
    """A copy that outlives the tendon."""
    attributes = {}
    for name in _ATTRIBUTES:
        value = getattr(tendon, name)
        plain = isinstance(value, str) or not isinstance(value, Iterable)
        attributes[name] = value if plain else np.array(list(value))
    path = tuple(_stop(wrap) for wrap in tendon.path)
    return _Tendon(tendon.name, tendon.default(), attributes, path)


def _stop(wrap: mujoco.MjsWrap) -> Stop:
    if wrap.type == _WRAP.mjWRAP_PULLEY:
        return Stop(wrap.type, number=wrap.divisor)
    if wrap.type == _WRAP.mjWRAP_JOINT:
        return Stop(wrap.type, wrap.target.name, number=wrap.coef)
    if wrap.type == _WRAP.mjWRAP_SITE:
        return Stop(wrap.type, wrap.target.name)
    side = wrap.sidesite
    return Stop(wrap.type, wrap.target.name, "" if side is None else side.name)


def _lay(spec: mujoco.MjSpec, tendon: _Tendon) -> None:
    new = spec.add_tendon(tendon.default, name=tendon.name)
    for name, value in tendon.attributes.items():
        setattr(new, name, value)
    for stop in tendon.path:
        if stop.kind == _WRAP.mjWRAP_PULLEY:
            new.wrap_pulley(stop.number)
        elif stop.kind == _WRAP.mjWRAP_JOINT:
            new.wrap_joint(stop.name, stop.number)
        elif stop.kind == _WRAP.mjWRAP_SITE:
            new.wrap_site(stop.name)
        else:
            new.wrap_geom(stop.name, stop.side)

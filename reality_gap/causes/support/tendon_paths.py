"""Tendon paths: inserts a wrapping geom, or changes the coefficient of a joint, in a spec.

`MjSpec` cannot change a path. The tendon is therefore deleted and created again
with all its attributes. It then is the last tendon of the model, so that it must be referred to by
name, as actuators and sensors in a spec do.
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
class PathElement:
    """An element of a path.

    Attributes:
        kind: kind of the element.
        name: name of the site, geom or joint.
        side: name of the side site of a geom; may be empty.
        number: coefficient of a joint, or divisor of a pulley.
    """

    kind: mujoco.mjtWrap
    name: str = ""
    side: str = ""
    number: float = 1.0


@dataclass(frozen=True)
class _Tendon:
    """A copy of a tendon's name, default class, attributes and path."""

    name: str
    default: Any
    attributes: dict[str, Any]
    path: tuple[PathElement, ...]


def wrap_around(
    spec: mujoco.MjSpec, tendon: str, between: tuple[str, str], geom: str, side: str
) -> None:
    """Let a tendon wrap around a geom.

    Args:
        spec: edited in place.
        tendon: name of the tendon.
        between: two successive sites of its path; if there already is an element between them,
            nothing is changed.
        geom: name of a sphere or cylinder.
        side: name of a site outside of the geom, on the side on which the tendon passes.
    """
    old = _copy(spec.tendon(tendon))
    sites = [element.name if element.kind == _WRAP.mjWRAP_SITE else "" for element in old.path]
    pairs = list(pairwise(sites))
    if between not in pairs:
        return
    at = pairs.index(between) + 1
    wrap = PathElement(_WRAP.mjWRAP_CYLINDER, geom, side)
    _replace(spec, replace(old, path=(*old.path[:at], wrap, *old.path[at:])))


def scale_coefficient(spec: mujoco.MjSpec, tendon: str, joint: str, factor: float) -> None:
    """Multiply the coefficient of a joint in a fixed tendon by a factor.

    Args:
        spec: edited in place.
        tendon: name of the tendon.
        joint: name of the joint.
        factor: the factor.
    """
    old = _copy(spec.tendon(tendon))
    path = tuple(
        replace(one, number=factor * one.number) if one.name == joint else one for one in old.path
    )
    _replace(spec, replace(old, path=path))


def _copy(tendon: mujoco.MjsTendon) -> _Tendon:
    attributes = {}
    for name in _ATTRIBUTES:
        value = getattr(tendon, name)
        plain = isinstance(value, str) or not isinstance(value, Iterable)
        attributes[name] = value if plain else np.array(list(value))
    path = tuple(_path_element(wrap) for wrap in tendon.path)
    return _Tendon(tendon.name, tendon.default(), attributes, path)


def _path_element(wrap: mujoco.MjsWrap) -> PathElement:
    if wrap.type == _WRAP.mjWRAP_PULLEY:
        return PathElement(wrap.type, number=wrap.divisor)
    if wrap.type == _WRAP.mjWRAP_JOINT:
        return PathElement(wrap.type, wrap.target.name, number=wrap.coef)
    if wrap.type == _WRAP.mjWRAP_SITE:
        return PathElement(wrap.type, wrap.target.name)
    side = wrap.sidesite
    return PathElement(wrap.type, wrap.target.name, "" if side is None else side.name)


def _replace(spec: mujoco.MjSpec, tendon: _Tendon) -> None:
    """Delete the tendon of this name, and create this one."""
    spec.delete(spec.tendon(tendon.name))
    new = spec.add_tendon(tendon.default, name=tendon.name)
    for name, value in tendon.attributes.items():
        setattr(new, name, value)
    for element in tendon.path:
        if element.kind == _WRAP.mjWRAP_PULLEY:
            new.wrap_pulley(element.number)
        elif element.kind == _WRAP.mjWRAP_JOINT:
            new.wrap_joint(element.name, element.number)
        elif element.kind == _WRAP.mjWRAP_SITE:
            new.wrap_site(element.name)
        else:
            new.wrap_geom(element.name, element.side)

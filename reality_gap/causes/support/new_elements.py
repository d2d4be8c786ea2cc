"""New elements: adds elements that do not inherit from the default classes of a model.

`MjSpec` gives a new element the attributes of its default class, so that in a model with
``<default><general forcerange="-250 -10"/></default>`` a new actuator would exert 10 N at least.
The elements of this module have MuJoCo's own defaults instead, also in the XML that is written.
"""

from __future__ import annotations

from typing import Any

import mujoco

OF_THE_MODEL = {
    "classname",
    "compiler",
    "frame",
    "id",
    "info",
    "parent",
    "path",
    "plugin",
    "signature",
}
"""Attributes of an element that describe its place in the model; they are not copied."""


def add_actuator(spec: mujoco.MjSpec, **attributes: Any) -> mujoco.MjsActuator:
    """Add an actuator with these attributes and MuJoCo's defaults for all others."""
    return _set(spec.add_actuator(), mujoco.MjSpec().add_actuator(), attributes)


def add_geom(body: mujoco.MjsBody, **attributes: Any) -> mujoco.MjsGeom:
    """Add a geom with these attributes and MuJoCo's defaults for all others."""
    return _set(body.add_geom(), mujoco.MjSpec().worldbody.add_geom(), attributes)


def add_site(body: mujoco.MjsBody, **attributes: Any) -> mujoco.MjsSite:
    """Add a site with these attributes and MuJoCo's defaults for all others."""
    return _set(body.add_site(), mujoco.MjSpec().worldbody.add_site(), attributes)


def add_tendon(spec: mujoco.MjSpec, **attributes: Any) -> mujoco.MjsTendon:
    """Add a tendon without a path, with these attributes and MuJoCo's defaults for all others."""
    return _set(spec.add_tendon(), mujoco.MjSpec().add_tendon(), attributes)


def _set(new: Any, plain: Any, attributes: dict[str, Any]) -> Any:
    """Copy the attributes of a plain element to a new one, then set ``attributes``."""
    for name in dir(plain):
        if not name.startswith("_") and name not in OF_THE_MODEL:
            value = getattr(plain, name)
            if not callable(value):
                setattr(new, name, value)
    for name, value in attributes.items():
        setattr(new, name, value)
    return new

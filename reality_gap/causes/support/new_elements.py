"""Elements that are added to a model with every attribute of their own.

`MjSpec` gives a new element the attributes of its default class, so that a model with
``<default><general forcerange="-250 -10"/></default>`` would let a brake of 0.15 N pull 10 N. Here
a new element has MuJoCo's own defaults, whatever the model's are, also in the XML that is written.
"""

from __future__ import annotations

from typing import Any

import mujoco

OF_THE_MODEL = {"classname", "compiler", "frame", "id", "info", "parent", "plugin", "signature"}
"""Attributes that say where an element stands, not what it is."""


def add_actuator(spec: mujoco.MjSpec, **attributes: Any) -> mujoco.MjsActuator:
    """A new actuator with these attributes and MuJoCo's defaults for all others."""
    return _set(spec.add_actuator(), mujoco.MjSpec().add_actuator(), attributes)


def add_geom(body: mujoco.MjsBody, **attributes: Any) -> mujoco.MjsGeom:
    """A new geom on a body, likewise."""
    return _set(body.add_geom(), mujoco.MjSpec().worldbody.add_geom(), attributes)


def add_site(body: mujoco.MjsBody, **attributes: Any) -> mujoco.MjsSite:
    """A new site on a body, likewise."""
    return _set(body.add_site(), mujoco.MjSpec().worldbody.add_site(), attributes)


def _set(new: Any, plain: Any, attributes: dict[str, Any]) -> Any:
    for name in dir(plain):
        if not name.startswith("_") and name not in OF_THE_MODEL:
            value = getattr(plain, name)
            if not callable(value):
                setattr(new, name, value)
    for name, value in attributes.items():
        setattr(new, name, value)
    return new

"""Text of the nominal model of a machine."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from hidden_plants.strangers.design import Design
from hidden_plants.strangers.drives import Law, Sensor
from hidden_plants.strangers.skeleton import text
from hidden_plants.strangers.traits import Traits

SENSORS = {
    "position": ("jointpos", "joint"),
    "velocity": ("jointvel", "joint"),
    "length": ("tendonpos", "tendon"),
    "force": ("actuatorfrc", "actuator"),
}
"""Element and attribute of a sensor by its kind."""


def complete_joints(root: Element, traits: Traits, design: Design, ranges: list[str]) -> None:
    """Set the friction, springs and ranges of the joints, and the options of the model."""
    option = root.find("option")
    assert option is not None
    option.set("timestep", f"{design.step:g}")
    option.set("integrator", traits.integrator)
    for i, joint in enumerate(root.iter("joint")):
        joint.set("range", ranges[i])
        joint.set("limited", "false")
        for name, values in (
            ("damping", design.damping),
            ("stiffness", design.stiffness),
            ("armature", design.armature),
            ("frictionloss", design.friction),
        ):
            joint.set(name, text([values[i]]))
        joint.set("springref", "0")
        joint.set("ref", "0")
    for geom in root.iter("geom"):
        if geom.get("type") is not None:
            geom.set("contype", "0")
            geom.set("conaffinity", "0")
    for tendon in root.iter("spatial"):
        for name, value in TENDON.items():
            tendon.set(name, value)


TENDON = {
    "stiffness": "0",
    "damping": "0",
    "frictionloss": "0",
    "armature": "0",
    "limited": "false",
    "springlength": "-1",
}
"""Attributes of a tendon that is a plain cord."""


def write_actuators(root: Element, traits: Traits, law: Law, moved: list[str]) -> None:
    """Add the actuators; none for a log of torques.

    Args:
        root: of the model.
        traits: of the machine.
        law: of the actuators.
        moved: joint or tendon of each actuator.
    """
    if traits.kind == "efforts":
        return
    section = SubElement(root, "actuator")
    on = "tendon" if traits.kind == "tendons" else "joint"
    for i, name in enumerate(moved):
        element = {"name": f"m_{name}", on: name}
        element["forcerange"] = text([law.low[i], law.high[i]])
        if traits.tricky_defaults or traits.kind == "tendons":
            gain, bias = text([law.gain[i]]), text([law.bias[i], law.position[i], law.rate[i]])
            plain = {"dyntype": "none", "gear": "1", "ctrllimited": "false"}
            kind = "none" if traits.kind == "motors" else "affine"
            element |= {**plain, "gainprm": gain, "biastype": kind, "biasprm": bias}
            SubElement(section, "general", element)
        elif traits.kind == "servos":
            gains = {"kp": text([law.gain[i]]), "kv": text([-law.rate[i]])}
            SubElement(section, "position", element | gains)
        else:
            SubElement(section, "motor", element)


def write_sensors(root: Element, sensors: tuple[Sensor, ...]) -> None:
    """Add the sensors."""
    section = SubElement(root, "sensor")
    for sensor in sensors:
        if sensor.kind != "effort":
            tag, on = SENSORS[sensor.kind]
            SubElement(section, tag, {"name": sensor.name, on: sensor.element})


def write_defaults(root: Element, traits: Traits, design: Design) -> None:
    """Add defaults that every element of the model overrides, but a careless edit inherits."""
    if not traits.tricky_defaults:
        return
    defaults = Element("default")
    root.insert(1, defaults)
    force, length = float(np.median(design.limit)), traits.reach
    joint = {"damping": f"{0.2 * force:g}", "stiffness": f"{0.5 * force:g}", "springref": "0.3"}
    joint |= {"armature": f"{float(np.median(design.inertia)):g}", "frictionloss": f"{force:g}"}
    SubElement(defaults, "joint", joint)
    SubElement(defaults, "geom", contype="1", conaffinity="1", density="8000", margin="0.01")
    SubElement(defaults, "site", pos=text([0.1 * length, 0.0, 0.05 * length]), euler="0.3 0 0")
    SubElement(
        defaults,
        "tendon",
        stiffness=f"{0.1 * force / length:g}",
        damping=f"{0.05 * force / length:g}",
        frictionloss=f"{0.02 * force / length:g}",
        springlength=f"{0.05 * length:g}",
    )
    limits = text([-0.1 * force, 0.1 * force])
    SubElement(defaults, "general", dyntype="filter", dynprm="0.05", gear="2", forcerange=limits)


def to_text(root: Element) -> str:
    """Text of a model."""
    indent(root)
    return tostring(root).decode() + "\n"

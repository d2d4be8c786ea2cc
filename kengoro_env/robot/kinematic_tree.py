"""Kinematic tree of a compiled model as plain MJCF: bodies, joints, sites and fixed cameras.

Readers of MJCF other than MuJoCo know a part of it only. The tree needs no more than this part: all
names are written, poses are quaternions, and there are no includes, defaults or frames.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable

import mujoco

_KINDS = {
    int(mujoco.mjtJoint.mjJNT_HINGE): "hinge",
    int(mujoco.mjtJoint.mjJNT_SLIDE): "slide",
    int(mujoco.mjtJoint.mjJNT_BALL): "ball",
    int(mujoco.mjtJoint.mjJNT_FREE): "free",
}


def kinematic_tree(model: mujoco.MjModel) -> str:
    """Text of an MJCF file with the kinematic tree of a model.

    Cameras that follow a body have no fixed pose and are left out, as are elements without a name.

    Args:
        model: compiled from a spec whose joints have names.
    """
    root = ET.Element("mujoco")
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    elements = [ET.SubElement(root, "worldbody")]
    for number in range(1, model.nbody):
        parent = elements[model.body_parentid[number]]
        pose = {"pos": _text(model.body_pos[number]), "quat": _text(model.body_quat[number])}
        name = model.body(number).name or f"body_{number}"
        elements.append(ET.SubElement(parent, "body", {"name": name, **pose}))
    for number in range(model.njnt):
        _add_joint(elements[model.jnt_bodyid[number]], model, number)
    for number in range(model.nsite):
        pose = {"pos": _text(model.site_pos[number]), "quat": _text(model.site_quat[number])}
        _add_named(elements[model.site_bodyid[number]], "site", model.site(number).name, pose)
    fixed = int(mujoco.mjtCamLight.mjCAMLIGHT_FIXED)
    for number in range(model.ncam):
        if int(model.cam_mode[number]) == fixed:
            pose = {"pos": _text(model.cam_pos[number]), "quat": _text(model.cam_quat[number])}
            parent = elements[model.cam_bodyid[number]]
            _add_named(parent, "camera", model.camera(number).name, pose)
    return ET.tostring(root, encoding="unicode")


def _add_joint(body: ET.Element, model: mujoco.MjModel, number: int) -> None:
    joint, kind = model.joint(number), _KINDS[int(model.jnt_type[number])]
    if kind == "free":
        ET.SubElement(body, "freejoint")
        return
    attributes = {"name": joint.name, "type": kind, "pos": _text(model.jnt_pos[number])}
    if kind != "ball":
        attributes["axis"] = _text(model.jnt_axis[number])
        if model.qpos0[model.jnt_qposadr[number]]:
            attributes["ref"] = repr(float(model.qpos0[model.jnt_qposadr[number]]))
    if model.jnt_limited[number]:
        attributes["range"] = _text(model.jnt_range[number])
    ET.SubElement(body, "joint", attributes)


def _add_named(body: ET.Element, tag: str, name: str, pose: dict[str, str]) -> None:
    if name:
        ET.SubElement(body, tag, {"name": name, **pose})


def _text(numbers: Iterable[float]) -> str:
    return " ".join(repr(float(number)) for number in numbers)

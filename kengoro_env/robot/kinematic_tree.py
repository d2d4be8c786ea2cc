"""Kinematic tree of a compiled model as plain MJCF: bodies, joints, sites and fixed cameras.

Readers of MJCF other than MuJoCo know a part of it only. The tree needs no more than this part: all
names are written, poses are quaternions, and there are no includes, defaults or frames.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable

import mujoco
import numpy as np

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
        elements.append(_add_body(elements[model.body_parentid[number]], model, number))
    for number in range(model.nsite):
        pose = _pose(model.site_pos[number], model.site_quat[number])
        _add_named(elements[model.site_bodyid[number]], "site", model.site(number).name, pose)
    fixed = int(mujoco.mjtCamLight.mjCAMLIGHT_FIXED)
    for number in range(model.ncam):
        if int(model.cam_mode[number]) == fixed:
            pose = _pose(model.cam_pos[number], model.cam_quat[number])
            parent = elements[model.cam_bodyid[number]]
            _add_named(parent, "camera", model.camera(number).name, pose)
    return ET.tostring(root, encoding="unicode")


def _add_body(parent: ET.Element, model: mujoco.MjModel, number: int) -> ET.Element:
    """Add a body and its joints to its parent; return the element for what the body carries.

    A joint whose angle in the file is not zero gets a body of its own, which is turned back by
    that angle: readers ignore or refuse `ref`. So do the joints after it, to keep their order.
    """
    name = model.body(number).name or f"body_{number}"
    body = ET.SubElement(parent, "body", _pose(model.body_pos[number], model.body_quat[number]))
    first = int(model.body_jntadr[number])
    for rank, joint in enumerate(range(first, first + int(model.body_jntnum[number]))):
        at = int(model.jnt_qposadr[joint])
        hinge_or_slide = _KINDS[int(model.jnt_type[joint])] in ("hinge", "slide")
        if hinge_or_slide and model.qpos0[at]:
            body.set("name", f"{name}_joint_{rank}")
            body = ET.SubElement(body, "body", _turned_back(model, joint, model.qpos0[at]))
        _add_joint(body, model, joint)
    body.set("name", name)
    return body


def _turned_back(model: mujoco.MjModel, joint: int, angle: float) -> dict[str, str]:
    """Pose by which a hinge or slide moves from an angle [rad, m] to zero."""
    anchor, axis = model.jnt_pos[joint], model.jnt_axis[joint]
    if _KINDS[int(model.jnt_type[joint])] == "slide":
        return {"pos": _text(-angle * axis)}
    quaternion, turned = np.empty(4), np.empty(3)
    mujoco.mju_axisAngle2Quat(quaternion, axis, -angle)
    mujoco.mju_rotVecQuat(turned, anchor, quaternion)
    return _pose(anchor - turned, quaternion)


def _add_joint(body: ET.Element, model: mujoco.MjModel, number: int) -> None:
    joint, kind = model.joint(number), _KINDS[int(model.jnt_type[number])]
    if kind == "free":
        ET.SubElement(body, "freejoint")
        return
    attributes = {"name": joint.name, "type": kind, "pos": _text(model.jnt_pos[number])}
    if kind != "ball":
        attributes["axis"] = _text(model.jnt_axis[number])
    if model.jnt_limited[number]:
        attributes["range"] = _text(model.jnt_range[number])
    ET.SubElement(body, "joint", attributes)


def _pose(position: Iterable[float], quaternion: Iterable[float]) -> dict[str, str]:
    return {"pos": _text(position), "quat": _text(quaternion)}


def _add_named(body: ET.Element, tag: str, name: str, pose: dict[str, str]) -> None:
    if name:
        ET.SubElement(body, tag, {"name": name, **pose})


def _text(numbers: Iterable[float]) -> str:
    return " ".join(repr(float(number)) for number in numbers)

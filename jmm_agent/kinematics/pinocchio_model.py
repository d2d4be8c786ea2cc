"""Reads the kinematic tree of an MJCF file for Pinocchio, around the defects of its reader.

Pinocchio 4.1 reads MJCF, but silently drops the pose and the sites of a root body without joints,
every root body but the first, and cameras; it merges several joints of one body into one, and
ignores `<frame>`, a joint's `ref` and the default pose of sites. So the kinematic part of the
file is rewritten first:

* all bodies are placed below two bodies without joints, whose poses are zero and may be dropped;
* a body with several joints becomes a chain of bodies with one each;
* joints get a prefix, because Pinocchio confuses a joint with a body of the same name;
* cameras become sites, and bodies that float freely are removed, because their poses do not depend
  on the joints;
* `<frame>`, `ref` and default poses of sites and cameras are refused.
"""

from __future__ import annotations

import os
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from jmm_agent.errors import AgentError

CAMERA_ATTRIBUTES = ("name", "pos", "quat", "axisangle", "euler", "xyaxes", "zaxis")
KINEMATIC_SECTIONS = ("compiler", "default", "worldbody")
KINEMATIC_ELEMENTS = ("body", "joint", "site")
JOINT_PREFIX = "joint/"
OPENCV_IN_MUJOCO = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.zeros(3))


class KinematicsError(AgentError):
    """A file, joint, frame, posture or pose that the kinematics cannot use."""


def load_model(
    path: str | os.PathLike[str], joints: Sequence[str], locked: Mapping[str, float]
) -> tuple[Any, list[str], dict[str, int]]:
    """Read Pinocchio's model of some joints; all others are locked.

    Args:
        path: MJCF file.
        joints: names of the joints that move.
        locked: angles of other joints [rad]; zero where left out.

    Returns:
        Pinocchio's model, the names of its joints in its own order, and the numbers of its frames
        by name. Frames are sites, bodies and cameras; a site or camera takes precedence over a body
        of its name. Cameras follow OpenCV's convention: x right, y down, z forward.

    Raises:
        KinematicsError: the file is missing or broken, or has no such joint.
    """
    root = _read(Path(path))
    cameras = _kinematic_part(root)
    with tempfile.TemporaryDirectory() as folder:
        beside = Path(folder) / "kinematics.xml"
        ET.ElementTree(root).write(beside)
        try:
            whole = pin.buildModelFromMJCF(str(beside))
        except (RuntimeError, ValueError) as error:
            raise KinematicsError(
                f"MJCF {os.fspath(path)}: Pinocchio refuses it: {error}"
            ) from error

    names = [name.removeprefix(JOINT_PREFIX) for name in whole.names][1:]
    identity = {name: rank + 1 for rank, name in enumerate(names)}
    for joint in (*joints, *locked):
        if joint not in names:
            raise KinematicsError(f"Kinematics: unknown joint {joint!r}; joints are {names}.")
    if len(set(joints)) != len(joints) or not joints or set(joints) & set(locked):
        raise KinematicsError("Kinematics: joints must be one or more, each once, none locked.")
    posture = pin.neutral(whole)
    for joint, angle in locked.items():
        posture[whole.joints[identity[joint]].idx_q] = angle
    others = [identity[name] for name in names if name not in joints]
    model = pin.buildReducedModel(whole, others, posture)

    frames: dict[str, int] = {}
    for kind in (pin.FrameType.BODY, pin.FrameType.OP_FRAME):
        frames |= {f.name: i for i, f in enumerate(model.frames) if f.type == kind}
    for name in cameras:
        frame = model.frames[frames[name]]
        frame.placement = frame.placement * OPENCV_IN_MUJOCO
    return model, [name.removeprefix(JOINT_PREFIX) for name in model.names][1:], frames


def _read(path: Path) -> ET.Element:
    """The root element of a file, its includes replaced by their content."""
    try:
        root = ET.parse(path).getroot()
    except FileNotFoundError:
        raise KinematicsError(f"MJCF {path}: there is no such file.") from None
    except (OSError, ET.ParseError) as error:
        raise KinematicsError(f"MJCF {path}: cannot be read: {error}.") from error
    for parent in list(root.iter()):
        for position, element in reversed(list(enumerate(parent))):
            if element.tag == "include":
                parent.remove(element)
                included = _read(path.parent / element.get("file", ""))
                parent[position:position] = list(included)
    if root.tag != "mujoco" or root.find("worldbody") is None:
        raise KinematicsError(f"MJCF {path}: it has no <mujoco> with a <worldbody>.")
    return root


def _kinematic_part(root: ET.Element) -> list[str]:
    """Reduce the root to what Pinocchio reads as MuJoCo does; return the names of cameras."""
    for element in root.iter():
        if element.tag == "frame":
            raise KinematicsError("MJCF: <frame> is not supported; write its pose into its bodies.")
        if element.tag == "joint" and float(element.get("ref", 0)) != 0:
            raise KinematicsError(
                f"MJCF: joint {element.get('name')!r} has a ref, which must be 0."
            )
    for default in root.iter("default"):
        for tag in ("site", "camera", "body"):
            for element in default.findall(tag):
                if any(key in element.attrib for key in CAMERA_ATTRIBUTES):
                    raise KinematicsError(f"MJCF: a default pose of a {tag} is not supported.")
    for section in list(root):
        if section.tag not in KINEMATIC_SECTIONS:
            root.remove(section)
    cameras: list[str] = []
    content: list[ET.Element] = []
    for world in root.findall("worldbody"):
        _prune(world, cameras)
        content += list(world)
        root.remove(world)
    dropped = ET.SubElement(ET.SubElement(root, "worldbody"), "body", name="pinocchio_root")
    ET.SubElement(dropped, "body", name="pinocchio_world").extend(content)
    return cameras


def _prune(parent: ET.Element, cameras: list[str]) -> None:
    """Keep bodies, joints and sites below an element; cameras become sites."""
    for position, element in reversed(list(enumerate(parent))):
        if element.tag == "camera" and "name" in element.attrib:
            cameras.append(element.attrib["name"])
            kept = {key: element.attrib[key] for key in CAMERA_ATTRIBUTES if key in element.attrib}
            parent[position] = ET.Element("site", kept)
        elif element.tag not in KINEMATIC_ELEMENTS or _floats_freely(element):
            parent.remove(element)
        elif element.tag == "joint":
            element.set("name", JOINT_PREFIX + element.get("name", ""))
        elif element.tag == "body":
            _prune(element, cameras)
            parent[position] = _one_joint_a_body(element)


def _floats_freely(element: ET.Element) -> bool:
    """Whether an element is a body with a free joint."""
    joints = element.findall("joint") if element.tag == "body" else []
    free = any(joint.get("type") == "free" for joint in joints)
    return free or element.find("freejoint") is not None


def _one_joint_a_body(body: ET.Element) -> ET.Element:
    """A body as a chain of bodies with one joint each, the last with its name and content."""
    joints = body.findall("joint")
    if len(joints) < 2:
        return body
    pose = {key: body.attrib.pop(key) for key in CAMERA_ATTRIBUTES[1:] if key in body.attrib}
    inherited = {"childclass": body.attrib["childclass"]} if "childclass" in body.attrib else {}
    outer = inner = ET.Element("body", {"name": f"{body.get('name')}_joint_0"} | pose | inherited)
    for rank, joint in enumerate(joints[:-1]):
        body.remove(joint)
        inner.append(joint)
        if rank + 2 < len(joints):
            inner = ET.SubElement(inner, "body", name=f"{body.get('name')}_joint_{rank + 1}")
    inner.append(body)
    return outer

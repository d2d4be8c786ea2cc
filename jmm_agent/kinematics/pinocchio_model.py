"""The kinematic tree of an MJCF file for Pinocchio, without the traps of its reader.

Pinocchio 4.1 reads MJCF, but silently drops the pose and the sites of a root body without joints,
every root body but the first, and cameras; it merges several joints of one body into one, and
ignores `<frame>`, a joint's `ref` and the default pose of sites. So the kinematic part of the
file is rewritten first:

* everything hangs below two bodies without joints, whose poses are zero and may be dropped;
* a body with several joints becomes a chain of bodies with one each;
* joints get a prefix, since a body of the same name makes Pinocchio stumble;
* cameras become sites; bodies that float freely (their pose is no function of the joints) go;
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
    """The kinematics were given a file, joint, frame, posture or pose that they cannot use."""


def load_model(
    path: str | os.PathLike[str], joints: Sequence[str], locked: Mapping[str, float]
) -> tuple[Any, list[str], dict[str, int]]:
    """Pinocchio's model of some joints, their names in its own order, and its frames.

    All joints but `joints` are locked at `locked` [rad], or at zero.

    Frames are sites, bodies and cameras by name (a body yields to a site or camera of its name).
    Cameras are in OpenCV's convention: x right, y down, z forward.

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
    """The file's root element, with includes in their places."""
    try:
        root = ET.parse(path).getroot()
    except FileNotFoundError:
        raise KinematicsError(f"MJCF {path}: there is no such file.") from None
    except (OSError, ET.ParseError) as error:
        raise KinematicsError(f"MJCF {path}: cannot be read: {error}.") from error
    for parent in list(root.iter()):
        for place, child in reversed(list(enumerate(parent))):
            if child.tag == "include":
                parent.remove(child)
                included = _read(path.parent / child.get("file", ""))
                parent[place:place] = list(included)
    if root.tag != "mujoco" or root.find("worldbody") is None:
        raise KinematicsError(f"MJCF {path}: it has no <mujoco> with a <worldbody>.")
    return root


def _kinematic_part(root: ET.Element) -> list[str]:
    """Reduce `root` to what Pinocchio reads as MuJoCo does; returns the cameras' names."""
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
    """Keep bodies, joints and sites below `parent`; cameras become sites."""
    for place, child in reversed(list(enumerate(parent))):
        if child.tag == "camera" and "name" in child.attrib:
            cameras.append(child.attrib["name"])
            kept = {key: child.attrib[key] for key in CAMERA_ATTRIBUTES if key in child.attrib}
            parent[place] = ET.Element("site", kept)
        elif child.tag not in KINEMATIC_ELEMENTS or _floats(child):
            parent.remove(child)
        elif child.tag == "joint":
            child.set("name", JOINT_PREFIX + child.get("name", ""))
        elif child.tag == "body":
            _prune(child, cameras)
            parent[place] = _one_joint_a_body(child)


def _floats(element: ET.Element) -> bool:
    joints = element.findall("joint") if element.tag == "body" else []
    free = any(joint.get("type") == "free" for joint in joints)
    return free or element.find("freejoint") is not None


def _one_joint_a_body(body: ET.Element) -> ET.Element:
    """A chain of bodies with one joint each; the last one has the name and the content."""
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

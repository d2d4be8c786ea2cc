"""Reads model files, ours and those of others, and prepares them for muscles."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

import mujoco

from kengoro_env.assets import assets_root
from kengoro_env.errors import ModelError
from mjcf_sandbox.errors import UntrustedFileError
from mjcf_sandbox.mjcf import check_model
from mjcf_sandbox.trial_compile import read_model

_ACTUATOR = int(mujoco.mjtObj.mjOBJ_ACTUATOR)
_FREE = int(mujoco.mjtJoint.mjJNT_FREE)


def read_spec(path: Path | str, folders: Sequence[Path | str] = ()) -> mujoco.MjSpec:
    """Read a model file as it is.

    A model from elsewhere may name files in its folder, in our assets and in ``folders``.

    Args:
        path: MJCF file, of any suffix.
        folders: further folders whose files the model may include or load.

    Raises:
        ModelError: the file is missing, broken, or names files elsewhere.
    """
    path = Path(path)
    if not os.path.isfile(path):  # also for a name that is too long
        if str(path).lstrip().startswith("<"):
            raise ModelError(
                "a model file is given by its path, not by its text, which "
                "mujoco.MjSpec.from_string reads"
            )
        raise ModelError(f"no model file at {path}")
    try:
        if not is_asset(path):
            allowed = (path.parent, assets_root(), *(Path(folder) for folder in folders))
            check_model(path, allowed)
        return read_model(path)
    except ValueError as error:
        reason = str(error).splitlines()[0]
        raise ModelError(f"the model file {path} is not valid MJCF: {reason}") from error
    except UntrustedFileError as error:
        hint = ", or name its folder in `folders`" if "lies outside" in str(error) else ""
        raise ModelError(f"the model file {path} {error}{hint}") from error


def load_spec(path: Path | str, folders: Sequence[Path | str] = ()) -> mujoco.MjSpec:
    """Read a model file and prepare it for a robot that muscles move.

    Joints and tendons without a name get one (`joint_3`, `tendon_0`). The file's actuators of
    tendons and of joints are removed, with the sensors and keyframes that need them, because the
    motors of the muscles replace them; `motor_gains` reads their force limits before.

    Args:
        path: MJCF file, of any suffix.
        folders: further folders whose files the model may include or load.

    Raises:
        ModelError: the file is missing, broken, or names files elsewhere.
    """
    spec = read_spec(path, folders)
    name_elements("joint", [joint for joint in spec.joints if int(joint.type) != _FREE])
    name_elements("tendon", spec.tendons)
    if spec.actuators:
        for sensor in list(spec.sensors):
            if int(sensor.objtype) == _ACTUATOR:
                spec.delete(sensor)
        for element in [*spec.keys, *spec.actuators]:
            spec.delete(element)
    return spec


def is_asset(path: Path | str) -> bool:
    """Whether a file is one of our assets."""
    return Path(path).resolve().is_relative_to(assets_root().resolve())


def is_muscle(tendon: mujoco.MjsTendon) -> bool:
    """Whether a tendon is a muscle: spatial, not a coupling of joints."""
    path = tendon.path
    return len(path) > 0 and int(path[0].type) != int(mujoco.mjtWrap.mjWRAP_JOINT)


def name_elements(kind: str, elements: Iterable[mujoco.MjsElement]) -> None:
    """Name the elements of a kind that have no name: the kind and a number.

    Args:
        kind: such as "joint".
        elements: all elements of the kind, in the order of the model.
    """
    elements = list(elements)
    taken = {element.name for element in elements}
    for number, element in enumerate(elements):
        if not element.name:
            name = f"{kind}_{number}"
            while name in taken:
                name += "_"
            taken.add(name)
            element.name = name

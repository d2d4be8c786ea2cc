"""Whether a hand detector can be trained on a model: what is refused, in one sentence."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from kengoro.errors import UsageError
from kengoro.hand_detector.hand_points import hand_geoms
from kengoro_env.robot.subtree import subtree

ASPECT = 4.0 / 3.0
"""Width of the frames that are rendered over their height [1]."""


def check_model(path: Path, body: str, camera: str, hidden: Sequence[str] = ()) -> None:
    """Refuse a model that no hand detector can be trained on.

    Args:
        path: of the MJCF.
        body: name of the hand's body.
        camera: name of the camera.
        hidden: names of geoms that are not drawn.

    Raises:
        UsageError: it cannot be read, lacks one of the names, draws nothing of the hand, has a
            camera of another kind, or no joint between camera and hand.
    """
    if not path.is_file():
        raise UsageError(f"There is no model {path}; an MJCF file is needed.")
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise UsageError(f"MuJoCo cannot read {path}: {error}") from error
    for kind, name in (("body", body), ("camera", camera), *(("geom", n) for n in hidden)):
        count = {"body": model.nbody, "camera": model.ncam, "geom": model.ngeom}[kind]
        names = [getattr(model, {"camera": "cam"}.get(kind, kind))(i).name for i in range(count)]
        if name not in names:
            there = ", ".join(sorted(filter(None, names))) or "none"
            raise UsageError(f"{path} has no {kind} {name!r}; it has: {there}.")
    if not hand_geoms(model, model.body(body).id) - {model.geom(name).id for name in hidden}:
        raise UsageError(
            f"Nothing of the body {body!r} is drawn: neither it nor the bodies at it have a geom "
            "of finite size in the groups 0 to 2 that is not hidden."
        )
    _check_camera(model, camera)
    if not _moves(model, body, camera):
        raise UsageError(
            f"No joint moves the body {body!r} in the view of the camera {camera!r}; name a hand "
            "and a camera that move against each other."
        )


def _check_camera(model: mujoco.MjModel, name: str) -> None:
    """Refuse cameras whose images are not those of a field of view and square pixels."""
    camera = model.camera(name)
    if model.cam_projection[camera.id] != mujoco.mjtProjection.mjPROJ_PERSPECTIVE:
        raise UsageError(f"The camera {name!r} is orthographic; a perspective one is needed.")
    width, height = model.cam_sensorsize[camera.id]
    if width == 0.0 or height == 0.0:
        return
    fx, fy, cx, cy = model.cam_intrinsic[camera.id]
    if not np.allclose([fx / fy, width / height, cx, cy], [1.0, ASPECT, 0.0, 0.0], atol=1e-6):
        raise UsageError(
            f"The camera {name!r} has a sensor that is not 4 : 3, or a focal length or principal "
            "point of its own; give it a fovy instead. The detector serves any camera later."
        )


def _moves(model: mujoco.MjModel, body: str, camera: str) -> bool:
    """Whether a joint lies between the bodies of hand and camera."""
    at = int(model.cam_bodyid[model.camera(camera).id])
    if model.cam_mode[model.camera(camera).id] != mujoco.mjtCamLight.mjCAMLIGHT_FIXED:
        return True
    hand = model.body(body).id
    with_joints = np.flatnonzero(model.body_jntnum > 0)
    carried = (subtree(model, int(number)) for number in with_joints)
    return any(bool(moved[at]) != bool(moved[hand]) for moved in carried)

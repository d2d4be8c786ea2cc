"""Public models, which have neither a marker nor a camera: both are added."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from experiments.other_robots.models import MARKER
from kengoro_env.robot.model_file import read_spec
from kengoro_env.robot.nominal_model import NominalArm
from mjcf_sandbox.files import write_text

SHARE = 0.2
"""Side of the plate, as a share of how far the last body is from the first joint [1]."""
AWAY = 9.0
"""Distance of the camera from the plate, in sides of the plate [1]."""
SQUARE = 5.0 / 6.0
"""Side of the marker's black square, as a share of the plate's side [1]."""


def add_marker(path: Path, folder: Path) -> tuple[Path, float]:
    """Write a model with a marker on its last moved body, and a camera that faces it.

    Args:
        path: MJCF file with muscles.
        folder: of the new file.

    Returns:
        Path of the new file, and the side of the marker [m].
    """
    arm = NominalArm(path)
    model, data = arm.model, mujoco.MjData(arm.model)
    joints = [model.joint(name) for name in arm.joints]
    for joint, angle in zip(joints, 0.5 * (arm.lower + arm.upper), strict=True):
        data.qpos[joint.qposadr[0]] = angle
    mujoco.mj_forward(model, data)
    last = int(model.jnt_bodyid[joints[-1].id])
    geoms = np.flatnonzero(model.geom_bodyid == last)
    centre = data.geom_xpos[geoms].mean(axis=0) if len(geoms) else data.xpos[last]
    side = SHARE * float(np.linalg.norm(centre - data.xanchor[joints[0].id]))
    outward = np.array([0.0, -1.0, 0.0])
    radius = float(model.geom_rbound[geoms].max()) if len(geoms) else 0.0
    plate = centre + (radius + side / 4) * outward
    upright = np.column_stack([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], outward])
    spec = read_spec(path)
    _add_plate(spec, model, data, last, plate, upright, side)
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, upright.ravel())
    position = plate + AWAY * side * outward
    spec.worldbody.add_camera(name="eye", pos=position, quat=quat, fovy=45.0)
    spec.compile()
    target = folder / f"{path.stem}.xml"
    write_text(target, spec.to_xml())
    return target, SQUARE * side


def _add_plate(
    spec: mujoco.MjSpec,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    body: int,
    position: np.ndarray,
    rotation: np.ndarray,
    side: float,
) -> None:
    """Add a plate with a marker to a body, at a pose in the world."""
    texture = spec.add_texture(name="marker_plate", type=mujoco.mjtTexture.mjTEXTURE_2D)
    texture.file = str(MARKER)
    material = spec.add_material(name="marker_plate")
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "marker_plate"
    turned = data.xmat[body].reshape(3, 3)
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, (turned.T @ rotation).ravel())
    local = turned.T @ (position - data.xpos[body])
    owner = spec.bodies[body]
    geom = owner.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, pos=local, quat=quat)
    geom.size = [side / 2, side / 2, side / 60]
    geom.mass, geom.material, geom.contype, geom.conaffinity = 1e-6, "marker_plate", 0, 0
    normal = turned.T @ rotation[:, 2]
    owner.add_site(name="marker_hand", pos=local + side / 60 * normal, quat=quat)

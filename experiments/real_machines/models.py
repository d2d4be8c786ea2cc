"""Models of machines from files of their repositories: URDF or MJCF, reduced to what a log needs.

Meshes are removed, for the files give the inertia of each link and often not the meshes; contacts
go with them. Joints that are not in the log are welded.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import mujoco
import numpy as np

from experiments.harness.errors import ExperimentError
from mjcf_sandbox.files import write_text

LEAST_MASS, LEAST_INERTIA = 1e-6, 1e-8
"""Mass [kg] and inertia [kg m^2] of links that have less, so that the model compiles."""


def read_model(path: Path, joints: Collection[str]) -> mujoco.MjSpec:
    """Read a model without meshes and without other joints than ``joints``.

    Raises:
        ExperimentError: the file is no model, or lacks one of the joints.
    """
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except (OSError, ValueError) as error:
        raise ExperimentError(
            f"{path} cannot be read as a model: {' '.join(str(error).split())}"
        ) from error
    if lacking := set(joints) - {joint.name for joint in spec.joints}:
        raise ExperimentError(f"{path} has no joint {sorted(lacking)[0]!r}.")
    _remove(spec, joints)
    spec.compiler.boundmass, spec.compiler.boundinertia = LEAST_MASS, LEAST_INERTIA
    spec.compiler.balanceinertia = True
    for body in spec.bodies:
        _make_inertia_possible(body)
    return spec


def add_position_sensor(spec: mujoco.MjSpec, joint: str) -> str:
    """Add a sensor of a joint's position and return its name."""
    name = f"{joint}_position"
    spec.add_sensor(
        name=name,
        type=mujoco.mjtSensor.mjSENS_JOINTPOS,
        objtype=mujoco.mjtObj.mjOBJ_JOINT,
        objname=joint,
    )
    return name


def write_model(spec: mujoco.MjSpec, path: Path) -> Path:
    """Compile a model and write its MJCF.

    Raises:
        ExperimentError: it does not compile.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        spec.compile()
        write_text(path, spec.to_xml())
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise ExperimentError(f"The model of {path} does not compile: {reason}") from error
    return path


def _remove(spec: mujoco.MjSpec, joints: Collection[str]) -> None:
    """Remove meshes, other joints, and what refers to these."""
    other = {joint.name for joint in spec.joints} - set(joints)
    for geom in list(spec.geoms):
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
            spec.delete(geom)
        else:
            geom.contype = geom.conaffinity = 0
    for mesh in list(spec.meshes):
        spec.delete(mesh)
    for actuator in list(spec.actuators):
        if actuator.target in other:
            spec.delete(actuator)
    for equality in list(spec.equalities):
        if {equality.name1, equality.name2} & other:
            spec.delete(equality)
    for joint in list(spec.joints):
        if joint.name in other:
            spec.delete(joint)


def _make_inertia_possible(body: mujoco.MjsBody) -> None:
    """Replace an inertia that no link can have by that of a small ball."""
    xx, yy, zz, xy, xz, yz = body.fullinertia
    if not np.isfinite(xx):
        return
    size = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if size[0] <= 0.0:
        body.fullinertia = np.full(6, np.nan)
        body.inertia = np.full(3, max(float(size[-1]), LEAST_INERTIA))

"""Nominal model of a machine: the model that the diagnosis gets, and the names of its parts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import mujoco
import numpy as np

from hidden_plants.types import Floats

MACHINES = ("elbow", "arm")
ASSETS = Path("assets/mjcf/kengoro_arm")
"""Folder of elbow.xml and arm.xml, relative to the root of the repository."""

STIFFNESS = 30e3
"""Gain of the stiffness control of every tendon [N/m]."""
BIAS = 30.0
"""Tension that the motor holds at and below the target length [N]."""
CUT = 500.0
"""Upper limit of a motor's tension [N]."""
TENDON_DAMPING = 150.0
"""Damping of every tendon's path [N s/m]."""

MARKER = "marker_hand"
HAND = "hand"
CAMERAS = {"elbow": "outside", "arm": "eye"}


@dataclass(frozen=True, eq=False)
class Machine:
    """Nominal model of a machine.

    Attributes:
        name: "elbow" or "arm".
        xml: MJCF of the nominal model with actuators and sensors.
        model: the compiled ``xml``; callers must not modify it.
        tendons: names of the tendons, in the order of the actuators.
        joints: names of the joints, in the order of ``qpos``.
        sites: names of the sites on the tendons' paths.
        paths: names of the sites of each tendon, in order.
        bodies: names of the bodies that move.
        camera: name of the camera that observes the marker.
    """

    name: str
    xml: str
    model: mujoco.MjModel
    tendons: tuple[str, ...]
    joints: tuple[str, ...]
    sites: tuple[str, ...]
    paths: tuple[tuple[str, ...], ...]
    bodies: tuple[str, ...]
    camera: str

    def spec(self) -> mujoco.MjSpec:
        """A new spec of the nominal model, to be edited."""
        return mujoco.MjSpec.from_string(self.xml)

    def lengths(self, qpos: Floats) -> Floats:
        """Tendon lengths (k, tendons) [m] at joint positions ``qpos`` (k, joints) [rad]."""
        return _lengths(self.model, np.atleast_2d(qpos))

    def moment_arms(self, qpos: Floats) -> Floats:
        """Moment arms dl/dq (k, tendons, joints) [m/rad] at ``qpos`` (k, joints) [rad]."""
        step = 1e-5
        columns = []
        for turn in np.eye(qpos.shape[1]) * step:
            difference = self.lengths(qpos + turn) - self.lengths(qpos - turn)
            columns.append(difference / (2.0 * step))
        return np.stack(columns, axis=2)

    def gravity_torques(self, qpos: Floats) -> Floats:
        """Torques (k, joints) [N m] that hold ``qpos`` (k, joints) [rad] against gravity."""
        data = mujoco.MjData(self.model)
        torques = np.zeros((len(qpos), self.model.nv))
        for torque, posture in zip(torques, qpos, strict=True):
            data.qpos[:] = posture
            mujoco.mj_kinematics(self.model, data)
            mujoco.mj_comPos(self.model, data)
            mujoco.mj_comVel(self.model, data)
            mujoco.mj_rne(self.model, data, 0, torque)
        return torques


def _lengths(model: mujoco.MjModel, qpos: Floats) -> Floats:
    data = mujoco.MjData(model)
    lengths = np.empty((len(qpos), model.ntendon))
    for i, row in enumerate(qpos):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_tendon(model, data)
        lengths[i] = data.ten_length
    return lengths


@lru_cache(maxsize=8)
def load(name: str, assets: Path) -> Machine:
    """Read a nominal model and add its motors and sensors.

    Args:
        name: one of `MACHINES`.
        assets: folder of elbow.xml and arm.xml.

    Raises:
        ValueError: the name is unknown, or the file is missing.
    """
    if name not in MACHINES:
        raise ValueError(f"unknown machine {name!r}; valid are: {', '.join(MACHINES)}")
    path = assets / f"{name}.xml"
    if not path.is_file():
        raise ValueError(f"no model at {path}; assets must be the folder of elbow.xml and arm.xml")
    spec = mujoco.MjSpec.from_file(str(path))
    _strip(spec)
    tendons = tuple(tendon.name for tendon in spec.tendons)
    _add_motors(spec, tendons)
    _add_sensors(spec, tendons, CAMERAS[name])
    model = spec.compile()
    paths = tuple(_path_sites(model, i) for i in range(model.ntendon))
    moving = [i for i in range(1, model.nbody) if model.body_weldid[i] != 0]
    return Machine(
        name=name,
        xml=spec.to_xml(),
        model=model,
        tendons=tendons,
        joints=tuple(model.joint(i).name for i in range(model.njnt)),
        sites=tuple(dict.fromkeys(site for path in paths for site in path)),
        paths=paths,
        bodies=tuple(model.body(i).name for i in moving),
        camera=CAMERAS[name],
    )


def _strip(spec: mujoco.MjSpec) -> None:
    """Remove what is only seen, and the joints of the fingers, which no tendon moves."""
    for geom in list(spec.geoms):
        if geom.meshname:
            spec.delete(geom)
    for mesh in list(spec.meshes):
        spec.delete(mesh)
    for element in [*spec.textures, *spec.materials]:
        spec.delete(element)
    for geom in spec.geoms:
        geom.material = ""
    for joint in list(spec.joints):
        if "finger" in joint.name or "thumb" in joint.name:
            spec.delete(joint)


def _add_motors(spec: mujoco.MjSpec, tendons: tuple[str, ...]) -> None:
    for tendon in tendons:
        spec.tendon(tendon).damping[0] = TENDON_DAMPING
        motor = spec.add_actuator(
            name=tendon, trntype=mujoco.mjtTrn.mjTRN_TENDON, target=tendon, forcelimited=True
        )
        motor.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        motor.gainprm[0] = STIFFNESS
        motor.biasprm[:2] = [-BIAS, -STIFFNESS]
        motor.forcerange[:] = [-CUT, -BIAS]


def _add_sensors(spec: mujoco.MjSpec, tendons: tuple[str, ...], camera: str) -> None:
    kinds = mujoco.mjtSensor
    for tendon in tendons:
        _sensor(
            spec, f"length_{tendon}", kinds.mjSENS_TENDONPOS, mujoco.mjtObj.mjOBJ_TENDON, tendon
        )
    for tendon in tendons:
        kind = mujoco.mjtObj.mjOBJ_ACTUATOR
        _sensor(spec, f"tension_{tendon}", kinds.mjSENS_ACTUATORFRC, kind, tendon)
    for name, kind in (
        ("marker_position", kinds.mjSENS_FRAMEPOS),
        ("marker_orientation", kinds.mjSENS_FRAMEQUAT),
    ):
        sensor = _sensor(spec, name, kind, mujoco.mjtObj.mjOBJ_SITE, MARKER)
        sensor.reftype = mujoco.mjtObj.mjOBJ_CAMERA
        sensor.refname = camera


def _sensor(
    spec: mujoco.MjSpec,
    name: str,
    kind: mujoco.mjtSensor,
    objtype: mujoco.mjtObj,
    objname: str,
) -> mujoco.MjsSensor:
    return spec.add_sensor(name=name, type=kind, objtype=objtype, objname=objname)


def _path_sites(model: mujoco.MjModel, tendon: int) -> tuple[str, ...]:
    start, count = int(model.tendon_adr[tendon]), int(model.tendon_num[tendon])
    return tuple(model.site(int(i)).name for i in model.wrap_objid[start : start + count])

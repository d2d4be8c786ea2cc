"""Plants for tests of causes: the arm, its elbow, and models with one cause."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from reality_gap.causes import find_cause
from reality_gap.causes.base import Location
from reality_gap.simulation.hypothesis import Candidate, Plant, build
from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.study.system import System, compile_system
from tests.reality_gap.causes.machines import sensed

ASSETS = Path(__file__).parents[3] / "assets" / "mjcf" / "kengoro_arm"


def system_of(path: Path) -> System:
    """A system all of whose sensors are measured."""
    model = mujoco.MjModel.from_xml_path(str(path))
    time = np.array([0.0, 1.0])
    channels = tuple(Channel(c.name, c.sensor, c.component) for c in sensed(model))
    readings = tuple(Reading(time, np.zeros(2)) for _ in channels)
    episode = Episode("still", time, np.zeros((2, model.nu)), readings)
    return compile_system(Study("test", path, channels, (episode,)))


def robot(folder: Path, name: str) -> System:
    """A nominal model of a robot with a length servo on each tendon."""
    spec = mujoco.MjSpec.from_file(str(ASSETS / f"{name}.xml"))
    spec.compiler.texturedir, spec.compiler.meshdir = (
        str(ASSETS / "textures"),
        str(ASSETS / "meshes"),
    )
    for tendon in spec.tendons:
        servo = spec.add_actuator(name=tendon.name, target=tendon.name)
        servo.trntype = mujoco.mjtTrn.mjTRN_TENDON
        servo.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        servo.gainprm[0], servo.biasprm[:2] = 2e4, [-20.0, -2e4]
        sensor = spec.add_sensor(
            name=f"length_{tendon.name}", type=mujoco.mjtSensor.mjSENS_TENDONPOS
        )
        sensor.objtype, sensor.objname = mujoco.mjtObj.mjOBJ_TENDON, tendon.name
    spec.compile()
    path = folder / f"{name}.xml"
    path.write_text(spec.to_xml())
    return system_of(path)


def plant_with(system: System, id: str, location: Location, **values: float) -> Plant:
    """A plant with one cause, whose other parameters are null."""
    candidate = Candidate(find_cause(id), location, find_cause(id).parameters(system, location))
    unknown = set(values) - set(candidate.null_values())
    assert not unknown, unknown
    return build(system, [(candidate, candidate.null_values() | values)])


def at(model: mujoco.MjModel, **joints: float) -> mujoco.MjData:
    """Data at a posture."""
    data = mujoco.MjData(model)
    for name, position in joints.items():
        data.joint(name).qpos = position
    mujoco.mj_forward(model, data)
    return data

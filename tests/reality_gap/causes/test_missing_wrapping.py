"""Wires that are drawn straight and run over something: on a crane, the elbow and the arm."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap.causes import cause
from reality_gap.causes.base import Location
from reality_gap.causes.support import obstacles, tendon_paths
from reality_gap.simulation.hypothesis import Candidate, Plant, build
from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.study.system import System, look_at

ASSETS = Path(__file__).parents[3] / "assets" / "mjcf" / "kengoro_arm"

CRANE = """
<mujoco>
  <default><site size="0.003"/></default>
  <worldbody>
    <site name="hook_0" pos="-0.1 0 0.06"/>
    <body name="jib">
      <joint name="luff" axis="0 1 0" range="-20 20" limited="true"/>
      <geom name="knuckle" type="sphere" size="0.015" mass="0.1"/>
      <geom name="drum" type="cylinder" size="0.012 0.02" zaxis="0 1 0" mass="0.1"/>
      <geom type="capsule" size="0.02" fromto="0 0 0 0.4 0 0" mass="2"/>
      <site name="hook_1" pos="0.2 0.01 0.03"/>
    </body>
  </worldbody>
  <tendon>
    <spatial name="rope" stiffness="100 20" springlength="0.1 0.2" damping="3" armature="0.5"
             range="0 2" limited="true" frictionloss="0.1" rgba="1 0 0 1" width="0.004">
      <site site="hook_0"/><site site="hook_1"/>
    </spatial>
    <fixed name="tie"><joint joint="luff" coef="2"/></fixed>
  </tendon>
  <equality><tendon tendon1="rope" tendon2="tie" active="false"/></equality>
  <actuator><motor name="winch" tendon="rope"/></actuator>
  <sensor><tendonpos name="length" tendon="rope"/></sensor>
</mujoco>
"""


def system_of(path: Path) -> System:
    """A machine all of whose sensors are measured."""
    model = mujoco.MjModel.from_xml_path(str(path))
    time = np.array([0.0, 1.0])
    channels = tuple(
        Channel(f"{model.sensor(s).name}_{i}", model.sensor(s).name, i)
        for s in range(model.nsensor)
        for i in range(int(model.sensor(s).dim[0]))
    )
    readings = tuple(Reading(time, np.zeros(2)) for _ in channels)
    episode = Episode("still", time, np.zeros((2, model.nu)), readings)
    return look_at(Study("test", path, channels, (episode,)))


@pytest.fixture(scope="module")
def crane(tmp_path_factory: pytest.TempPathFactory) -> System:
    path = tmp_path_factory.mktemp("crane") / "crane.xml"
    path.write_text(CRANE)
    return system_of(path)


def robot(folder: Path, name: str) -> System:
    """A drawing of the arm with a length servo on every wire."""
    spec = mujoco.MjSpec.from_file(str(ASSETS / f"{name}.xml"))
    spec.compiler.texturedir = str(ASSETS / "textures")
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


@pytest.fixture(scope="module")
def elbow(tmp_path_factory: pytest.TempPathFactory) -> System:
    return robot(tmp_path_factory.mktemp("elbow"), "elbow")


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> System:
    return robot(tmp_path_factory.mktemp("arm"), "arm")


def plant_with(system: System, id: str, location: Location, **values: float) -> Plant:
    """The machine with one cause, its other parameters null."""
    candidate = Candidate(cause(id), location, cause(id).parameters(system, location))
    unknown = set(values) - set(candidate.nulls())
    assert not unknown, unknown
    return build(system, [(candidate, candidate.nulls() | values)])


def at(model: mujoco.MjModel, **joints: float) -> mujoco.MjData:
    """Everything computed at a posture."""
    data = mujoco.MjData(model)
    for name, position in joints.items():
        data.joint(name).qpos = position
    mujoco.mj_forward(model, data)
    return data


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_a_wrap_lifts_the_wire_and_never_snaps(elbow: System, share: float) -> None:
    locations = cause("missing_wrapping").locations(elbow)
    assert {location.elements[0] for location in locations} == {"biceps", "brachialis", "triceps"}
    for location, it in zip(locations, obstacles.obstacles(elbow), strict=True):
        radius = it.touching + share * (it.largest - it.touching) + 1e-6
        model = plant_with(elbow, "missing_wrapping", location, radius=radius).spec.compile()
        angles = np.linspace(0.0, np.deg2rad(120), 150)
        straight, laid = (
            np.array([at(m, elbow=q).tendon(location.elements[0]).length[0] for q in angles])
            for m in (elbow.model, model)
        )
        assert np.all(laid > straight - 1e-12)
        assert np.max(laid - straight) > 1e-4 * share
        assert np.max(np.abs(np.diff(laid - straight))) < 5e-4


def test_wraps_of_the_whole_arm_compile_together_and_keep_its_names(arm: System) -> None:
    wrapping = cause("missing_wrapping")
    parts = []
    for location in wrapping.locations(arm):
        candidate = Candidate(wrapping, location, wrapping.parameters(arm, location))
        parts.append((candidate, {p.name: p.null + p.scale for p in candidate.parameters}))
    assert {part[0].location.elements[0] for part in parts} >= {"pec_major", "biceps", "ecr"}
    model = build(arm, parts).spec.compile()
    for i in range(model.nu):
        assert model.tendon(int(model.actuator_trnid[i, 0])).name == model.actuator(i).name
        assert model.tendon(int(model.sensor_objid[i])).name == arm.model.actuator(i).name


def test_a_wire_laid_anew_is_the_same_wire(crane: System) -> None:
    spec = crane.study.spec()
    before = [line for line in spec.to_xml().splitlines() if "geom=" not in line]
    spec.tendon("rope").armature = 0.0
    tendon_paths.go_round(spec, "rope", ("hook_0", "hook_1"), "knuckle", "")
    tendon_paths.go_round(spec, "rope", ("hook_0", "hook_1"), "knuckle", "")  # nothing: it is taken
    spec.compile()
    assert [stop.target.name for stop in spec.tendon("rope").path] == [
        "hook_0",
        "knuckle",
        "hook_1",
    ]
    after = [line for line in spec.to_xml().splitlines() if "geom=" not in line]
    assert sorted(after) == sorted(line.replace(' armature="0.5"', "") for line in before)


def test_bones_count_as_obstacles_where_a_wire_passes_them_often(crane: System) -> None:
    found = {it.over.name: it for it in obstacles.obstacles(crane)}
    assert set(found) == {"luff", "knuckle"}, "the drum is the same as the axis of luff"
    assert found["knuckle"].over.shape == "sphere"
    for it in found.values():
        assert 0.0 < it.touching < it.typical < it.largest


def test_what_a_wire_passes_on_either_side_is_no_obstacle(arm: System) -> None:
    found = {(it.tendon, it.over.name) for it in obstacles.obstacles(arm)}
    assert ("biceps", "elbow") in found
    assert ("rhomb", "sc_roll") not in found


@pytest.mark.parametrize("share", [0.5, 1.0])
def test_a_wrapped_wire_is_two_tangents_and_an_arc(crane: System, share: float) -> None:
    location = Location("tendon", ("rope",), "from hook_0 to hook_1 over joint luff")
    (parameter,) = cause("missing_wrapping").parameters(crane, location)
    radius = parameter.low + share * (parameter.high - parameter.low)
    model = plant_with(crane, "missing_wrapping", location, radius=radius).spec.compile()
    start, end = np.array([-0.1, 0.06]), np.array([0.2, 0.03])
    far = np.linalg.norm([start, end], axis=1)
    opening = np.arctan2(start[1], start[0]) - np.arctan2(end[1], end[0])
    arc = radius * (opening - np.sum(np.arccos(radius / far)))
    flat = arc + np.sum(np.sqrt(far**2 - radius**2))
    assert arc > 0
    found = at(model).tendon("rope").length
    assert found == pytest.approx(np.hypot(flat, 0.01), abs=1e-9)

"""Missing wrapping and its obstacles, on a crane, the elbow and the arm."""

from __future__ import annotations

import numpy as np
import pytest

from reality_gap.causes import find_cause
from reality_gap.causes.base import Location
from reality_gap.causes.support import obstacles, tendon_paths
from reality_gap.simulation.hypothesis import Candidate, build
from reality_gap.study.system import System
from tests.reality_gap.causes.plants import at, plant_with, system_of

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


@pytest.fixture(scope="module")
def crane(tmp_path_factory: pytest.TempPathFactory) -> System:
    path = tmp_path_factory.mktemp("crane") / "crane.xml"
    path.write_text(CRANE)
    return system_of(path)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_a_wrap_lengthens_the_tendon_continuously(elbow: System, share: float) -> None:
    locations = find_cause("missing_wrapping").locations(elbow)
    assert {location.elements[0] for location in locations} == {"biceps", "brachialis", "triceps"}
    for location, it in zip(locations, obstacles.obstacles(elbow), strict=True):
        radius = it.touching + share * (it.largest - it.touching) + 1e-6
        model = plant_with(elbow, "missing_wrapping", location, radius=radius).spec.compile()
        angles = np.linspace(0.0, np.deg2rad(120), 150)
        straight, wrapped = (
            np.array([at(m, elbow=q).tendon(location.elements[0]).length[0] for q in angles])
            for m in (elbow.model, model)
        )
        assert np.all(wrapped > straight - 1e-12)
        assert np.max(wrapped - straight) > 1e-4 * share
        assert np.max(np.abs(np.diff(wrapped - straight))) < 5e-4


def test_all_wraps_of_the_arm_compile_together_and_keep_the_names(arm: System) -> None:
    wrapping = find_cause("missing_wrapping")
    parts = []
    for location in wrapping.locations(arm):
        candidate = Candidate(wrapping, location, wrapping.parameters(arm, location))
        parts.append((candidate, {p.name: p.null + p.scale for p in candidate.parameters}))
    assert {part[0].location.elements[0] for part in parts} >= {"pec_major", "biceps", "ecr"}
    model = build(arm, parts).spec.compile()
    for i in range(model.nu):
        assert model.tendon(int(model.actuator_trnid[i, 0])).name == model.actuator(i).name
        assert model.tendon(int(model.sensor_objid[i])).name == arm.model.actuator(i).name


def test_a_tendon_with_a_new_path_keeps_its_attributes(crane: System) -> None:
    spec = crane.study.spec()
    before = [line for line in spec.to_xml().splitlines() if "geom=" not in line]
    spec.tendon("rope").armature = 0.0
    tendon_paths.wrap_around(spec, "rope", ("hook_0", "hook_1"), "knuckle", "")
    tendon_paths.wrap_around(
        spec, "rope", ("hook_0", "hook_1"), "knuckle", ""
    )  # nothing: it is taken
    spec.compile()
    assert [element.target.name for element in spec.tendon("rope").path] == [
        "hook_0",
        "knuckle",
        "hook_1",
    ]
    after = [line for line in spec.to_xml().splitlines() if "geom=" not in line]
    assert sorted(after) == sorted(line.replace(' armature="0.5"', "") for line in before)


def test_bones_that_a_tendon_often_passes_are_obstacles(crane: System) -> None:
    found = {it.over.name: it for it in obstacles.obstacles(crane)}
    assert set(found) == {"luff", "knuckle"}, "the drum is the same as the axis of luff"
    assert found["knuckle"].over.shape == "sphere"
    for it in found.values():
        assert 0.0 < it.touching < it.typical < it.largest


def test_a_body_that_a_tendon_passes_on_both_sides_is_no_obstacle(arm: System) -> None:
    found = {(it.tendon, it.over.name) for it in obstacles.obstacles(arm)}
    assert ("biceps", "elbow") in found
    assert ("rhomb", "sc_roll") not in found


@pytest.mark.parametrize("share", [0.5, 1.0])
def test_a_wrapped_tendon_is_two_tangents_and_an_arc(crane: System, share: float) -> None:
    location = Location("tendon", ("rope",), "from hook_0 to hook_1 over joint luff")
    (parameter,) = find_cause("missing_wrapping").parameters(crane, location)
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

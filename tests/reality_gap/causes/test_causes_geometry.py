"""Causes that change poses, masses and readings: their effects on a model."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from reality_gap.causes import find_cause
from reality_gap.causes.base import Location, Record
from reality_gap.simulation.hypothesis import Plant, build
from reality_gap.study.system import System
from reality_gap.types import Floats
from tests.reality_gap.causes.candidates import candidate
from tests.reality_gap.causes.plants import at, plant_with, system_of

CRANE = """
<mujoco>
  <default><site size="0.003"/></default>
  <worldbody>
    <frame pos="0 0 1" euler="0 0 90">
      <camera name="eye" pos="0 -1 0" euler="80 0 0"/>
      <site name="hook_0" pos="0 0.1 0.06"/>
    </frame>
    <body name="jib" pos="0 0 1">
      <joint name="luff" axis="0 1 0" range="-20 20" limited="true"/>
      <geom name="knuckle" type="sphere" size="0.015" mass="0.1"/>
      <inertial pos="0.2 0 0" mass="2" fullinertia="0.2 0.2 0.3 0.01 0.02 0"/>
      <site name="hook_1" pos="0.2 0.01 0.03"/>
      <body name="tip" pos="0.4 0 0">
        <geom size="0.03" mass="0.5"/>
        <frame euler="0 30 0"><site name="lamp" pos="0.05 0 0" euler="20 0 0"/></frame>
        <body name="tassel"><joint name="swing" axis="0 1 0"/>
          <geom type="capsule" size="0.01 0.05" mass="0.3"/></body>
      </body>
    </body>
  </worldbody>
  <tendon>
    <spatial name="rope" stiffness="100 20" springlength="0.1 0.2" damping="3" armature="0.5"
             range="0 2" limited="true" frictionloss="0.1" rgba="1 0 0 1" width="0.004">
      <site site="hook_0"/><site site="hook_1"/>
    </spatial>
    <fixed name="tie"><joint joint="luff" coef="2"/><joint joint="swing" coef="-1"/></fixed>
  </tendon>
  <equality><tendon tendon1="rope" tendon2="tie" active="false"/></equality>
  <actuator>
    <general name="winch" tendon="rope" gear="-2" gainprm="500" biastype="affine"
             biasprm="7 -500 -3"/>
  </actuator>
  <sensor>
    <tendonpos name="length" tendon="rope"/>
    <actuatorfrc name="own_force" actuator="winch"/>
    <tendonactuatorfrc name="rope_force" tendon="rope"/>
    <jointpos name="angle" joint="luff"/>
    <framepos name="lamp_seen" objtype="site" objname="lamp" reftype="camera" refname="eye"/>
    <framequat name="lamp_turn" objtype="site" objname="lamp" reftype="camera" refname="eye"/>
    <framepos name="tip_seen" objtype="xbody" objname="tip"/>
  </sensor>
</mujoco>
"""


@pytest.fixture(scope="module")
def crane(tmp_path_factory: pytest.TempPathFactory) -> System:
    path = tmp_path_factory.mktemp("crane") / "crane.xml"
    path.write_text(CRANE)
    return system_of(path)


def only(system: System, id: str, note: str | None = None) -> Location:
    """The only location of a cause, or the only one with this note."""
    (found,) = (p for p in find_cause(id).locations(system) if note is None or p.note == note)
    return found


def read(plant: Plant, sensor: str, **joints: float) -> Floats:
    """Readings of a sensor at a posture, including effects."""
    model = plant.spec.compile()
    data = at(model, **joints)
    record = Record(
        time=np.zeros(1),
        sensors=data.sensordata[None].copy(),
        force=data.actuator_force[None],
        length=data.ten_length[None],
        velocity=data.ten_velocity[None],
        qpos=data.qpos[None],
        qvel=data.qvel[None],
        model=model,
    )
    for effect in plant.effects.readings:
        effect(record)
    start = record.column(sensor)
    return record.sensors[0, start : start + int(model.sensor(sensor).dim[0])]


def test_a_shift_adds_to_the_numbers_of_the_file(crane: System) -> None:
    plant = plant_with(crane, "attachment_shift", Location("site", ("hook_0",)), y=0.02)
    model = plant.spec.compile()
    assert plant.spec.site("hook_0").pos == pytest.approx([0.0, 0.12, 0.06])
    assert model.site("hook_0").pos - crane.model.site("hook_0").pos == pytest.approx([-0.02, 0, 0])
    every = only(crane, "attachment_shift", "every tendon")
    group = plant_with(crane, "attachment_shift", every, **{"hook_0.y": 0.02}).spec.compile()
    assert np.array_equal(group.site_pos, model.site_pos)


@pytest.mark.parametrize("angle", [-0.3, 0.0, 0.5])
def test_a_servo_feeds_back_what_its_encoder_reads(crane: System, angle: float) -> None:
    wrong = [
        ("length_scale", Location("tendon", ("rope",)), {"scale": 0.1}),
        ("joint_offset", Location("joint", ("luff",), "zero of its tendons"), {"offset": 0.1}),
    ]
    for id, location, values in wrong:
        plant = plant_with(crane, id, location, **values)
        excess = float(
            read(plant, "length", luff=angle)[0] - at(crane.model, luff=angle).ten_length[0]
        )
        found = at(plant.spec.compile(), luff=angle).actuator_force[0]
        nominal = at(crane.model, luff=angle).actuator_force[0]
        assert found - nominal == pytest.approx(-500 * -2 * excess, abs=1e-9)
        if id == "length_scale":
            tendon = crane.tendon("rope")
            travel = at(crane.model, luff=angle).ten_length[0] - tendon.length0
            assert excess == pytest.approx(0.1 * travel)


def test_tendons_zeroed_at_a_wrong_angle_read_as_at_another(crane: System) -> None:
    location = Location("joint", ("luff",), "zero of its tendons")
    plant = plant_with(crane, "joint_offset", location, offset=0.1)
    short_of_zero = at(crane.model, luff=-0.1).ten_length[0]
    assert read(plant, "length", luff=-0.1)[0] == pytest.approx(crane.tendon("rope").length0)
    assert read(plant, "length")[0] == pytest.approx(
        2 * crane.tendon("rope").length0 - short_of_zero
    )
    own = plant_with(crane, "joint_offset", Location("joint", ("luff",)), offset=0.1)
    assert read(own, "angle", luff=0.2)[0] == pytest.approx(0.3)


def test_the_group_of_all_joints_offsets_each_joint_alike(arm: System) -> None:
    every = only(arm, "joint_offset", "every joint")
    assert len(every.elements) == 14
    group = plant_with(arm, "joint_offset", every, elbow=0.1).spec.compile()
    location = Location("joint", ("elbow",), "zero of its tendons")
    alone = plant_with(arm, "joint_offset", location, offset=0.1).spec.compile()
    assert np.array_equal(group.actuator_biasprm, alone.actuator_biasprm)


def test_an_offset_of_tension_has_the_sign_of_the_sensor(crane: System) -> None:
    location = only(crane, "tension_offset")
    nominal, offset = build(crane, []), plant_with(crane, "tension_offset", location, offset=5.0)
    assert read(offset, "own_force") - read(nominal, "own_force") == pytest.approx(5.0)
    assert read(offset, "rope_force") - read(nominal, "rope_force") == pytest.approx(-5.0)
    scaled = plant_with(crane, "tension_scale", location, scale=0.5)
    assert read(scaled, "rope_force") == pytest.approx(1.5 * read(nominal, "rope_force"))


@pytest.mark.parametrize("compiler", ["", '<compiler inertiafromgeom="true"/>'])
def test_a_heavier_link_keeps_its_centre_of_mass(tmp_path: Path, compiler: str) -> None:
    path = tmp_path / "crane.xml"
    path.write_text(CRANE.replace("<mujoco>", f"<mujoco>{compiler}"))
    system = system_of(path)
    nominal = at(system.model)
    rigid = float(system.model.body("jib").mass[0] + system.model.body("tip").mass[0])
    link = Location("body", ("jib",))
    model = plant_with(system, "link_mass", link, mass=0.3 * rigid).spec.compile()
    found = at(model)
    assert model.body("tassel").mass == pytest.approx(system.model.body("tassel").mass)
    for name in ("jib", "tip"):
        assert model.body(name).mass == pytest.approx(1.3 * system.model.body(name).mass)
        assert model.body(name).inertia == pytest.approx(1.3 * system.model.body(name).inertia)
        assert found.body(name).xipos == pytest.approx(nominal.body(name).xipos)
    moved = plant_with(system, "centre_of_mass", Location("body", ("jib",)), x=0.01).spec.compile()
    assert centre(at(moved), moved) - centre(nominal, system.model) == pytest.approx([0.01, 0, 0])
    assert moved.body_mass == pytest.approx(system.model.body_mass)


def test_a_part_of_a_link_is_heavier_alone(elbow: System) -> None:
    model = plant_with(
        elbow, "link_mass", Location("body", ("hand",), "alone"), mass=0.2
    ).spec.compile()
    change = model.body_mass - elbow.model.body_mass
    assert change[model.body("hand").id] == pytest.approx(0.2)
    assert np.count_nonzero(change) == 1
    assert at(model).body("hand").xipos == pytest.approx(at(elbow.model).body("hand").xipos)


def centre(data: mujoco.MjData, model: mujoco.MjModel) -> Floats:
    """Centre of mass of the crane's jib with its tip (3,) [m]."""
    bodies = [model.body(name).id for name in ("jib", "tip")]
    return np.average(data.xipos[bodies], axis=0, weights=model.body_mass[bodies])


def test_links_consist_of_bodies_that_move_as_one(
    crane: System, elbow: System, arm: System
) -> None:
    def locations(id: str, system: System) -> list[str]:
        return [str(p) for p in find_cause(id).locations(system)]

    each = ["jib, tassel (each its own)"]
    assert locations("link_mass", crane) == ["jib", "jib (alone)", "tip (alone)", "tassel", *each]
    assert locations("link_mass", elbow) == [
        "ulna",
        "ulna (alone)",
        "radius (alone)",
        "hand (alone)",
    ]
    whole = ["head", "clavicle", "scapula", "humerus", "ulna", "radius", "hand"]
    assert locations("centre_of_mass", arm) == whole


def test_a_payload_hangs_in_the_hand(tmp_path: Path, crane: System, arm: System) -> None:
    assert [str(p) for p in find_cause("payload").locations(arm)] == [
        "head (at eye_site)",
        "head",
        "hand (at grip)",
        "hand",
    ]
    assert str(find_cause("payload").locations(crane)[0]) == "tip (at lamp)"
    spec = plant_with(arm, "payload", Location("body", ("hand",), "at grip"), mass=0.5).spec
    spec.compile()
    again = mujoco.MjModel.from_xml_string(spec.to_xml())
    data = at(again, elbow=0.5)
    assert again.body_mass.sum() == pytest.approx(arm.model.body_mass.sum() + 0.5)
    assert data.body("payload_at_grip").xipos == pytest.approx(data.site("grip").xpos)


def test_payloads_in_the_hand_and_elsewhere_are_two_balls_of_steel(arm: System) -> None:
    at_grip, elsewhere = find_cause("payload").locations(arm)[2:]
    plain = build(arm, []).spec.compile()
    spec = build(
        arm,
        [
            (candidate(arm, "payload", at_grip), {"mass": 7800.0e-6, "gyration": 0.0}),
            (
                candidate(arm, "payload", elsewhere),
                {"mass": 0.3, "along": 0.5, "gyration": 1e-4},
            ),
        ],
    ).spec
    model = spec.compile()
    assert model.body_mass.sum() - plain.body_mass.sum() == pytest.approx(0.3078)
    radius = (3e-6 / (4.0 * np.pi)) ** (1.0 / 3.0)  # of a cubic centimetre
    own = model.body("payload_at_grip").inertia
    assert own == pytest.approx(np.full(3, 0.4 * 7800e-6 * radius**2))
    radius = (0.3 / 7800.0 * 3.0 / (4.0 * np.pi)) ** (1.0 / 3.0)
    own = model.body(f"payload_of_{elsewhere.elements[0]}").inertia
    assert own == pytest.approx(np.full(3, 0.3 * (0.4 * radius**2 + 1e-4)))


END = """<mujoco><worldbody><body name="arm" pos="0 0 1">
<joint name="swing" axis="0 1 0"/>{geom}</body></worldbody>
<sensor><jointpos name="angle" joint="swing"/></sensor></mujoco>"""


@pytest.mark.parametrize(
    ("geom", "centre", "end"),
    [
        ('<geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.01"/>', 0.2, 0.41),
        ('<geom type="cylinder" fromto="0 0 0 0.4 0 0" size="0.01"/>', 0.2, 0.4),
        ('<geom type="box" pos="0.2 0 0" size="0.2 0.02 0.03"/>', 0.2, 0.4),
        ('<geom type="ellipsoid" pos="0.1 0 0" size="0.3 0.01 0.01"/>', 0.1, 0.4),
        (
            '<geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.01" mass="1"/>'
            '<geom type="sphere" pos="0.3 0 0" size="0.05" mass="0"/>',
            0.15,
            0.35,
        ),
    ],
)
def test_without_a_site_a_payload_is_on_the_line_to_the_far_end(
    tmp_path: Path, geom: str, centre: float, end: float
) -> None:
    (tmp_path / "arm.xml").write_text(END.format(geom=geom))
    system = system_of(tmp_path / "arm.xml")
    [location] = find_cause("payload").locations(system)
    for along in (-0.5, 0.0, 0.5, 1.0, 1.2):
        model = plant_with(system, "payload", location, mass=0.1, along=along).spec.compile()
        ball = model.body("payload_of_arm").pos
        assert ball == pytest.approx([centre + along * (end - centre), 0, 0], abs=1e-6)


def test_a_payload_of_a_ball_is_at_its_centre(tmp_path: Path) -> None:
    ball = '<geom type="sphere" pos="0.3 0 0" size="0.02"/>'
    (tmp_path / "arm.xml").write_text(END.format(geom=ball))
    system = system_of(tmp_path / "arm.xml")
    [location] = find_cause("payload").locations(system)
    names = [p.name for p in find_cause("payload").parameters(system, location)]
    assert names == ["mass", "gyration"]


BARE = """<mujoco><worldbody><body name="arm" pos="0 0 1"><joint name="swing" axis="0 1 0"/>
<inertial pos="0.1 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>
<body name="tool" pos="0.3 0 0">{inside}</body></body></worldbody>
<sensor><jointpos name="angle" joint="swing"/></sensor></mujoco>"""


def test_a_payload_may_be_at_a_body_without_mass(tmp_path: Path) -> None:
    """As at a flange, or at the frame of a tool. Where nothing has a shape there is a line, too."""
    (tmp_path / "arm.xml").write_text(BARE.format(inside=""))
    system = system_of(tmp_path / "arm.xml")
    flange, line = find_cause("payload").locations(system)

    assert (str(flange), str(line)) == ("tool (at its origin)", "arm")
    model = plant_with(system, "payload", flange, mass=0.1).spec.compile()
    assert model.body("payload_at_its_origin").parentid == model.body("tool").id
    assert model.body_subtreemass[1] == pytest.approx(1.1)
    model = plant_with(system, "payload", line, mass=0.1, along=1.0).spec.compile()
    assert model.body("payload_of_arm").pos == pytest.approx([0.1 + 0.3 / 2, 0, 0])


def test_a_site_is_preferred_to_a_body_without_mass(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(BARE.format(inside='<site name="grip"/>'))
    found = find_cause("payload").locations(system_of(tmp_path / "arm.xml"))

    assert [str(one) for one in found] == ["tool (at grip)", "arm"]


@pytest.mark.parametrize("sites", [False, True])
def test_the_ends_of_a_closed_loop_carry_a_payload(tmp_path: Path, sites: bool) -> None:
    """No reading shows their joints."""
    lower = (
        '<body name="{}" pos="0 0 -1"><joint/>'
        '<geom type="capsule" fromto="0 0 0 {} 0 -1" size=".1"/>'
    )
    arms = "".join(
        f'<body pos="{x} 0 0"><joint name="motor_{name}" axis="0 1 0"/>'
        '<geom type="capsule" fromto="0 0 0 0 0 -1" size=".1"/>'
        + lower.format(name, -x)
        + f'<site name="tip_{name}" pos="{-x} 0 -1"/></body></body>'
        for name, x in (("left", -0.5), ("right", 0.5))
    )
    held = 'site1="tip_left" site2="tip_right"'
    if not sites:
        held = 'body1="left" body2="right" anchor="0.5 0 -1"'
    (tmp_path / "loop.xml").write_text(
        f"<mujoco><worldbody>{arms}</worldbody><equality><connect {held}/></equality><actuator>"
        '<position name="l" joint="motor_left" kp="9"/>'
        '<position name="r" joint="motor_right" kp="9"/>'
        "</actuator></mujoco>"
    )
    found = find_cause("payload").locations(system_of(tmp_path / "loop.xml"))
    assert {one.elements[0] for one in found} == {"left", "right"}


def test_a_tilt_turns_gravity_and_keeps_its_size(crane: System) -> None:
    location = only(crane, "gravity_direction")
    model = plant_with(crane, "gravity_direction", location, about_x=0.1).spec.compile()
    # In the axes of a base that is turned by +0.1 rad about x, down is also towards -y.
    assert model.opt.gravity == pytest.approx(9.81 * np.array([0, -np.sin(0.1), -np.cos(0.1)]))


def test_a_displaced_camera_measures_the_inverse_displacement(crane: System) -> None:
    turn = np.array([0.0, 0.1, 0.05])
    values = dict(zip(("x", "y", "z", "rx", "ry", "rz"), (0.01, 0.02, -0.03, *turn), strict=True))
    plant = plant_with(crane, "camera_mounting", Location("camera", ("eye",)), **values)
    seen = read(build(crane, []), "lamp_seen", luff=0.2)
    expected = Rotation.from_rotvec(turn).inv().apply(seen - [0.01, 0.02, -0.03])
    assert read(plant, "lamp_seen", luff=0.2) == pytest.approx(expected)
    focal = plant_with(crane, "camera_focal", Location("camera", ("eye",)), scale=0.1)
    assert read(focal, "lamp_seen", luff=0.2) == pytest.approx(seen * [1, 1, 1.1])


def test_a_marker_moves_in_its_own_axes(crane: System) -> None:
    nominal = at(crane.model, luff=0.2)
    plant = plant_with(crane, "marker_offset", Location("site", ("lamp",)), z=0.01, rx=0.2)
    moved = at(plant.spec.compile(), luff=0.2).site("lamp")
    axes = nominal.site("lamp").xmat.reshape(3, 3)
    assert moved.xpos == pytest.approx(nominal.site("lamp").xpos + 0.01 * axes[:, 2])
    turned = axes @ Rotation.from_rotvec([0.2, 0, 0]).as_matrix()
    assert moved.xmat.reshape(3, 3) == pytest.approx(turned)
    tip = plant_with(crane, "marker_offset", Location("body", ("tip",)), x=0.01)
    along = nominal.body("tip").xmat.reshape(3, 3)[:, 0]
    assert read(tip, "tip_seen", luff=0.2) == pytest.approx(nominal.body("tip").xpos + 0.01 * along)


def test_a_model_that_was_extended_by_a_payload_may_have_another(tmp_path: Path) -> None:
    geom = '<geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.01"/>'
    (tmp_path / "arm.xml").write_text(END.format(geom=geom))
    system = system_of(tmp_path / "arm.xml")
    [location] = find_cause("payload").locations(system)
    extended = tmp_path / "extended.xml"
    extended.write_text(plant_with(system, "payload", location, mass=0.1, along=1.0).spec.to_xml())
    again = system_of(extended)
    for other in find_cause("payload").locations(again):
        assert plant_with(again, "payload", other, mass=0.2).spec.compile().body_mass.sum() == (
            pytest.approx(again.model.body_mass.sum() + 0.2)
        )

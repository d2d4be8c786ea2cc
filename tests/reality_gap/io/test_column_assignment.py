"""Columns of any layout belong to the elements of their kind, or to none, which is noted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import mujoco
import numpy as np
import pytest

from reality_gap.io.column_assignment import Assignment, assign_columns, note_doubts, undriven
from reality_gap.io.column_names import kind_of
from reality_gap.io.completed_model import complete_model
from tests.reality_gap.arm_logs import ARM

JOINTS = ("shoulder_pan", "elbow_flex")
CABLES = """
<mujoco>
  <worldbody>
    <site name="A" pos="-1 0 1"/><site name="B" pos="1 0 1"/>
    <body>
      <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
      <joint name="tilt" axis="0 1 0"/><geom size="0.1"/><site name="C"/>
    </body>
  </worldbody>
  <tendon>
    <spatial name="c1"><site site="A"/><site site="C"/></spatial>
    <spatial name="c2"><site site="B"/><site site="C"/></spatial>
  </tendon>
  <actuator><position name="w1" tendon="c1"/><position name="w2" tendon="c2"/></actuator>
  {sensors}
</mujoco>
"""
SENSORS = """
<sensor>
  <tendonpos name="cable_a" tendon="c1"/><tendonpos name="cable_b" tendon="c2"/>
  <tendonactuatorfrc name="pull_a" tendon="c1"/><tendonactuatorfrc name="pull_b" tendon="c2"/>
</sensor>
"""


def assigned(xml: str, columns: Sequence[str]) -> Assignment:
    """Assign columns to the completed model."""
    spec, added = complete_model(mujoco.MjSpec.from_string(xml))
    return assign_columns(spec.compile(), columns, added)


def single(assignment: Assignment) -> dict[str, str]:
    """Return the column of each element."""
    return {
        name: column for found in assignment.found.values() for name, (column,) in found.items()
    }


def orders(columns: Sequence[str]) -> Iterator[list[str]]:
    """Yield columns in several orders."""
    yield list(columns)
    yield list(columns)[::-1]
    rng = np.random.default_rng(0)
    for _ in range(5):
        yield [columns[i] for i in rng.permutation(len(columns))]


LAYOUTS = [
    {"": "{}_cmd", "_position": "{}"},
    {"": "target_{}", "_position": "{}"},
    {"": "u_{}", "_position": "{}"},
    {"": "{}_cmd", "_position": "{}", "_velocity": "{}_vel", "_force": "{}_effort"},
    {"": "{}", "_position": "{}_pos"},
    {"": "{}", "_position": "{}_deg", "_force": "torque_{}"},
    {"": "{}", "_position": "{}_rad", "_velocity": "{}_rad/s", "_force": "{} [Nm]"},
    {"": "commanded.{}", "_position": "positions.{}", "_velocity": "velocities.{}"},
    {"": "commanded.{}", "_position": "positions.{}"},
    {"": "{}_targets", "_position": "{}_positions", "_force": "{}_torques"},
    {"": "commands.{}", "_position": "positions.{}", "_force": "efforts.{}"},
    {"": "desired.{}", "_position": "actual.{}"},
    {"": "{}_setpoint", "_position": "{}_measured"},
    {"": "references/{}", "_position": "states/{}"},
    {"": "{}_commanded_position", "_position": "{}_measured_position"},
    {"": "demand_{}", "_position": "feedback_{}", "_velocity": "feedback_speed_{}"},
    {"": "action.{}.pos", "_position": "observation.state.{}.pos"},
    {"": "{}Setpoints", "_position": "{}Encoder", "_velocity": "{}EncoderVelocity"},
    {"": "{}_set_deg", "_position": "{}_act_deg"},
    {"": "{}.SetPos", "_position": "{}.ActPos", "_force": "{}.ActTorque"},
    {"": "{}_SP", "_position": "{}_PV"},
    {"": "{}_cmd", "_position": "{}_fb", "_velocity": "{}_vel_fb"},
    {"": "{}_d", "_position": "{}"},
    {"": "q_d_{}", "_position": "q_{}", "_velocity": "dq_{}"},
]


@pytest.mark.parametrize("layout", LAYOUTS, ids=" ".join)
def test_commands_and_readings_are_not_exchanged(layout: dict[str, str]) -> None:
    expected = {
        joint + ending: name.format(joint) for joint in JOINTS for ending, name in layout.items()
    }
    for columns in orders(["time", *expected.values()]):
        assert single(assigned(ARM, columns)) == expected


NUMBERED = [
    {"": "actions.{}", "_position": "states.{}"},
    {"": "commands.{}", "_position": "positions.{}", "_force": "efforts.{}"},
    {"": "u{}", "_position": "q{}", "_velocity": "dq{}", "_force": "tau{}"},
    {"": "desired.positions.{}", "_position": "actual.positions.{}"},
    {
        "": "desired.positions.{}",
        "_position": "actual.positions.{}",
        "_velocity": "actual.velocities.{}",
        "_force": "actual.effort.{}",
    },
    {"": "reference.positions.{}", "_position": "feedback.positions.{}"},
]


@pytest.mark.parametrize(("command", "position"), [("{}Set", "{}Act"), ("Set{}", "Act{}")])
def test_axes_of_one_letter_in_names_without_separators(command: str, position: str) -> None:
    xml = ARM
    for joint, axis in zip(JOINTS, "XY", strict=True):
        xml = xml.replace(joint, axis)
    expected = {
        axis + end: n.format(axis)
        for axis in "XY"
        for end, n in (("", command), ("_position", position))
    }
    for columns in orders(["t_ms", *expected.values()]):
        assert single(assigned(xml, columns)) == expected


@pytest.mark.parametrize("layout", NUMBERED, ids=" ".join)
def test_numbered_columns_belong_to_the_elements_of_their_kind(layout: dict[str, str]) -> None:
    """What a servo of the position does not take, such as the desired velocity, is not used."""
    expected = {
        joint + ending: name.format(i)
        for i, joint in enumerate(JOINTS)
        for ending, name in layout.items()
    }
    others = [
        f"{name}.{i}"
        for i in range(2)
        for name in (
            "desired.velocities",
            "desired.accelerations",
            "desired.effort",
            "error.pos",
            "cmd.kp",
        )
    ]
    for columns in orders(["time", *expected.values(), *others]):
        found = assigned(ARM, columns)
        assert single(found) == expected
        assert set(found.free) == set(others)


def test_a_measured_list_of_columns_comes_before_others_of_its_kind() -> None:
    columns = [
        f"{word}.positions.{i}" for word in ("reference", "output", "feedback") for i in "01"
    ]
    for some in orders(["time", *columns]):
        found = single(assigned(ARM, some))
        assert found["elbow_flex_position"] == "feedback.positions.1"
        assert "output.positions.1" not in found.values()


@pytest.mark.parametrize("others", [[], ["target_qd", "target_qdd", "target_moment"]])
def test_currents_and_moments_are_no_positions(others: list[str]) -> None:
    """Names of the interface of an arm (RTDE)."""
    expected = {
        joint + ending: f"{name}_{i}"
        for i, joint in enumerate(JOINTS)
        for ending, name in (
            ("", "target_q"),
            ("_position", "actual_q"),
            ("_velocity", "actual_qd"),
        )
    }
    free = [f"{name}_{i}" for name in ("target_current", *others) for i in range(2)]
    for columns in orders(["timestamp", *expected.values(), *free]):
        found = assigned(ARM, columns)
        assert single(found) == expected
        assert set(found.free) == set(free)


@pytest.mark.parametrize("name", ["target_current_{}", "target_moment_{}", "cmd_current_{}"])
def test_a_servo_of_the_position_takes_no_current(name: str) -> None:
    free = [name.format(i) for i in range(2)]
    for columns in orders(["time", *free, "q_0", "q_1"]):
        found = assigned(ARM, columns)
        assert not found.commands or set(found.commands) == {"q_0", "q_1"}
        assert set(found.free) >= set(free)


@pytest.mark.parametrize("position", ["current_state_{}", "current_pos_{}", "pos_current_{}"])
def test_a_present_position_is_no_current(position: str) -> None:
    expected = {
        joint + ending: name.format(i)
        for i, joint in enumerate(JOINTS)
        for ending, name in (("", "u_{}"), ("_position", position))
    }
    for columns in orders(["time", *expected.values()]):
        assert single(assigned(ARM, columns)) == expected


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize(
    "layout",
    [
        {"": "joint_command_{}", "_position": "joint_position_{}", "_force": "joint_torque_{}"},
        {"": "motor_target_{}", "_position": "joint_position_{}", "_force": "motor_torque_{}"},
    ],
    ids=["joint", "motor"],
)
def test_a_common_word_and_a_number_are_no_name(layout: dict[str, str], first: int) -> None:
    """The arm has three wrists, whose numbers are not those of its joints."""
    joints = ["shoulder_pan_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint"]
    bodies = "".join(f'<body><joint name="{j}"/><geom size="0.1"/>' for j in joints)
    xml = f"<mujoco><worldbody>{bodies}{4 * '</body>'}</worldbody><actuator>" + "".join(
        f'<position name="{joint}" joint="{joint}" kp="9"/>' for joint in joints
    )
    xml += "</actuator></mujoco>"
    expected = {
        joint + ending: name.format(i + first)
        for i, joint in enumerate(joints)
        for ending, name in layout.items()
    }
    for columns in orders(["time", *expected.values()]):
        assert single(assigned(xml, columns)) == expected


@pytest.mark.parametrize("names", ["joint{}", "joint_{}", "{}_joint", "q_{}"])
def test_numbers_in_the_names_of_elements_are_those_of_the_columns(names: str) -> None:
    """The model lists its joints in another order than their numbers."""
    xml = ARM
    for joint, number in zip(JOINTS, (2, 1), strict=True):
        xml = xml.replace(joint, names.format(number))
    found = single(assigned(xml, ["time", "u.0", "u.1", "state.0", "state.1"]))
    assert found[names.format(1)] == "u.0"
    assert found[f"{names.format(1)}_position"] == "state.0"
    assert found[f"{names.format(2)}_position"] == "state.1"


@pytest.mark.parametrize("names", ["joint{}", "joint_{}", "q_{}", "q{}"])
@pytest.mark.parametrize("layout", [["cmd_{}", "{}_pos"], ["{}.target", "state.{}"]])
def test_names_with_numbers_are_names(names: str, layout: list[str]) -> None:
    xml = ARM
    for joint, number in zip(JOINTS, (2, 1), strict=True):
        xml = xml.replace(joint, names.format(number))
    joints = [names.format(number) for number in (1, 2)]
    columns = [name.format(joint) for joint in joints for name in layout]
    for some in orders(["time", *columns]):
        found = single(assigned(xml, some))
        for joint in joints:
            assert found[joint] == layout[0].format(joint)
            assert found[f"{joint}_position"] == layout[1].format(joint)


def test_numbered_columns_beside_an_element_without_a_number() -> None:
    """The finger has no number, so that the number of columns is that of the other joints."""
    xml = ARM.replace("shoulder_pan", "joint_1").replace("elbow_flex", "joint_2")
    finger = '<body><joint name="finger"/><geom size="0.01"/></body></worldbody>'
    xml = xml.replace("</worldbody>", finger)
    found = single(assigned(xml, ["time", "u.0", "u.1", "state.0", "state.1", "finger_angle"]))
    assert found["joint_1"] == "u.0"
    assert found["joint_1_position"] == "state.0"
    assert found["finger_position"] == "finger_angle"
    several = single(assigned(xml, ["time", "u.0", "u.1", "state.0", "state.1"]))
    assert several["joint_2_position"] == "state.1"
    assert "finger_position" not in several


def test_a_column_of_another_kind_is_never_assigned() -> None:
    """Each element alone refuses all columns that state another kind, whatever their names."""
    kinds = {"cmd": "command", "positions": "position", "speed": "rate", "torques": "force"}
    kinds |= {"desired_velocity": "command", "actual_velocity": "rate", "error": "other"}
    kinds |= {"measured_torque": "force", "encoder_accelerations": "acceleration"}
    own = {"": "command", "_position": "position", "_velocity": "rate", "_force": "force"}
    for word, kind in kinds.items():
        columns = [f"{joint}_{word}" for joint in JOINTS]
        assert {kind_of(column) for column in columns} == {kind}
        for name in single(assigned(ARM, ["time", *columns])):
            assert own[name.removeprefix("shoulder_pan").removeprefix("elbow_flex")] == kind


def test_the_command_of_an_effort_is_not_the_command_of_a_position() -> None:
    columns = ["time", *(f"{word}_{joint}" for joint in JOINTS for word in ("cmd_effort", "q"))]
    assert assigned(ARM, columns).commands == ()
    motors = ARM.replace("<position", "<motor").replace(' kp="60" kv="2"', "")
    assert assigned(motors.replace(' kp="30" kv="1"', ""), columns).commands


def test_positions_named_like_joints_beside_efforts_are_no_commands() -> None:
    columns = ["time", *JOINTS, *(f"effort_{joint}" for joint in JOINTS)]
    found = assigned(ARM, columns)
    assert found.commands == ()
    assert found.found["sensors"]["elbow_flex_position"] == ("elbow_flex",)


def test_a_command_without_a_word_is_found_beside_one_with_a_word() -> None:
    columns = ["time", "cmd_shoulder_pan", "elbow_flex", *(f"q_{joint}" for joint in JOINTS)]
    found = single(assigned(ARM, columns))
    assert found["elbow_flex"] == "elbow_flex"
    assert found["elbow_flex_position"] == "q_elbow_flex"


@pytest.mark.parametrize("name", ["elbow_torque", "elbow_position"])
def test_an_actuator_with_a_kind_in_its_name(name: str) -> None:
    """Its own name is its command, unless another column is one."""
    xml = (
        '<mujoco><worldbody><body><joint name="elbow"/><geom size=".1"/></body></worldbody>'
        f'<actuator><general name="{name}" joint="elbow" gaintype="affine"/></actuator></mujoco>'
    )
    assert assigned(xml, ["time", name, "q_elbow"]).commands == (name,)
    for columns in orders(["time", name, "elbow_cmd"]):
        assert assigned(xml, columns).commands == ("elbow_cmd",)


@pytest.mark.parametrize("sensors", [SENSORS, ""])
@pytest.mark.parametrize("joints", [False, True])
def test_numbered_columns_of_tendons(sensors: str, joints: bool) -> None:
    """Sensors of the user's model come first; those that were added share nothing with them."""
    elements = {"length.{}": ["cable_a", "cable_b"], "tension.{}": ["pull_a", "pull_b"]}
    if not sensors:
        elements = {"length.{}": ["c1_length", "c2_length"], "tension.{}": ["w1_force", "w2_force"]}
    elements["action.{}"] = ["w1", "w2"]
    if joints:
        elements["q.{}"] = ["x_position", "z_position", "tilt_position"]
    expected = {
        element: name.format(i) for name, some in elements.items() for i, element in enumerate(some)
    }
    for columns in orders(["time", *expected.values()]):
        assert single(assigned(CABLES.format(sensors=sensors), columns)) == expected


def test_a_completed_model_has_the_columns_of_the_model_itself() -> None:
    xml = CABLES.format(sensors=SENSORS)
    columns = ["time", *(f"{name}.{i}" for name in ("action", "len", "force") for i in range(2))]
    plain = assign_columns(mujoco.MjModel.from_xml_string(xml), columns)
    assert single(plain) == single(assigned(xml, columns))
    assert not plain.free


def test_numbers_that_fit_two_types_of_elements_are_not_assigned() -> None:
    """Two joints and two tendons have positions; the columns may be those of either."""
    xml = CABLES.format(sensors="").replace('<joint name="tilt" axis="0 1 0"/>', "")
    found = assigned(xml, ["time", "action.0", "action.1", "state.0", "state.1"])
    assert found.free == ("state.0", "state.1")


def noted(xml: str, columns: Sequence[str]) -> list[str]:
    """Return the notes on an assignment."""
    notes: list[str] = []
    note_doubts(assigned(xml, columns), notes.append)
    return notes


def test_unused_columns_and_doubtful_assignments_are_noted() -> None:
    columns = ["time", *(f"cmd_{joint}" for joint in JOINTS), *(f"q_{joint}" for joint in JOINTS)]
    assert noted(ARM, columns) == []
    [unused] = noted(ARM, [*columns, "torque_wrist", "temperature_1", "battery"])
    assert unused.endswith("no element of the model fits: torque_wrist, and 2 more")
    [part] = noted(ARM, ["time", "cmd_pan", *columns[2:]])
    assert part.endswith("cmd_pan to shoulder_pan")
    [order] = noted(ARM, [*columns[:3], "state.0", "state.1"])
    assert "state.0 to shoulder_pan_position; state.1 to elbow_flex_position" in order


def test_commands_of_a_model_without_actuators() -> None:
    positions = [f"position.{joint}" for joint in JOINTS]
    for names in ("{}.cmd", "desired_velocity_{}", "u_{}"):
        commands = [names.format(joint) for joint in JOINTS]
        sentence = undriven(JOINTS, ["time", *positions, *commands])
        assert "the model has no actuators" in sentence
        assert ", ".join(commands) in sentence
        efforts = [f"effort.{joint}" for joint in JOINTS]
        assert undriven(JOINTS, ["time", *positions, *commands, *efforts]) == ""
    assert "action.0, action.1" in undriven(JOINTS, ["time", *positions, "action.0", "action.1"])
    assert undriven(JOINTS, ["time", *positions, "control_mode"]) == ""
    assert undriven(JOINTS, ["time", *positions, *JOINTS]) == ""


def joints_with(actuators: dict[str, str]) -> str:
    """Return a model with servos of the position of some joints, by the names of the servos."""
    bodies = "".join(
        f'<body><joint name="{joint}" axis="0 1 0"/><geom size=".1"/></body>'
        for joint in actuators.values()
    )
    drives = "".join(
        f'<position name="{name}" joint="{joint}"/>' for name, joint in actuators.items()
    )
    return f"<mujoco><worldbody>{bodies}</worldbody><actuator>{drives}</actuator></mujoco>"


LETTERS = [("l_hip", "r_hip"), ("f_l", "f_r", "h_l", "h_r"), ("u_arm", "l_arm"), ("hip_q", "hip_p")]


@pytest.mark.parametrize("joints", LETTERS, ids=" ".join)
def test_letters_in_the_names_of_joints_state_nothing(joints: Sequence[str]) -> None:
    """The "l" of "l_hip" is no length, and the "f" of "f_r" no force."""
    xml = joints_with({joint: joint for joint in joints})
    for columns in orders(["time", *joints]):
        assert single(assigned(xml, columns)) == {joint: joint for joint in joints}
    for command, position in (("{}_cmd", "{}"), ("{}", "{}_pos"), ("cmd_{}", "{}_deg")):
        expected = {joint: command.format(joint) for joint in joints}
        expected |= {f"{joint}_position": position.format(joint) for joint in joints}
        for columns in orders(["time", *expected.values()]):
            found = assigned(xml, columns)
            assert single(found) == expected
            assert not found.free
    for columns in orders([f"{joint}_pos" for joint in joints]):
        assert assigned(xml, ["time", *columns]).commands == ()


def test_a_letter_that_the_joint_lacks_states_the_kind() -> None:
    xml = joints_with({"u_hip": "hip", "u_knee": "knee"})
    expected = {"u_hip": "u_hip", "u_knee": "u_knee"}
    forces = {f"{name}_force": name.replace("u_", "f_") for name in expected}
    for columns in orders(["time", *expected.values(), *forces.values()]):
        assert single(assigned(xml, columns)) == expected | forces


def test_the_last_command_is_the_one_that_the_actuator_takes() -> None:
    xml = joints_with({"drive": "hinge"})
    for columns in orders(["time", "desired_velocity", "desired_position"]):
        found = assigned(xml, columns)
        assert found.commands == ("desired_position",)
        assert found.free == ("desired_velocity",)


def test_columns_are_named_like_the_joints_that_actuators_move() -> None:
    joints = ("hip", "knee")
    expected = {"m2": "hip_cmd", "m1": "knee_cmd"}
    expected |= {f"{joint}_position": f"{joint}_pos" for joint in joints}
    expected |= {"m2_force": "hip_torque", "m1_force": "knee_torque"}
    xml = joints_with({"m2": "hip", "m1": "knee"})
    for columns in orders(["time", *expected.values()]):
        assert single(assigned(xml, columns)) == expected
    assert noted(xml, ["time", *expected.values()]) == []


@pytest.mark.parametrize("names", ["{}_motor", "a_{}", "act_{}"])
def test_actuators_named_after_their_joints_are_no_doubt(names: str) -> None:
    xml = joints_with({names.format(joint): joint for joint in ("hip", "knee")})
    columns = ["time", *(f"{joint}_{word}" for joint in ("hip", "knee") for word in ("cmd", "pos"))]
    found = single(assigned(xml, columns))
    assert found[names.format("knee")] == "knee_cmd"
    assert noted(xml, columns) == []


def test_the_name_of_an_actuator_comes_before_that_of_its_joint() -> None:
    xml = joints_with({"hip_extensor": "hip"}).replace(
        "</actuator>", '<position name="hip_flexor" joint="hip"/></actuator>'
    )
    for columns in orders(["time", "hip_flexor_cmd", "hip_extensor_cmd"]):
        found = single(assigned(xml, columns))
        assert found == {name: f"{name}_cmd" for name in ("hip_flexor", "hip_extensor")}
    xml = xml.replace("hip_", "")
    [doubt] = noted(xml, ["time", "hip_cmd", "flexor_cmd"])
    assert doubt.endswith("only, columns were assigned: hip_cmd to extensor")


def test_a_tension_is_named_like_the_tendon_of_its_actuator() -> None:
    xml = CABLES.format(sensors="").replace('<position name="w2" tendon="c2"/>', "")
    found = single(assigned(xml, ["time", "w1_cmd", "c1_tension"]))
    assert found == {"w1": "w1_cmd", "w1_force": "c1_tension"}
    own = '<sensor><tendonactuatorfrc name="pull_a" tendon="c1"/></sensor>'
    found = single(assigned(xml.replace("</mujoco>", own + "</mujoco>"), ["time", "c1_tension"]))
    assert found == {"pull_a": "c1_tension"}


def test_commands_without_actuators_are_listed_in_their_order() -> None:
    sentence = undriven(["hip", "knee"], ["time", "hip_pos", "hip_cmd", "knee_cmd"])
    assert "but hip_cmd, knee_cmd seem" in sentence
    assert '<position joint="hip"' in sentence
    assert undriven(["u_arm", "l_arm"], ["time", "u_arm", "l_arm", "u_arm_pos"]) == ""

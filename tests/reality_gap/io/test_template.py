"""Template: the draft for a well-named log is complete; other lines are left as comments."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from reality_gap.errors import StudyError
from reality_gap.io.loader import load_study
from reality_gap.io.plausibility import scale_warnings
from reality_gap.io.template import draft_study

LOGS = ("robot_0.csv", "robot_1.csv", "camera_0.csv", "camera_1.csv")


def draft(folder: Any, *logs: str) -> str:
    """Write the study's folder, and draft a study for logs in it."""
    root = folder.write().parent
    return draft_study(root / "lever.xml", [root / log for log in logs or LOGS])


def rename(folder: Any, names: dict[str, str]) -> None:
    """Rename columns of the logs."""
    for log, columns in folder.logs.items():
        folder.logs[log] = {names.get(name, name): cells for name, cells in columns.items()}


def test_a_well_named_log_needs_no_editing(study_folder: Any) -> None:
    text = draft(study_folder)
    plain = load_study(study_folder.path)
    study_folder.path.write_text(text, encoding="utf-8")
    study = load_study(study_folder.path)
    np.testing.assert_array_equal(study.episodes[1].command, plain.episodes[1].command)
    drafted = dict(zip((c.name for c in study.channels), study.episodes[0].readings, strict=True))
    for channel, reading in zip(plain.channels, plain.episodes[0].readings, strict=True):
        np.testing.assert_array_equal(drafted[channel.name].value, reading.value)
        np.testing.assert_array_equal(drafted[channel.name].time, reading.time)
    # The log has no columns for the orientation of the marker.
    assert "  # marker_turn: {columns: [?, ?, ?, ?], unit: 1}" in text


def test_other_words_and_units(study_folder: Any) -> None:
    names = {
        "time": "t_ms",
        "target_flexor": "flexor cmd [mm]",
        "target_extensor": "extensor cmd [mm]",
        "length_flexor": "enc_flexor",
        "length_extensor": "enc_extensor",
        "tension_flexor": "FlexorForce",
        "tension_extensor": "ExtensorForce",
        "angle_elbow": "elbow_deg",
    }
    rename(study_folder, names)
    content = yaml.safe_load(draft(study_folder))
    assert content["time"] == {"column": "t_ms", "unit": "ms"}
    assert content["actuators"]["flexor"] == {"column": "flexor cmd [mm]", "unit": "mm"}
    sensors = content["sensors"]
    assert sensors["length_extensor"]["column"] == "enc_extensor"
    assert sensors["tension_flexor"] == {"column": "FlexorForce", "unit": "N", "scale": -1}
    assert sensors["angle_elbow"] == {"column": "elbow_deg", "unit": "deg"}


def test_units_by_size(study_folder: Any) -> None:
    for columns in study_folder.logs.values():
        for name, factor in (("time", 1e6), ("length_flexor", 1e3)):
            if name in columns:
                columns[name] = [factor * cell for cell in columns[name]]
    content = yaml.safe_load(draft(study_folder))
    assert content["time"]["unit"] == "us"
    assert content["sensors"]["length_flexor"]["unit"] == "mm"
    assert content["sensors"]["length_extensor"]["unit"] == "m"


@pytest.mark.parametrize(("factor", "unit"), [(1.0, ""), (-1.0, ""), (1000.0, " [mm]")])
def test_lengths_that_are_zero_where_the_model_is_assembled_get_an_offset(
    study_folder: Any, factor: float, unit: str
) -> None:
    """Relative encoders, and commands that count from the same zero, whatever their sign."""
    model = load_study(study_folder.write()).spec().compile()
    length = float(model.tendon_length0[model.tendon("flexor").id])
    for columns in study_folder.logs.values():
        for name in {"target_flexor", "length_flexor"} & set(columns):
            columns[name + unit] = [factor * (cell - length) for cell in columns.pop(name)]
    notes: list[str] = []
    root = study_folder.write().parent
    text = draft_study(root / "lever.xml", [root / log for log in LOGS], note=notes.append)
    content = yaml.safe_load(text)

    whole = abs(factor) * length
    assert content["sensors"]["length_flexor"]["offset"] == pytest.approx(whole)
    assert content["actuators"]["flexor"]["offset"] == pytest.approx(whole)
    assert "offset" not in content["sensors"]["length_extensor"]
    assert "offset" not in content["actuators"]["extensor"]
    assert sum("0 at qpos0" in one and "length_flexor" in one for one in notes) == 1


def test_whole_lengths_of_a_tendon_that_gets_short_have_no_offset(tmp_path: Path) -> None:
    """With the other sign, they would also fit as lengths that are 0 at qpos0."""
    model = tmp_path / "finger.xml"
    model.write_text(
        '<mujoco><worldbody><site name="eye" pos="-0.04 0 0"/><body><joint name="slide"'
        ' type="slide" axis="1 0 0" range="-0.038 0.002" limited="true"/><geom size="0.1"/>'
        '<site name="hook"/></body></worldbody><tendon><spatial name="cable">'
        '<site site="eye"/><site site="hook"/></spatial></tendon><actuator>'
        '<position name="cable" tendon="cable" kp="100"/></actuator>'
        '<sensor><tendonpos name="length" tendon="cable"/></sensor></mujoco>'
    )
    rows = [f"{0.1 * k},{20 + 2 * k},{20 + 2 * k}" for k in range(9)]
    (tmp_path / "log.csv").write_text("\n".join(["t_s,cable_target_mm,length_mm", *rows]))
    content = yaml.safe_load(draft_study(model, [tmp_path / "log.csv"]))
    assert "offset" not in content["sensors"]["length"]
    assert "offset" not in content["actuators"]["cable"]


def test_lengths_of_actuators_that_are_zero_there_get_an_offset(tmp_path: Path) -> None:
    model = tmp_path / "winch.xml"
    model.write_text(
        '<mujoco><worldbody><site name="eye" pos="-1 0 0"/><body><joint name="slide" type="slide"'
        ' axis="1 0 0" range="-0.1 0.1" limited="true"/><geom size="0.1" mass="9"/>'
        '<site name="hook"/></body></worldbody><tendon><spatial name="rope">'
        '<site site="eye"/><site site="hook"/></spatial></tendon><actuator>'
        '<motor name="winch" tendon="rope"/></actuator>'
        '<sensor><actuatorpos name="wound" actuator="winch"/></sensor></mujoco>'
    )
    rows = [f"{0.1 * k},{k},{0.01 * (k - 5)}" for k in range(11)]
    (tmp_path / "log.csv").write_text("\n".join(["t_s,winch_cmd_N,wound_m", *rows]))
    content = yaml.safe_load(draft_study(model, [tmp_path / "log.csv"]))
    assert content["sensors"]["wound"]["offset"] == pytest.approx(1.0)
    assert "offset" not in content["actuators"]["winch"]


TURNS = 2.0 * np.pi / 0.02
"""Of a ball screw of 20 mm a turn [rad/m]."""


def screw(folder: Path, limited: bool) -> str:
    """Draft of a servo before a ball screw, whose motor and slide are logged."""
    model = folder / "screw.xml"
    model.write_text(
        '<mujoco><worldbody><body><joint name="z" type="slide" range="-0.2 0.02"'
        f' limited="{str(limited).lower()}"/><geom size="0.1"/></body></worldbody><actuator>'
        f'<position name="z" joint="z" gear="{TURNS}" kp="0.25"/></actuator>'
        '<sensor><jointpos name="z_read" joint="z"/></sensor></mujoco>'
    )
    rows = [f"{0.1 * k},{-0.008 * k * TURNS:.9g},{-8 * k}" for k in range(25)]
    (folder / "log.csv").write_text("\n".join(["t_s,z_cmd,z_read", *rows]))
    return draft_study(model, [folder / "log.csv"])


@pytest.mark.parametrize(("limited", "command"), [(True, "m"), (False, "mm")])
def test_a_servo_before_a_gear_is_commanded_in_its_own_angle(
    tmp_path: Path, limited: bool, command: str
) -> None:
    """Without limits of its joint, sizes alone decide."""
    content = yaml.safe_load(screw(tmp_path, limited))
    assert content["actuators"]["z"]["unit"] == command
    assert content["sensors"]["z_read"]["unit"] == "mm"


@pytest.mark.parametrize(
    ("limits", "size", "unit"),
    [
        ("-2 2", 5.0, "rad"),
        ("-1 1", 5.0, "deg"),
        ("-0.05 0.05", 2.0, "rad"),
        ("-170 170", 90, "deg"),
    ],
)
def test_limits_in_another_unit_do_not_decide(
    tmp_path: Path, limits: str, size: float, unit: str
) -> None:
    """The last two may be radians that were read as degrees, and degrees as radians."""
    model = tmp_path / "hinge.xml"
    model.write_text(
        '<mujoco><compiler angle="radian"/><worldbody><body><joint name="j" limited="true"'
        f' range="{limits}"/><geom size="0.1"/></body></worldbody><actuator>'
        '<position name="j" joint="j" kp="1"/></actuator></mujoco>'
    )
    rows = [f"{0.1 * k},{size * np.sin(k):.6g}" for k in range(30)]
    (tmp_path / "log.csv").write_text("\n".join(["t_s,j_cmd", *rows]))
    content = yaml.safe_load(draft_study(model, [tmp_path / "log.csv"]))
    assert content["actuators"]["j"]["unit"] == unit


@pytest.mark.parametrize("unit", ["rad", "m"])
def test_a_command_before_a_gear_may_be_an_angle(tmp_path: Path, unit: str) -> None:
    draft, path = screw(tmp_path, limited=True), tmp_path / "STUDY.yaml"
    path.write_text(draft.replace("column: z_cmd, unit: m", f"column: z_cmd, unit: {unit}"))
    study = load_study(path)
    assert not scale_warnings(study)
    assert study.episodes[0].command[1, 0] == pytest.approx(-0.008 * TURNS)


def test_an_element_without_a_guess_is_a_comment(study_folder: Any) -> None:
    rename(study_folder, {"target_flexor": "a17", "target_extensor": "b17", "length_flexor": "c"})
    text = draft(study_folder)
    assert "  # flexor: {column: ?, unit: m}" in text
    assert "  # unused columns: a17, c, b17" in text
    assert not yaml.safe_load(text)["actuators"]
    assert "length_flexor" not in yaml.safe_load(text)["sensors"]


def test_the_time_may_be_unknown(study_folder: Any) -> None:
    rename(study_folder, {"time": "index"})
    assert "# time: {column: ?, unit: s}" in draft(study_folder)


def test_names_that_yaml_would_misread(study_folder: Any) -> None:
    rename(study_folder, {"length_flexor": "length flexor: #1"})
    sensors = yaml.safe_load(draft(study_folder))["sensors"]
    assert sensors["length_flexor"]["column"] == "length flexor: #1"


def test_a_machine_without_actuators_has_efforts(tmp_path: Path) -> None:
    model = tmp_path / "cart.xml"
    model.write_text(
        '<mujoco><worldbody><body><joint name="carriage" type="slide"/><geom size="0.1" mass="9"/>'
        '</body></worldbody><sensor><jointpos name="position" joint="carriage"/></sensor></mujoco>'
    )
    log = tmp_path / "log.csv"
    log.write_text("t_s,carriage_position_m,carriage_force_N\n0,0,1\n0.1,0.1,2\n")
    content = yaml.safe_load(draft_study(model, [log]))
    assert content["episodes"] == [{"commands": "log.csv"}]
    assert content["sensors"] == {"position": {"column": "carriage_position_m", "unit": "m"}}
    assert content["efforts"] == {"carriage": {"column": "carriage_force_N", "unit": "N"}}
    assert content["initial"] == {"joints": "first_reading", "settle": 0}


def test_files_must_lie_in_the_folder_of_the_study(
    study_folder: Any, tmp_path_factory: Any
) -> None:
    root = study_folder.path.parent
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    with pytest.raises(StudyError, match="outside"):
        draft_study(root / "lever.xml", [root / "robot_0.csv"], elsewhere)


def test_a_draft_needs_a_model_and_a_log(study_folder: Any) -> None:
    root = study_folder.path.parent
    with pytest.raises(StudyError, match="no model file"):
        draft_study(root / "arm.xml", [root / "robot_0.csv"])
    with pytest.raises(StudyError, match="no file log"):
        draft_study(root / "lever.xml", [root / "log.csv"])
    with pytest.raises(StudyError, match="at least one log"):
        draft_study(root / "lever.xml", [])


def test_the_last_column_of_a_kind_goes_to_the_last_element_of_that_kind(
    study_folder: Any,
) -> None:
    rename(study_folder, {"target_flexor": "u"})
    actuators = yaml.safe_load(draft(study_folder))["actuators"]
    assert actuators["flexor"]["column"] == "u"
    assert actuators["extensor"]["column"] == "target_extensor"


def test_what_is_not_used_is_noted(study_folder: Any) -> None:
    rename(study_folder, {"length_flexor": "velocity_flexor"})
    root = study_folder.write().parent
    notes: list[str] = []
    text = draft_study(root / "lever.xml", [root / log for log in LOGS], note=notes.append)
    sensors = yaml.safe_load(text)["sensors"]
    assert "velocity_flexor" not in [line.get("column") for line in sensors.values()]
    assert any("no element of the model fits: velocity_flexor" in note for note in notes)

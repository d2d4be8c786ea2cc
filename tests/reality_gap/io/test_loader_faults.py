"""Loader: each fault of a study is refused in one sentence that says where and what is valid."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import pytest

from reality_gap.errors import StudyError
from reality_gap.io.loader import load_study

Spoil = Callable[[Any], None]


def fault_of(folder: Any) -> str:
    """Write the study, load it, and return the message of the error."""
    with pytest.raises(StudyError) as caught:
        load_study(folder.write())
    sentence = str(caught.value)
    assert "\n" not in sentence
    return sentence


def _set(*keys: str, value: object) -> Spoil:
    def spoil(folder: Any) -> None:
        part = folder.content
        for key in keys[:-1]:
            part = part[key]
        part[keys[-1]] = value

    return spoil


def _remove(*keys: str) -> Spoil:
    def spoil(folder: Any) -> None:
        part = folder.content
        for key in keys[:-1]:
            part = part[key]
        del part[keys[-1]]

    return spoil


def _cell(column: str, row: int, value: object, file: str = "robot_0.csv") -> Spoil:
    def spoil(folder: Any) -> None:
        folder.logs[file][column][row] = value

    return spoil


def _restart_of_efforts(folder: Any) -> None:
    folder.content["efforts"] = folder.content.pop("actuators")
    folder.content["initial"] = {"joints": "first_reading", "restart": 1.0}


def _fill(column: str, value: object) -> Spoil:
    def spoil(folder: Any) -> None:
        for columns in folder.logs.values():
            if column in columns:
                columns[column] = [value] * len(columns[column])

    return spoil


def _rescale(column: str, factor: float) -> Spoil:
    def spoil(folder: Any) -> None:
        for columns in folder.logs.values():
            if column in columns:
                columns[column] = [factor * cell for cell in columns[column]]

    return spoil


def _all(*spoils: Spoil) -> Spoil:
    def spoil(folder: Any) -> None:
        for one in spoils:
            one(folder)

    return spoil


def _shorten(rows: int) -> Spoil:
    def spoil(folder: Any) -> None:
        for columns in folder.logs.values():
            for name, cells in columns.items():
                columns[name] = cells[:rows]

    return spoil


LINE = {"column": "length_flexor", "unit": "m"}

FAULTS: dict[str, tuple[Spoil, tuple[str, ...]]] = {
    "repeated time": (
        _cell("time", 9, 0.16),
        ("line 11 of robot_0.csv", "repeats", "must increase"),
    ),
    "falling time": (_cell("time", 9, 0.01), ("line 11 of robot_0.csv", "falls", "must increase")),
    "no time": (_cell("time", 9, ""), ("line 11 of robot_0.csv", "no time")),
    "NaN in a command": (_cell("target_flexor", 4, "nan"), ("line 6", "'nan'", "target_flexor")),
    "empty command": (_cell("target_flexor", 4, ""), ("line 6 of robot_0.csv", "no command")),
    "NaN in a reading": (_cell("length_flexor", 4, "NaN"), ("line 6", "leave the cell empty")),
    "infinity": (_cell("length_flexor", 4, "inf"), ("line 6", "not a number")),
    "text": (_cell("length_flexor", 4, "0.2 m"), ("line 6 of robot_0.csv", "'0.2 m'")),
    "missing column": (
        _set("sensors", "length_flexor", "column", value="lenght_flexor"),
        ("'lenght_flexor'", "the columns are: length_flexor, "),
    ),
    "commands elsewhere": (
        _set("actuators", "flexor", "column", value="marker_x"),
        ("actuator flexor", "in robot_0.csv", "the columns are"),
    ),
    "no time column": (_set("time", "column", value="t"), ("time column 't'", "robot_0.csv")),
    "unknown sensor": (
        _set("sensors", "length_flexr", value=LINE),
        ("no sensor 'length_flexr'", "it has: length_flexor"),
    ),
    "unknown actuator": (_set("actuators", "flex", value=LINE), ("it has: flexor, extensor",)),
    "unknown joint": (_set("initial", "joints", value={"elbo": 0}), ("'elbo'", "elbow")),
    "unknown joint of an episode": (
        _set("episodes", value=[{"commands": "robot_0.csv", "joints": {"elbo": 0}}]),
        ("'elbo'", "elbow"),
    ),
    "unknown key": (_set("actuator", value={}), ("unknown key 'actuator'", "known: actuators")),
    "unknown key below": (_set("time", "units", value="s"), ("time", "unknown key 'units'")),
    "unknown unit": (_set("sensors", "length_flexor", "unit", value="inch"), ("'inch'", "mm")),
    "no unit": (_remove("sensors", "length_flexor", "unit"), ("sensors.length_flexor", "'unit'")),
    "angle in metres": (
        _set("sensors", "angle_elbow", "unit", value="m"),
        ("angle_elbow cannot be in m", "rad, mrad, deg"),
    ),
    "length in newtons": (_set("sensors", "length_flexor", "unit", value="N"), ("cannot be in N",)),
    "tension in metres": (_set("sensors", "tension_flexor", "unit", value="m"), ("kN",)),
    "position in 1": (_set("sensors", "marker_position", "unit", value=1), ("cannot be in 1",)),
    "servo in newtons": (_set("actuators", "flexor", "unit", value="N"), ("actuator flexor", "mm")),
    "time in metres": (_set("time", "unit", value="m"), ("not a unit of time", "ms")),
    "two columns for one": (
        _set("sensors", "marker_position", "columns", value=["marker_x", "marker_y"]),
        ("3 components", "2 columns"),
    ),
    "one column twice": (
        _set("sensors", "marker_position", "columns", value=["marker_x"] * 3),
        ("different",),
    ),
    "no such model": (_set("model", value="arm.xml"), ("arm.xml",)),
    "no such log": (
        _set("episodes", value=[{"commands": "robot_9.csv"}]),
        ("no file robot_9.csv",),
    ),
    "no episodes": (_set("episodes", value=[]), ("'episodes'", "commands: log.csv")),
    "one log twice": (
        _set("episodes", value=[{"commands": "robot_0.csv"}, {"commands": "robot_0.csv"}]),
        ("robot_0.csv is named twice",),
    ),
    "too short": (_rescale("time", 0.1), ("robot_0", "lasts")),
    "too few": (
        _all(_rescale("time", 10.0), _shorten(15)),
        ("15 readings", "20"),
    ),
    "time in ms": (_rescale("time", 1000.0), ("lasts", "is the time in s?")),
    "dead": (_fill("length_flexor", 0.1), ("length_flexor", "same value in every row", "remove")),
    "zero": (_fill("tension_flexor", 0.0), ("tension_flexor", "same value in every row", "remove")),
    "nothing measured": (_set("sensors", value={}), ("has no measurements", "under sensors")),
    "never measured": (_fill("marker_y", ""), ("marker_position.y", "no reading at all")),
    "actuator left out": (_remove("actuators", "flexor"), ("each actuator", "missing: flexor")),
    "absolute path": (_set("model", value="/etc/hostname"), ("outside the study's folder",)),
    "path above": (_set("model", value="../lever.xml"), ("outside the study's folder",)),
    "path of some length": (
        _set("model", value="../../measured/2018-autumn/robot_0/lever.xml"),
        ("'../../measured/2018-autumn/robot_0/lever.xml' lies outside",),
    ),
    "path above, endless": (_set("model", value=999 * "../"), ("...' lies outside",)),
    "name too long": (_set("model", value=3000 * "x"), ("xxx...' is not a path of a file",)),
    "other file": (
        _set("episodes", value=[{"commands": "lever.xml"}]),
        ("neither a .csv nor a .parquet",),
    ),
    "other clock": (
        lambda folder: folder.logs["camera_0.csv"].update(
            time=[1.7e9 + t for t in folder.logs["camera_0.csv"]["time"]]
        ),
        ("camera_0.csv", "one clock"),
    ),
    "column in two files": (
        lambda folder: folder.logs["camera_0.csv"].update(
            length_flexor=folder.logs["camera_0.csv"]["marker_x"]
        ),
        ("robot_0.csv and in camera_0.csv",),
    ),
    "efforts and actuators": (
        _set("efforts", value={"elbow": {"column": "tension_flexor", "unit": "N m"}}),
        ("both actuators and efforts",),
    ),
    "negative noise": (
        _set("sensors", "length_flexor", "noise", value=-1),
        ("must not be negative",),
    ),
    "noise in words": (_set("sensors", "length_flexor", "noise", value="low"), ("a number", "low")),
    "zero scale": (_set("sensors", "length_flexor", "scale", value=0), ("scale must not be 0",)),
    "huge scale": (_set("sensors", "length_flexor", "scale", value=1e31), ("scale", "1e+30")),
    "yes for a column": (_set("time", "column", value=True), ("quotes",)),
    "negative settle": (_set("initial", "settle", value=-1), ("settle", "0 or more")),
    "negative restart": (
        _set("initial", value={"joints": "first_reading", "restart": -1}),
        ("restart", "0.05", "0 for none"),
    ),
    "restart without readings": (_set("initial", "restart", value=1.0), ("first_reading",)),
    "restart of what is not replayed": (_restart_of_efforts, ("initial.restart", "efforts")),
    "settles for ever": (
        _set("initial", "settle", value=1e9),
        ("more than 1e+08 steps of the model's timestep, 0.004 s", "shorten settle"),
    ),
    "list for keys": (_set("sensors", value=["length_flexor"]), ("keys and values",)),
    "millimetres as metres": (
        _rescale("length_flexor", 1000.0),
        ("length_flexor", "seems to be in millimetres, not in metres"),
    ),
    "metres as millimetres": (
        _all(
            _set("sensors", "length_flexor", "unit", value="mm"),
            _set("sensors", "marker_position", "unit", value="mm"),
        ),
        ("length_flexor", "seems to be in metres, not in millimetres"),
    ),
    "position in mm": (
        _all(*(_rescale(f"marker_{axis}", 1000.0) for axis in "xyz")),
        ("marker_position", "seems to be in millimetres, not in metres"),
    ),
    "degrees as radians": (
        _rescale("angle_elbow", 180.0 / math.pi),
        ("angle_elbow", "seems to be in degrees, not in radians"),
    ),
    "commands in mm": (
        _rescale("target_flexor", 1000.0),
        ("the command of flexor", "seems to be in millimetres, not in metres"),
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_one_sentence(study_folder: Any, fault: str) -> None:
    spoil, words = FAULTS[fault]
    spoil(study_folder)
    sentence = fault_of(study_folder)
    assert len(sentence) < 1000
    for word in words:
        assert word in sentence


def test_first_reading_needs_a_measured_joint(study_folder: Any) -> None:
    study_folder.content["initial"] = {"joints": "first_reading"}
    del study_folder.content["sensors"]["angle_elbow"]
    assert "first_reading needs a jointpos sensor" in fault_of(study_folder)


def test_efforts_need_all_joints_measured(study_folder: Any) -> None:
    content = study_folder.content
    del content["actuators"], content["sensors"]["angle_elbow"]
    content["efforts"] = {"elbow": {"column": "tension_flexor", "unit": "N m"}}
    assert "elbow has no jointpos sensor" in fault_of(study_folder)


def test_a_model_without_actuators(study_folder: Any) -> None:
    model = study_folder.path.parent / "lever.xml"
    spec = mujoco.MjSpec.from_file(str(model))
    for element in [s for s in spec.sensors if s.name.startswith("tension")] + list(spec.actuators):
        spec.delete(element)
    model.write_text(spec.to_xml(), encoding="utf-8")
    del study_folder.content["sensors"]["tension_flexor"]
    assert "has no actuators" in fault_of(study_folder)
    # A study without commands is valid: the machine may swing freely.
    del study_folder.content["actuators"]
    assert load_study(study_folder.write()).episodes[0].command.shape == (200, 0)


def test_a_model_that_does_not_compile(study_folder: Any) -> None:
    (study_folder.path.parent / "lever.xml").write_text("<mujoco><bogus/></mujoco>")
    assert "does not compile" in fault_of(study_folder)


def test_a_link_that_leads_outside(study_folder: Any, tmp_path_factory: Any) -> None:
    outside = tmp_path_factory.mktemp("elsewhere") / "robot_0.csv"
    log = study_folder.path.parent / "robot_0.csv"
    log.rename(outside)
    log.symlink_to(outside)
    with pytest.raises(StudyError, match="outside the study's folder"):
        load_study(study_folder.path)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("name: [", "not valid YAML"),
        ("", "keys and values"),
        ("name: a\nname: b\n", "line 2: 'name' is given twice"),
        ("!!python/object/apply:os.system ['true']", "not valid YAML"),
        ("[" * 1000, "not valid YAML"),
        ("name: !!bool maybe", "not valid YAML: a value does not fit its tag"),
        ("name: !!int ''", "not valid YAML: a value does not fit its tag"),
        ("name: !!timestamp yesterday", "not valid YAML: a value does not fit its tag"),
        ("name: !!float two", "not valid YAML: could not convert"),
    ],
)
def test_a_file_that_is_not_valid_yaml(study_folder: Any, text: str, word: str) -> None:
    study_folder.path.write_text(text, encoding="utf-8")
    with pytest.raises(StudyError, match=word) as caught:
        load_study(study_folder.path)
    assert len(str(caught.value)) < 600


def test_a_missing_study_file(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="no study file"):
        load_study(tmp_path / "STUDY.yaml")

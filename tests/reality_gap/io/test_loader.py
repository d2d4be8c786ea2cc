"""Loader: studies on disk are read in SI units."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest

from reality_gap.errors import StudyError
from reality_gap.io.loader import load_study


def scale(folder: Any, column: str, factor: float) -> None:
    """Multiply a column in every log that has it."""
    for columns in folder.logs.values():
        if column in columns:
            columns[column] = [factor * cell for cell in columns[column]]


def test_a_good_study(study_folder: Any) -> None:
    study = load_study(study_folder.path)
    assert study.name == "a lever"
    assert study.model.name == "lever.xml"
    names = [channel.name for channel in study.channels]
    assert names == [
        "length_flexor",
        "length_extensor",
        "tension_flexor",
        "angle_elbow",
        "marker_position.x",
        "marker_position.y",
        "marker_position.z",
    ]
    assert [channel.component for channel in study.channels] == [0, 0, 0, 0, 0, 1, 2]
    assert study.channels[0].noise == 1e-4
    assert study.channels[3].noise is None
    first, second = study.episodes
    assert (first.name, second.name) == ("robot_0", "robot_1")
    assert first.command.shape == (200, 2)
    assert first.time[0] == 0.0
    assert len(first.readings) == len(names)
    assert len(first.readings[0].time) == 200
    assert len(first.readings[4].time) == 40
    assert study.initial.settle == 1.0
    assert not study.inverse


@pytest.mark.parametrize("included", [False, True])
def test_a_model_that_was_edited_is_read_again(study_folder: Any, included: bool) -> None:
    model = study_folder.path.with_name("lever.xml")
    if included:
        model = model.rename(model.with_name("machine.xml"))
        text = '<mujoco><include file="machine.xml"/></mujoco>'
        study_folder.path.with_name("lever.xml").write_text(text)
    before = load_study(study_folder.path).spec().compile()
    text = model.read_text()
    model.write_text(text.replace('mass="1"', 'mass="2"'))
    after = load_study(study_folder.path).spec().compile()
    assert after.body("lever").mass == pytest.approx(2.0 * before.body("lever").mass)


def test_a_file_may_be_in_one_of_two_folders(study_folder: Any) -> None:
    """Of two folders of meshes, the one of the included file has the mesh."""
    model = study_folder.path.with_name("lever.xml")
    folder = model.parent / "meshes"
    folder.mkdir()
    (folder / "a.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    asset = '<mujoco><compiler meshdir="meshes"/><asset><mesh file="a.obj"/></asset></mujoco>'
    model.with_name("asset.xml").write_text(asset)
    begin = '<mujoco model="lever"><compiler meshdir="."/><include file="asset.xml"/>'
    model.write_text(model.read_text().replace('<mujoco model="lever">', begin))
    assert len(load_study(study_folder.write()).spec().meshes) == 1


def test_commands_are_in_the_order_of_the_model(study_folder: Any) -> None:
    actuators = study_folder.content["actuators"]
    study_folder.content["actuators"] = dict(reversed(actuators.items()))
    study = load_study(study_folder.write())
    flexor = study_folder.logs["robot_0.csv"]["target_flexor"]
    np.testing.assert_allclose(study.episodes[0].command[:, 0], flexor)


def test_units_scale_and_offset(study_folder: Any) -> None:
    plain = load_study(study_folder.path)
    scale(study_folder, "length_flexor", 1000.0)
    scale(study_folder, "angle_elbow", 180.0 / math.pi)
    scale(study_folder, "time", 1e6)
    study_folder.content["time"]["unit"] = "us"
    sensors = study_folder.content["sensors"]
    sensors["length_flexor"] |= {"unit": "mm", "noise": "1e-1"}
    sensors["angle_elbow"]["unit"] = "deg"
    sensors["length_extensor"] |= {"scale": 2, "offset": 0.05}
    study = load_study(study_folder.write())
    np.testing.assert_allclose(study.episodes[0].time, plain.episodes[0].time, atol=1e-12)
    for i in (0, 3):
        np.testing.assert_allclose(
            study.episodes[0].readings[i].value, plain.episodes[0].readings[i].value
        )
    assert study.channels[0].unit == "m"
    assert study.channels[0].noise == pytest.approx(1e-4)
    np.testing.assert_allclose(
        study.episodes[0].readings[1].value, 2 * plain.episodes[0].readings[1].value + 0.05
    )


def test_offset_and_noise_are_in_the_unit_of_their_line(study_folder: Any) -> None:
    plain = load_study(study_folder.path)
    scale(study_folder, "length_flexor", 1000.0)
    study_folder.content["sensors"]["length_flexor"] |= {"unit": "mm", "offset": 5, "noise": 0.2}
    study = load_study(study_folder.write())
    assert study.channels[0].noise == pytest.approx(2e-4)
    np.testing.assert_allclose(
        study.episodes[0].readings[0].value, plain.episodes[0].readings[0].value + 0.005
    )


def test_an_empty_cell_was_not_measured(study_folder: Any) -> None:
    study_folder.logs["robot_0.csv"]["length_flexor"][3:7] = [""] * 4
    reading = load_study(study_folder.write()).episodes[0].readings[0]
    assert len(reading.time) == len(reading.value) == 196
    assert reading.time[3] == pytest.approx(0.14)
    assert np.isfinite(reading.value).all()


def test_all_times_count_from_the_first_command(study_folder: Any) -> None:
    for name in ("robot_0.csv", "camera_0.csv"):
        columns = study_folder.logs[name]
        columns["time"] = [1.7e9 + t for t in columns["time"]]
    camera = study_folder.logs["camera_0.csv"]
    camera["time"] = [t - 0.15 for t in camera["time"]]
    episode = load_study(study_folder.write()).episodes[0]
    assert episode.time[0] == 0.0
    # The two frames before the first command are left out.
    assert len(episode.readings[4].time) == 38
    assert episode.readings[4].time[0] == pytest.approx(0.05, abs=1e-6)


def test_parquet(study_folder: Any) -> None:
    plain = load_study(study_folder.path)
    columns = study_folder.logs.pop("robot_0.csv")
    columns["length_flexor"][5] = None
    pyarrow.parquet.write_table(pa.table(columns), study_folder.path.parent / "robot_0.parquet")
    study_folder.content["episodes"][0]["commands"] = "robot_0.parquet"
    study = load_study(study_folder.write())
    np.testing.assert_array_equal(study.episodes[0].command, plain.episodes[0].command)
    assert len(study.episodes[0].readings[0].time) == 199


def test_initial_joints(study_folder: Any) -> None:
    study_folder.content["initial"] = {"joints": {"elbow": 0.25}, "settle": 0}
    study = load_study(study_folder.write())
    assert study.initial.joints == {"elbow": 0.25}
    assert study.initial.settle == 0.0


def test_initial_joints_from_the_first_reading_of_each_episode(study_folder: Any) -> None:
    study_folder.content["initial"] = {"joints": "first_reading"}
    study = load_study(study_folder.write())
    for i, episode in enumerate(study.episodes):
        first = study_folder.logs[f"robot_{i}.csv"]["angle_elbow"][0]
        assert list(episode.joints) == list(episode.states) == ["elbow"]
        error = episode.states["elbow"].position_error
        assert episode.joints["elbow"] == pytest.approx(first, abs=4 * error)


def test_initial_joints_of_one_episode(study_folder: Any) -> None:
    study_folder.content["initial"] = {"joints": "first_reading"}
    study_folder.content["episodes"][1]["joints"] = {"elbow": 0.125}
    first, second = load_study(study_folder.write()).episodes
    assert first.joints != {"elbow": 0.125}
    assert second.joints == {"elbow": 0.125}


def test_efforts(study_folder: Any) -> None:
    content = study_folder.content
    del content["actuators"]
    content["efforts"] = {"elbow": {"column": "tension_flexor", "unit": "N m"}}
    study = load_study(study_folder.write())
    assert study.inverse
    assert study.channels[-1].name == "effort of elbow"
    assert study.channels[-1].kind == "effort"
    assert study.channels[-1].sensor == "elbow"
    np.testing.assert_array_equal(study.episodes[0].command, np.zeros((200, 2)))


def test_a_joint_may_rest_while_efforts_are_measured(study_folder: Any) -> None:
    content = study_folder.content
    for log in ("robot_0.csv", "robot_1.csv"):
        if "angle_elbow" in study_folder.logs[log]:
            study_folder.logs[log]["angle_elbow"] = [0.3] * 200
    with pytest.raises(StudyError, match="angle_elbow has the same value in every row"):
        load_study(study_folder.write())
    del content["actuators"]
    content["efforts"] = {"elbow": {"column": "tension_flexor", "unit": "N m"}}
    assert load_study(study_folder.write()).inverse


def test_quaternions_do_not_jump(study_folder: Any) -> None:
    angles = np.linspace(0.2, 6.0, 40)
    quaternions = np.stack([np.cos(angles / 2), 0 * angles, np.sin(angles / 2), 0 * angles])
    flips = np.where(np.arange(40) % 3 == 0, -1.0, 1.0)
    columns = ["q_w", "q_x", "q_y", "q_z"]
    for name in ("camera_0.csv", "camera_1.csv"):
        measured = 1.01 * flips * quaternions
        study_folder.logs[name] |= dict(zip(columns, measured.tolist(), strict=True))
    study_folder.content["sensors"]["marker_turn"] = {"columns": columns, "unit": 1, "noise": 0.01}
    study = load_study(study_folder.write())
    read = np.array([study.episodes[0].readings[i].value for i in range(7, 11)])
    np.testing.assert_allclose(read, quaternions, atol=1e-9)
    study_folder.logs["camera_0.csv"]["q_w"][4] = ""
    with pytest.raises(StudyError, match="only a part"):
        load_study(study_folder.write())
    study_folder.logs["camera_0.csv"]["q_w"][4] = 3.0
    with pytest.raises(StudyError, match="norm"):
        load_study(study_folder.write())


def test_a_long_log_is_read_within_a_second(study_folder: Any) -> None:
    # 60 s at 100 Hz with 100 columns; parsing it in Python takes longer than a second.
    rows, columns = 6000, 100
    random = np.random.default_rng(0)
    cells = random.normal(0.2, 0.01, (rows, columns))
    cells[:, 0] = 0.01 * np.arange(rows)
    head = ["time", "target_flexor", "target_extensor", "length_flexor"]
    head += [f"other_{i}" for i in range(columns - len(head))]
    np.savetxt(
        study_folder.path.parent / "long.csv",
        cells,
        delimiter=",",
        header=",".join(head),
        comments="",
        fmt="%.8f",
    )
    study_folder.content["episodes"] = [{"commands": "long.csv"}]
    line = {"unit": "m", "noise": 0.01}
    study_folder.content["sensors"] = {"length_flexor": {"column": "length_flexor", **line}}
    study_folder.write()
    begin = time.perf_counter()
    load_study(study_folder.path)
    assert time.perf_counter() - begin < 1.0


def test_ranges_in_radians_that_the_model_reads_as_degrees(study_folder: Any) -> None:
    model = study_folder.path.parent / "lever.xml"
    text = model.read_text(encoding="utf-8")
    model.write_text(text.replace('range="-60 60"', 'range="-1 1"'), encoding="utf-8")
    with pytest.raises(StudyError, match="the model's ranges are in radians, without compiler"):
        load_study(study_folder.write())


def test_episodes_have_logs_starts_and_shifts(study_folder: Any) -> None:
    before = load_study(study_folder.path)
    first, second = study_folder.content["episodes"]
    first |= {"log": "monday", "shifts": {"camera_0.csv": 0.1}}
    second |= {"start": 3600.0}
    study = load_study(study_folder.write())
    assert before.logs == ("",)
    assert study.logs == ("monday", "robot_1")
    # The first episode lasts 4 s with the last picture of its camera.
    np.testing.assert_allclose(study.elapsed(np.array([1.0, 5.0])), [1.0, 3601.0])
    camera = len(study.channels) - 1
    shifted, plain = (s.episodes[0].readings[camera].time for s in (study, before))
    np.testing.assert_allclose(shifted, plain + 0.1)


def test_pauses_are_unknown_if_clocks_restart(study_folder: Any) -> None:
    time = np.array([0.0, 3.0, 6.0])
    np.testing.assert_array_equal(load_study(study_folder.path).elapsed(time), time)


def test_a_shift_of_an_unknown_file_is_refused(study_folder: Any) -> None:
    study_folder.content["episodes"][0]["shifts"] = {"camera.csv": 0.1}
    with pytest.raises(StudyError, match=r"'camera\.csv' is none of them: camera_0\.csv"):
        load_study(study_folder.write())


def test_encoders_are_relative_or_absolute(study_folder: Any) -> None:
    assert not load_study(study_folder.path).absolute_encoders
    study_folder.content["encoders"] = "absolute"
    assert load_study(study_folder.write()).absolute_encoders
    study_folder.content["encoders"] = "both"
    with pytest.raises(StudyError, match="encoders must be relative or absolute"):
        load_study(study_folder.write())

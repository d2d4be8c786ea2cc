"""Check: suspicious studies get warnings, and a good study gets none."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from reality_gap.check import causes_without_location, check_study, summary
from reality_gap.io.loader import load_study


def sentences_of(folder: Any) -> str:
    """Write the study and return its warnings in one string."""
    sentences = check_study(load_study(folder.write()))
    assert all("\n" not in sentence for sentence in sentences)
    return "; ".join(sentences)


def scale(folder: Any, column: str, factor: float) -> None:
    """Multiply a column in every log that has it."""
    for columns in folder.logs.values():
        if column in columns:
            columns[column] = [factor * cell for cell in columns[column]]


def test_a_good_study_gets_no_warning(study_folder: Any) -> None:
    assert sentences_of(study_folder) == ""


def test_summary(study_folder: Any) -> None:
    text = summary(load_study(study_folder.path))
    assert text == "2 episodes, 7.96 s, 7 channels, 1840 readings"


def test_centimetres_as_metres(study_folder: Any) -> None:
    scale(study_folder, "length_flexor", 10.0)
    assert "length_flexor is 2" in sentences_of(study_folder)


@pytest.mark.parametrize(
    ("column", "what"),
    [("length_flexor", "length_flexor is"), ("target_flexor", "the command of flexor is")],
)
def test_lengths_that_are_zero_where_the_model_is_assembled(
    study_folder: Any, column: str, what: str
) -> None:
    """Even if they hardly leave zero, they are no metres that are taken for millimetres."""
    model = load_study(study_folder.path).spec().compile()
    length = float(model.tendon_length0[model.tendon("flexor").id])
    for columns in study_folder.logs.values():
        if column in columns:
            columns[column] = [cell - length for cell in columns[column]]
    sentences = sentences_of(study_folder)

    assert what in sentences
    assert f"0 at qpos0, where the length is {length:.4g} m; add offset: {length:.4g}" in sentences


def test_radians_as_degrees(study_folder: Any) -> None:
    study_folder.content["sensors"]["angle_elbow"]["unit"] = "deg"
    assert "angle_elbow moves 0.0174 times as far" in sentences_of(study_folder)


def test_wrong_sign(study_folder: Any) -> None:
    del study_folder.content["sensors"]["tension_flexor"]["scale"]
    sentences = sentences_of(study_folder)
    assert "tension_flexor" in sentences
    assert "scale: -1" in sentences


def test_a_tendon_at_its_smallest_tension_is_not_suspicious(study_folder: Any) -> None:
    """The motor pulls with at least 10 N; an offset of the sensor reads 3 N less."""
    for log in ("robot_0.csv", "robot_1.csv"):
        cells = study_folder.logs[log]["tension_flexor"]
        study_folder.logs[log]["tension_flexor"] = [7.0 + 0.1 * (i % 7) for i in range(len(cells))]
    assert "at its median" not in sentences_of(study_folder)


def test_gap_in_time(study_folder: Any) -> None:
    log = study_folder.logs["robot_0.csv"]
    log["time"] = [t + 2.0 * (t > 1.5) for t in log["time"]]
    assert "robot_0: no rows between 1.5 and 3.52 s" in sentences_of(study_folder)


def test_readings_after_the_commands(study_folder: Any) -> None:
    log = study_folder.logs["camera_0.csv"]
    log["time"] = [3.0 * t for t in log["time"]]
    assert "commands end at 3.98 s" in sentences_of(study_folder)


def test_the_same_episode_twice(study_folder: Any) -> None:
    for name in ("robot", "camera"):
        study_folder.logs[f"{name}_1.csv"] = study_folder.logs[f"{name}_0.csv"]
    assert "robot_0 and robot_1 have the same readings" in sentences_of(study_folder)


def test_the_same_column_twice(study_folder: Any) -> None:
    study_folder.content["sensors"]["length_extensor"]["column"] = "length_flexor"
    assert "length_flexor and length_extensor have the same values" in sentences_of(study_folder)


@pytest.mark.parametrize(
    ("noise", "words"),
    [(1e-2, "the log was not filtered"), (1e-6, "log shows about")],
)
def test_a_stated_noise_that_differs_from_the_log(
    study_folder: Any, noise: float, words: str
) -> None:
    study_folder.content["sensors"]["length_flexor"]["noise"] = noise
    sentences = sentences_of(study_folder)
    assert f"the noise of length_flexor is stated as {noise:.2g} m" in sentences
    assert words in sentences


def test_a_channel_that_hardly_moves(study_folder: Any) -> None:
    random = np.random.default_rng(0)
    for i in range(2):
        log = study_folder.logs[f"robot_{i}.csv"]
        log["length_flexor"] = (0.2 + random.normal(0.0, 1e-4, 200)).tolist()
    sentences = sentences_of(study_folder)
    assert "length_flexor hardly moves" in sentences
    assert "too quiet" not in sentences


def test_a_log_that_is_too_quiet(study_folder: Any) -> None:
    random = np.random.default_rng(0)
    for columns in study_folder.logs.values():
        for name, cells in columns.items():
            if name.startswith("target"):
                columns[name] = [cells[0]] * len(cells)
            elif name != "time":
                columns[name] = (cells[0] + random.normal(0.0, 1e-4, len(cells))).tolist()
    sentences = sentences_of(study_folder)
    assert "too quiet" in sentences
    assert "coulomb_friction" in sentences
    assert "no command ever changes" in sentences


def test_commands_that_never_reverse(study_folder: Any) -> None:
    for columns in study_folder.logs.values():
        for name in ("target_flexor", "target_extensor"):
            if name in columns:
                columns[name] = sorted(columns[name])
    # Sorted in each episode, they still decrease from one episode to the next.
    study_folder.content["episodes"].pop()
    assert "no command reverses its direction" in sentences_of(study_folder)


def test_an_initial_position_that_contradicts_the_log(study_folder: Any) -> None:
    study_folder.content["initial"] = {"joints": {"elbow": math.radians(70.0)}, "settle": 0}
    sentences = sentences_of(study_folder)
    assert "robot_0 begins with elbow at 1.22, outside its range" in sentences
    assert "'joints: first_reading' uses the reading" in sentences


def test_a_joint_that_was_measured_beyond_a_stop_of_the_model(study_folder: Any) -> None:
    study = load_study(study_folder.write())
    low, high = study.spec().compile().joint("elbow").range
    [angle] = [i for i, channel in enumerate(study.channels) if channel.sensor == "angle_elbow"]
    most = max(episode.readings[angle].value.max() for episode in study.episodes)
    beyond = 0.1 * (high - low)
    for columns in study_folder.logs.values():
        if "angle_elbow" in columns:
            shifted = [x + high + beyond - most for x in columns["angle_elbow"]]
            columns["angle_elbow"] = shifted
    sentences = sentences_of(study_folder)
    assert f"elbow is measured up to {beyond:.3g} beyond its range in the model" in sentences


def test_a_residual_that_no_fault_causes(study_folder: Any) -> None:
    study_folder.content["sensors"]["length_flexor"]["noise"] = 1e-10
    sentences = sentences_of(study_folder)
    assert "length_flexor differs from the model's replay by" in sentences
    assert "gaps are below 3000 times the noise" in sentences


def test_a_sensor_that_was_off_for_an_episode(study_folder: Any) -> None:
    study_folder.logs["robot_1.csv"]["length_flexor"] = [0.2] * 200
    assert "length_flexor is constant in robot_1" in sentences_of(study_folder)


def test_a_coarse_sensor(study_folder: Any) -> None:
    for i in range(2):
        log = study_folder.logs[f"robot_{i}.csv"]
        log["angle_elbow"] = [round(cell * 5.0) / 5.0 for cell in log["angle_elbow"]]
    assert "angle_elbow has only" in sentences_of(study_folder)


def test_commands_that_the_model_clips(study_folder: Any) -> None:
    model = study_folder.path.parent / "lever.xml"
    text = model.read_text(encoding="utf-8")
    limited = text.replace('<general name="flexor"', '<general ctrlrange="0.19 0.3" name="flexor"')
    model.write_text(limited, encoding="utf-8")
    assert "command of flexor exceeds the model's ctrlrange" in sentences_of(study_folder)


def test_a_replay_that_diverges(study_folder: Any) -> None:
    model = study_folder.path.parent / "lever.xml"
    text = model.read_text(encoding="utf-8").replace('mass="1"', 'mass="1e-9"')
    unstable = text.replace('timestep="0.004" integrator="implicitfast"', 'timestep="0.01"')
    model.write_text(unstable.replace('damping="1"', ""), encoding="utf-8")
    assert "replay of robot_0 diverges" in sentences_of(study_folder)


def test_causes_without_location_are_listed(study_folder: Any) -> None:
    study_folder.content["sensors"] = {
        "angle_elbow": study_folder.content["sensors"]["angle_elbow"]
    }
    missing = causes_without_location(load_study(study_folder.write()))
    assert "tension_scale" in missing
    assert "coulomb_friction" not in missing

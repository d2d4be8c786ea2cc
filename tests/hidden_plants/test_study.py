"""A written study is readable by itself and does not contain the truth."""

from __future__ import annotations

import csv
from pathlib import Path

import mujoco
import numpy as np
import pytest
import yaml

from hidden_plants import Effect, Nuisance, Secret, Truth, run, write_study
from hidden_plants.machine import load

ASSETS = Path(__file__).parents[2] / "assets" / "mjcf" / "kengoro_arm"
LENGTHS = ("length_biceps", "length_brachialis", "length_triceps")
TENSIONS = ("tension_biceps", "tension_brachialis", "tension_triceps")
POSE = ("marker_position", "marker_orientation")
HEAVY = Secret((Effect("link_mass", ("hand",), {"mass": 0.3}, 0.3),), kind="single")


@pytest.fixture(scope="module")
def null(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Truth]:
    folder = tmp_path_factory.mktemp("null")
    return folder, write_study(folder, Secret(), 0, assets=ASSETS, seconds=8.0)


def columns(path: Path) -> dict[str, np.ndarray]:
    with path.open() as file:
        rows = list(csv.DictReader(file))
    return {
        name: np.array([float(row[name]) if row[name] else np.nan for row in rows])
        for name in rows[0]
    }


def replay(folder: Path, truth: Truth, episode: int) -> dict[str, np.ndarray]:
    """Readings of the nominal model in MuJoCo under the logged commands."""
    study = yaml.safe_load((folder / "STUDY.yaml").read_text())
    model = mujoco.MjModel.from_xml_path(str(folder / study["model"]))
    data = mujoco.MjData(model)
    for joint, angle in study["initial"]["joints"].items():
        data.joint(joint).qpos[0] = angle
    done = truth.episodes[episode]
    settle, steps = round(study["initial"]["settle"] / 0.002), round(done.duration / 0.002)
    stored = np.empty((steps, model.nsensordata))
    for k in range(-settle, steps):
        row = np.searchsorted(done.time, k * 0.002 + 1e-9, side="right") - 1
        data.ctrl[:] = done.command[max(row, 0)]
        mujoco.mj_forward(model, data)
        if k >= 0:
            stored[k] = data.sensordata
        mujoco.mj_step(model, data)
    time = np.arange(steps) * 0.002
    times_of = {
        **dict.fromkeys((*LENGTHS, *TENSIONS), done.sensor_time),
        **dict.fromkeys(POSE, done.camera_time),
    }
    result = {}
    for name, times in times_of.items():
        sensor = model.sensor(name)
        values = stored[:, sensor.adr[0] : sensor.adr[0] + sensor.dim[0]]
        result[name] = np.stack([np.interp(times, time, v) for v in values.T], 1).squeeze()
    return result


def test_a_null_study_is_the_replay_of_the_nominal_model_up_to_nuisance(
    null: tuple[Path, Truth],
) -> None:
    folder, truth = null
    for episode, done in enumerate(truth.episodes):
        nominal = replay(folder, truth, episode)
        for name, tolerance in [*((n, 3e-4) for n in LENGTHS), ("marker_position", 2e-3)]:
            assert np.sqrt(np.mean((done.clean[name] - nominal[name]) ** 2)) < tolerance, name
        for name in TENSIONS:
            assert np.sqrt(np.mean((done.clean[name] + nominal[name]) ** 2)) < 6.0, name


def test_without_nuisance_a_null_study_is_the_replay_of_the_nominal_model(tmp_path: Path) -> None:
    truth = write_study(
        tmp_path, Secret(), 0, assets=ASSETS, seconds=4.0, nuisance=Nuisance().scaled(0.0)
    )
    nominal, done = replay(tmp_path, truth, 0), truth.episodes[0]
    for name in LENGTHS:
        assert np.abs(done.clean[name] - nominal[name]).max() < 2e-4
    for name in TENSIONS:
        assert np.sqrt(np.mean((done.clean[name] + nominal[name]) ** 2)) < 2.0
    for name in POSE:
        assert np.sqrt(np.mean((done.clean[name] - nominal[name]) ** 2)) < 4e-4


def test_all_columns_and_sensors_of_the_study_exist(null: tuple[Path, Truth]) -> None:
    folder, _ = null
    study = yaml.safe_load((folder / "STUDY.yaml").read_text())
    model = mujoco.MjModel.from_xml_path(str(folder / study["model"]))
    assert len(study["episodes"]) == 2
    for episode in study["episodes"]:
        found = set(columns(folder / episode["commands"]))
        for more in episode.get("readings", []):
            found |= set(columns(folder / more))
        for name, actuator in study["actuators"].items():
            assert model.actuator(name).name == name
            assert actuator["column"] in found
        for name, sensor in study["sensors"].items():
            wanted = sensor.get("columns", [sensor.get("column")])
            assert model.sensor(name).dim[0] == len(wanted)
            assert set(wanted) <= found
            assert isinstance(sensor["unit"], str)


def test_the_noise_is_that_of_the_study(null: tuple[Path, Truth]) -> None:
    folder, truth = null
    log, done = columns(folder / "sensors_0.csv"), truth.episodes[0]
    for names, noise in ((LENGTHS, 1e-4), (TENSIONS, 1.0)):
        for name in names:
            assert np.std(log[name] - done.clean[name]) == pytest.approx(noise, rel=0.25)


def test_time_stamps_have_jitter_and_are_exact_to_a_tenth_of_a_millisecond(
    null: tuple[Path, Truth],
) -> None:
    folder, truth = null
    done = truth.episodes[0]
    assert columns(folder / "episode_0.csv")["time"][0] == 0.0
    for name, true in (("episode_0.csv", done.time), ("sensors_0.csv", done.sensor_time)):
        time = columns(folder / name)["time"]
        assert np.abs(time - true).max() < 0.6e-4
        assert 3e-4 < np.std(time - 0.02 * np.arange(len(time))) < 1e-3


@pytest.mark.parametrize("seed", range(6))
def test_the_camera_is_slower_than_the_encoders(tmp_path: Path, seed: int) -> None:
    write_study(tmp_path, Secret(), seed, assets=ASSETS, seconds=4.0)
    camera = tmp_path / "camera_0.csv"
    log = columns(camera if camera.exists() else tmp_path / "sensors_0.csv")
    observed = log["time"][np.isfinite(log["marker_x"])]
    assert 35 <= len(observed) <= 41


def test_the_bytes_of_a_study_depend_on_the_seed_only(tmp_path: Path) -> None:
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        write_study(tmp_path / name, HEAVY, seed, assets=ASSETS, seconds=4.0, baseline=False)
    first, again, other = (
        [(path.name, path.read_bytes()) for path in sorted((tmp_path / name).iterdir())]
        for name in "abc"
    )
    assert first == again
    assert dict(first)["sensors_0.csv"] != dict(other)["sensors_0.csv"]


def test_the_folder_does_not_contain_the_truth(tmp_path: Path) -> None:
    write_study(tmp_path / "null", Secret(), 3, assets=ASSETS, seconds=4.0)
    write_study(tmp_path / "heavy", HEAVY, 3, assets=ASSETS, seconds=4.0)
    for name in ("model.xml", "STUDY.yaml"):
        assert (tmp_path / "null" / name).read_text() == (tmp_path / "heavy" / name).read_text()
    files = [{path.name for path in (tmp_path / name).iterdir()} for name in ("null", "heavy")]
    assert files[0] == files[1]


def test_one_more_motion_is_appended_to_the_study(tmp_path: Path) -> None:
    truth = write_study(tmp_path, HEAVY, 5, assets=ASSETS, seconds=4.0)
    before = {path.name: path.read_bytes() for path in tmp_path.glob("episode_*.csv")}
    target = load("elbow", ASSETS).lengths(np.full((100, 1), 1.0)) - 2e-3
    done = run(tmp_path, HEAVY, 5, 0.02 * np.arange(100), target, assets=ASSETS)
    study = yaml.safe_load((tmp_path / "STUDY.yaml").read_text())
    assert [episode["commands"] for episode in study["episodes"]] == [
        "episode_0.csv",
        "episode_1.csv",
    ]
    assert all((tmp_path / name).read_bytes() == text for name, text in before.items())
    assert done.start == pytest.approx(truth.episodes[0].duration)
    assert len(columns(tmp_path / "episode_1.csv")["time"]) == 100


def test_a_missing_model_is_an_error_with_its_path(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"no model at .*elbow\.xml"):
        write_study(tmp_path, Secret(), 0, assets=tmp_path)

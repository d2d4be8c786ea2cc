"""Recordings: a replay of the nominal model has the measured readings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import yaml

from experiments.record.run import Args, main
from kengoro.commands.record import read_targets
from kengoro.errors import UsageError
from kengoro.recording import Tour, elbow, whole_arm
from kengoro.study_writer import speed
from kengoro_env.robot.nominal_model import NominalArm
from reality_gap import load_study
from reality_gap.simulation.replayer import Replayer

SHORT: dict[str, Any] = {"duration": 1.6, "move": 0.6, "hold": 0.5}


@pytest.fixture(scope="module")
def nominal(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("nominal")
    main(Args(folder, **SHORT))
    return folder


def table(path: Path) -> np.ndarray:
    return np.genfromtxt(path, delimiter=",", names=True)


def replayed(folder: Path, rows: int) -> tuple[dict[str, Any], mujoco.MjModel, np.ndarray]:
    """The study, its model, and what the model's sensors read (rows, ...) at each row of the log:
    with MuJoCo alone, according to the study."""
    study = yaml.safe_load((folder / "STUDY.yaml").read_text())
    model = mujoco.MjModel.from_xml_path(str(folder / study["model"]))
    data = mujoco.MjData(model)
    log = table(folder / study["episodes"][0]["commands"])
    for joint, angle in study["episodes"][0]["joints"].items():
        data.joint(joint).qpos[0] = angle
    command = np.zeros((rows, model.nu))
    for actuator, entry in study["actuators"].items():
        command[:, model.actuator(actuator).id] = log[entry["column"]][:rows] + entry["offset"]
    data.ctrl[:] = command[0]
    mujoco.mj_step(model, data, round(study["initial"]["settle"] / model.opt.timestep))
    read = np.zeros((rows, model.nsensordata))
    for row, ctrl in enumerate(command):
        mujoco.mj_forward(model, data)
        read[row] = data.sensordata
        data.ctrl[:] = ctrl
        mujoco.mj_step(model, data, 10)
    return study, model, read


def column(model: mujoco.MjModel, sensor: str) -> int:
    return int(model.sensor(sensor).adr[0])


def test_model_replays_the_readings_of_the_nominal_robot(nominal: Path) -> None:
    log = table(nominal / "log_0.csv")
    study, model, read = replayed(nominal, len(log))
    lengths = tensions = 0
    for sensor, entry in study["sensors"].items():
        if sensor.startswith("length"):
            measured = log[entry["column"]] + entry["offset"]
            assert np.abs(measured - read[:, column(model, sensor)]).max() < 1e-6, sensor
            lengths += 1
        elif sensor.startswith("tension"):
            gap = entry["scale"] * log[entry["column"]] - read[:, column(model, sensor)]
            known = gap[np.isfinite(gap)]
            assert len(known) > len(log) / 4, sensor
            assert np.sqrt(np.mean(known**2)) < entry["noise"], sensor
            tensions += 1
    assert lengths == tensions == 36


def test_model_replays_what_the_drawing_saw(nominal: Path) -> None:
    observations = table(nominal / "camera_0.csv")
    assert len(observations) >= 5
    assert np.all(np.diff(observations["time"]) > 0.19)
    study, model, read = replayed(nominal, len(table(nominal / "log_0.csv")))
    rows = np.round(observations["time"] / 0.02).astype(int)
    for sensor, noise in (("marker_position", 3e-4), ("marker_orientation", 3e-3)):
        names = study["sensors"][sensor]["columns"]
        measured = np.array([observations[name] for name in names]).T
        first = column(model, sensor)
        expected = read[rows, first : first + len(names)]
        if len(names) == 4:
            measured *= np.sign(np.sum(measured * expected, axis=1))[:, None]
        assert np.abs(measured - expected).max() < noise, sensor


@pytest.mark.usefixtures("frictionless")
def test_reality_gap_finds_no_gap(nominal: Path) -> None:
    study = load_study(nominal / "STUDY.yaml")
    with Replayer(study) as bench:
        residual = bench.residual([])
        sensors = np.array([study.channels[c].sensor for c in bench.measured.channel])
    kinds = np.array([sensor.split("_")[0] for sensor in sensors])
    for kind in ("length", "tension", "marker"):
        assert np.sqrt(np.mean(residual[kinds == kind] ** 2)) < 1.0, kind


def test_moving_muscles_have_no_tension(nominal: Path) -> None:
    log = table(nominal / "log_0.csv")
    lengths = np.array([log[name] for name in log.dtype.names if name.startswith("length")]).T
    tensions = np.array([log[name] for name in log.dtype.names if name.startswith("tension")]).T
    fast = speed(lengths, log["time"]) > 0.01
    assert fast.any()
    assert np.isnan(tensions[fast]).all()


def test_only_what_the_agent_knows_is_written(tmp_path: Path) -> None:
    main(Args(tmp_path, robot=7, **SHORT))
    names = table(tmp_path / "log_0.csv").dtype.names
    muscles = NominalArm(whole_arm().scene).muscles
    kinds = ("target", "length", "tension")
    assert names == ("time", *(f"{kind}_{muscle}" for kind in kinds for muscle in muscles))
    written = {path.name for path in tmp_path.iterdir()}
    assert written == {"STUDY.yaml", "model.xml", "log_0.csv", "camera_0.csv"}
    assert "7" not in yaml.safe_load((tmp_path / "STUDY.yaml").read_text())["name"]
    nominal = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    assert nominal.njnt == 18  # no spool: the model is the drawing


def test_same_seed_same_bytes_and_robots_differ(tmp_path: Path) -> None:
    for name, robot in (("a", 3), ("b", 3), ("c", 4)):
        main(Args(tmp_path / name, robot=robot, arm="elbow", **SHORT))
    a, b, c = (sorted((tmp_path / name).iterdir()) for name in "abc")
    assert [path.read_bytes() for path in a] == [path.read_bytes() for path in b]
    assert (tmp_path / "a/log_0.csv").read_bytes() != (tmp_path / "c/log_0.csv").read_bytes()
    assert (tmp_path / "a/model.xml").read_bytes() == (tmp_path / "c/model.xml").read_bytes()
    assert len(a) == len(c) == 3  # an elbow has no camera


def test_episodes_visit_different_postures(tmp_path: Path) -> None:
    main(Args(tmp_path, arm="elbow", episodes=2, **SHORT))
    episodes = yaml.safe_load((tmp_path / "STUDY.yaml").read_text())["episodes"]
    assert [episode["commands"] for episode in episodes] == ["log_0.csv", "log_1.csv"]
    assert episodes[0]["joints"] != episodes[1]["joints"]


def test_targets_are_visited_in_their_order(tmp_path: Path) -> None:
    targets = tmp_path / "targets.csv"
    targets.write_text("elbow\n20\n60\n")
    main(Args(tmp_path / "out", arm="elbow", targets=targets, move=0.5, hold=1.0))
    log = table(tmp_path / "out/log_0.csv")
    drawing = NominalArm(elbow().scene)
    for time, angle in ((0.5, 20.0), (2.4, 60.0)):
        row = int(np.searchsorted(log["time"], time))
        expected = drawing.lengths(np.radians([[angle]]))[0]
        commanded = [log[f"target_{muscle}"][row] for muscle in drawing.muscles]
        np.testing.assert_allclose(commanded, expected, atol=1e-6)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("knee\n20\n", "need the columns elbow"),
        ("elbow\nbent\n", "need a number in each cell"),
        ("elbow\n20\n300\n", "put elbow at 300 deg in row 2"),
    ],
)
def test_wrong_targets_get_a_message(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "targets.csv"
    path.write_text(text)
    with pytest.raises(UsageError, match=message):
        read_targets(path, NominalArm(elbow().scene))


@pytest.mark.parametrize("wrong", [{"move": 0.0}, {"episodes": 0}, {"robot": -1}])
def test_invalid_options_get_a_message_and_write_nothing(
    tmp_path: Path, wrong: dict[str, Any]
) -> None:
    with pytest.raises(UsageError):
        main(Args(tmp_path / "out", **wrong))
    assert not (tmp_path / "out").exists()


def test_tour_stays_and_moves() -> None:
    tour = Tour(np.array([[0.0], [1.0], [3.0]]), move=2.0, hold=1.0)
    assert tour.duration == 7.0
    times = (-1.0, 0.5, 2.0, 3.0, 3.9, 5.0, 6.0, 99.0)
    angles = [float(tour.at(time)[0]) for time in times]
    np.testing.assert_allclose(angles, [0.0, 0.0, 0.5, 1.0, 1.0, 2.0, 3.0, 3.0])

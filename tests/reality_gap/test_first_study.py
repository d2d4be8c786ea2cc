"""From a model and logs of any layout to a study."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import mujoco
import numpy as np
import pytest
import yaml

from reality_gap.__main__ import main
from reality_gap.errors import StudyError
from reality_gap.first_study import correct_columns, write_first_study
from reality_gap.types import Floats

ARM = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002"/>
  <default>
    <joint axis="0 1 0" damping="0.3"/>
    <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="0.8"/>
  </default>
  <worldbody>
    <body name="upper">
      <joint name="shoulder_pan" range="-2 2"/><geom/>
      <body name="lower" pos="0.3 0 0"><joint name="elbow_flex" range="-2 2"/><geom/></body>
    </body>
  </worldbody>
  <actuator>
    <position joint="shoulder_pan" kp="60" kv="2"/>
    <position joint="elbow_flex" kp="30" kv="1"/>
  </actuator>
</mujoco>
"""


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    return path


def motion(phase: float = 0.0) -> tuple[Floats, Floats, Floats]:
    """Times (k,) [s], commands (k, 2) and angles (k, 2) [rad] of the arm."""
    simulated = mujoco.MjModel.from_xml_string(ARM)
    data = mujoco.MjData(simulated)
    time = 0.02 * np.arange(200)
    command = np.column_stack(
        [0.6 * np.sin(2.1 * time + phase), 0.5 * np.sin(3.3 * time + 1.0) - 0.4]
    )
    angles = np.zeros((len(time), 2))
    for row, target in zip(angles, command, strict=True):
        row[:] = data.qpos
        data.ctrl[:] = target
        mujoco.mj_step(simulated, data, 10)
    return time, command, angles + 1e-3 * np.random.default_rng(0).standard_normal(angles.shape)


def table(path: Path, header: str, *columns: Floats | list[str]) -> Path:
    rows = zip(*columns, strict=True)
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n")
    return path


def sensors_of(path: Path) -> dict[str, dict[str, object]]:
    found: dict[str, dict[str, object]] = yaml.safe_load(path.read_text())["sensors"]
    return found


def test_names_of_lerobot_and_a_model_without_names_or_sensors(model: Path, tmp_path: Path) -> None:
    time, command, angles = motion()
    degrees = np.degrees(angles)
    log = table(
        tmp_path / "episode_0.csv",
        "timestamp,action.shoulder_pan.pos,action.elbow_flex.pos,"
        "observation.state.shoulder_pan.pos,observation.state.elbow_flex.pos",
        *(time, *np.degrees(command.T), *degrees.T),
    )
    notes: list[str] = []
    path = write_first_study(model, [log], tmp_path / "study", notes.append)
    study = correct_columns(path, notes.append)
    assert [channel.sensor for channel in study.channels] == [
        "shoulder_pan_position",
        "elbow_flex_position",
    ]
    [episode] = study.episodes
    np.testing.assert_allclose(episode.command, command, atol=1e-9)
    np.testing.assert_allclose(episode.readings[1].value, angles[:, 1], atol=1e-9)
    assert any("further sensors" in note for note in notes)


def test_lists_times_of_the_day_and_several_runs(model: Path, tmp_path: Path) -> None:
    time, command, angles = motion()
    begin = datetime(2024, 5, 1, 12, tzinfo=UTC)
    stamps = [(begin + timedelta(seconds=t)).isoformat() for t in [*time, *(time + 60.0)]]
    cells = [[f'"[{a}, {b}]"' for a, b in np.vstack([x, x])] for x in (command, angles)]
    log = table(tmp_path / "log.csv", "# a comment\ntime,action,state", stamps, *cells)
    notes: list[str] = []
    path = write_first_study(model, [log], tmp_path / "study", notes.append)
    study = correct_columns(path, notes.append)
    assert [episode.name for episode in study.episodes] == ["log_1", "log_2"]
    np.testing.assert_allclose(study.episodes[1].command, command, atol=1e-9)
    np.testing.assert_allclose(study.episodes[1].time, time, atol=1e-5)
    assert any("2 runs" in note for note in notes)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda q: np.column_stack([-q[:, 0], q[:, 1]]), "opposite sign"),
        (lambda q: q[:, ::-1], "swapped"),
        (lambda q: np.column_stack([q[:, 0], np.radians(q[:, 1])]), "in radians"),
    ],
)
def test_wrong_columns_are_corrected(
    model: Path, tmp_path: Path, change: Callable[[Floats], Floats], words: str
) -> None:
    time, command, angles = motion()
    header = "t,cmd_shoulder_pan,cmd_elbow_flex,q_shoulder_pan,q_elbow_flex"
    log = table(tmp_path / "log.csv", header, time, *command.T, *change(angles).T)
    notes: list[str] = []
    path = write_first_study(model, [log], tmp_path / "study", notes.append)
    study = correct_columns(path, notes.append)
    for i, reading in enumerate(study.episodes[0].readings):
        np.testing.assert_allclose(reading.value, angles[:, i], atol=1e-6)
    assert any(words in note for note in notes)
    assert words in path.read_text()


def test_a_log_without_time_or_command_is_refused(model: Path, tmp_path: Path) -> None:
    time, command, angles = motion()
    log = table(tmp_path / "log.csv", "a,b", *angles.T)
    with pytest.raises(StudyError, match=r"no column of log\.csv is named like a time"):
        write_first_study(model, [log], tmp_path / "study", print)
    assert not (tmp_path / "study").exists()
    log = table(
        tmp_path / "log.csv",
        "time,cmd_shoulder_pan,q_shoulder_pan",
        time,
        command[:, 0],
        angles[:, 0],
    )
    path = write_first_study(model, [log], tmp_path / "study", print)
    with pytest.raises(StudyError, match="missing: elbow_flex"):
        correct_columns(path, print)


@pytest.mark.slow
def test_run_writes_study_and_result(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    time, command, angles = motion()
    header = "t,cmd_shoulder_pan,cmd_elbow_flex,q_shoulder_pan,q_elbow_flex"
    log = table(tmp_path / "log.csv", header, time, *command.T, -angles[:, 0], angles[:, 1])
    out = tmp_path / "out"
    assert main(["run", str(model), str(log), "--out", str(out), "--jobs", "1"]) == 0
    assert "opposite sign" in capsys.readouterr().out
    assert (out / "result" / "report.html").is_file()
    assert (out / "study" / "STUDY.yaml").is_file()
    assert main(["run", str(model), str(log), "--out", str(out), "--jobs", "1"]) == 0
    assert "exists and is used" in capsys.readouterr().out


def test_a_wrong_option_is_refused_before_anything_is_written(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["run", str(model), "log.csv", "--out", str(out), "--tolerance", "0"]) == 2
    assert "--tolerance must be above 0" in capsys.readouterr().err
    assert not out.exists()

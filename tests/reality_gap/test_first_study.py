"""From a model and logs of any layout to a study."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import mujoco
import numpy as np
import pytest
from mujoco import MjModel

from reality_gap import first_study
from reality_gap.errors import StudyError
from reality_gap.first_study import DRAFT, correct_columns, write_first_study
from reality_gap.io import template
from reality_gap.io.column_assignment import Assignment, assign_columns
from reality_gap.study.data import Study
from reality_gap.types import Floats
from tests.reality_gap.arm_logs import HEADER, motion, table, write_arm

ADDED = [
    f"{joint}_{word}"
    for word in ("position", "velocity", "force")
    for joint in ("shoulder_pan", "elbow_flex")
]
"""Sensors that the arm lacks."""
Change = Callable[[Floats], Floats]


@pytest.fixture
def model(tmp_path: Path) -> Path:
    return write_arm(tmp_path)


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
    assert study.name == "arm"
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


def corrected(
    model: Path, folder: Path, header: str, change: Change
) -> tuple[list[Floats], str, list[str]]:
    """Draft and correct a study of changed angles; return its readings, its text, the notes."""
    time, command, angles = motion()
    log = table(folder / "log.csv", header, time, *command.T, *change(angles).T)
    notes: list[str] = []
    path = write_first_study(model, [log], folder / "study", notes.append)
    assert (folder / "study" / DRAFT).is_file()
    study = correct_columns(path, notes.append)
    assert not (folder / "study" / DRAFT).exists()
    values = [reading.value for reading in study.episodes[0].readings]
    return values, path.read_text(), notes


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda q: np.column_stack([-q[:, 0], q[:, 1]]), "opposite sign"),
        (lambda q: np.column_stack([q[:, 0], np.radians(q[:, 1])]), "in radians"),
    ],
)
def test_wrong_columns_are_corrected(
    model: Path, tmp_path: Path, change: Change, words: str
) -> None:
    values, text, notes = corrected(model, tmp_path, HEADER, change)
    np.testing.assert_allclose(np.transpose(values), motion()[2], atol=1e-6)
    assert any(words in note for note in notes)
    assert words in text


@pytest.mark.parametrize("signs", [(1.0, 1.0), (-1.0, 1.0)])
def test_swapped_columns_without_names_are_corrected(
    model: Path, tmp_path: Path, signs: tuple[float, float]
) -> None:
    """A mirrored axis is corrected as well, by a further replay."""
    header = "time,action.0,action.1,state.0,state.1"
    values, text, _ = corrected(model, tmp_path, header, lambda q: q[:, ::-1] * signs)
    np.testing.assert_allclose(np.transpose(values), motion()[2], atol=1e-6)
    assert text.count("swapped") == 2


def test_columns_with_names_are_not_swapped(model: Path, tmp_path: Path) -> None:
    """Then it may be the commands that are swapped, which only the user knows."""
    values, text, notes = corrected(model, tmp_path, HEADER, lambda q: q[:, ::-1])
    np.testing.assert_allclose(np.transpose(values), motion()[2][:, ::-1], atol=1e-6)
    assert "swapped" not in text
    assert sum("columns swapped" in note for note in notes) == 2


def test_the_sign_of_a_drafted_scale_is_turned(model: Path, tmp_path: Path) -> None:
    time, command, angles = motion()
    values = np.column_stack([-0.5 * angles[:, 0], angles[:, 1]])
    log = table(tmp_path / "log.csv", HEADER, time, *command.T, *values.T)
    path = write_first_study(model, [log], tmp_path / "study", print)
    drafted = "shoulder_pan_position: {column: q_shoulder_pan"
    assert drafted in path.read_text()
    path.write_text(path.read_text().replace(drafted, f"{drafted}, scale: 2"))
    study = correct_columns(path, print)
    np.testing.assert_allclose(study.episodes[0].readings[0].value, angles[:, 0], atol=1e-6)
    assert "scale: -2" in path.read_text()


def test_a_replay_that_diverges_gets_a_note(model: Path, tmp_path: Path) -> None:
    model.write_text(model.read_text().replace('kp="60"', 'kp="1e12"'))
    _, _, notes = corrected(model, tmp_path, HEADER, lambda q: q)
    assert any("replay diverges, so that signs" in note for note in notes)


def two_logs(folder: Path, commands: Floats, readings: Floats) -> list[Path]:
    """A log of commands and a log of angles with the given times."""
    _, command, angles = motion()
    count = len(commands) // len(command)
    command, angles = np.tile(command, (count, 1)), np.tile(angles, (count, 1))
    names = HEADER.split(",")
    return [
        table(folder / "c.csv", ",".join(names[:3]), commands, *command.T),
        table(folder / "q.csv", ",".join([names[0], *names[3:]]), readings, *angles.T),
    ]


def test_clocks_that_have_no_time_in_common_begin_together(model: Path, tmp_path: Path) -> None:
    time = motion()[0]
    notes: list[str] = []
    logs = two_logs(tmp_path, time, time + 1e6)
    study = correct_columns(
        write_first_study(model, logs, tmp_path / "study", notes.append), notes.append
    )
    np.testing.assert_allclose(study.episodes[0].readings[0].time, time, atol=1e-5)
    assert any("was shifted" in note for note in notes)


def test_clocks_that_pause_together_stay(model: Path, tmp_path: Path) -> None:
    time = motion()[0]
    twice = np.r_[time, time + 60.0]
    notes: list[str] = []
    path = write_first_study(model, two_logs(tmp_path, twice, twice), tmp_path / "s", notes.append)
    assert not any("shifted" in note for note in notes)
    study = correct_columns(path, notes.append)
    assert len(study.episodes) == 2
    for episode in study.episodes:
        np.testing.assert_allclose(episode.readings[0].time, time, atol=1e-5)


def test_efforts_without_commands_need_no_actuators(model: Path, tmp_path: Path) -> None:
    time, _, angles = motion()
    header = "time,q_shoulder_pan,q_elbow_flex,effort_shoulder_pan,effort_elbow_flex"
    log = table(tmp_path / "log.csv", header, time, *angles.T, *angles.T)
    notes: list[str] = []
    path = write_first_study(model, [log], tmp_path / "study", notes.append)
    assert "<actuator>" not in (tmp_path / "study" / "model.xml").read_text()
    assert "\nefforts:\n" in path.read_text()
    assert any("the logs have no commands" in note for note in notes)


@pytest.mark.parametrize("wrong", [0, 1])
def test_an_effort_with_the_opposite_sign_is_noted_and_no_position_changes(
    model: Path, tmp_path: Path, wrong: int
) -> None:
    """It may have the sign of the other side of a motor, or the model too much damping."""
    arm = MjModel.from_xml_path(str(model))
    data, time = mujoco.MjData(arm), 0.005 * np.arange(2000)
    phase = np.add(np.outer(time, (2.1, 3.3)), (0.0, 1.0))
    angles, efforts = 0.6 * np.sin(phase), np.zeros((len(time), 2))
    for row, q, p in zip(efforts, angles, phase, strict=True):
        data.qpos, data.qvel = q, 0.6 * np.cos(p) * (2.1, 3.3)
        data.qacc = -q * np.square((2.1, 3.3))
        mujoco.mj_inverse(arm, data)
        row[:] = data.qfrc_inverse
    efforts[:, wrong] *= -1.0
    header = "time,q_shoulder_pan,q_elbow_flex,effort_shoulder_pan,effort_elbow_flex"
    log = table(tmp_path / "log.csv", header, time, *angles.T, *efforts.T)
    notes: list[str] = []
    path = write_first_study(model, [log], tmp_path / "study", notes.append)
    correct_columns(path, notes.append)
    [note] = [note for note in notes if "opposite sign" in note]
    assert note.startswith(f"effort of {('shoulder_pan', 'elbow_flex')[wrong]} follows")
    assert "scale: -1" not in path.read_text()


def test_columns_are_assigned_once(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The study is the same as if its model and its runs were assigned anew."""
    calls: list[Sequence[str]] = []

    def counted(model: MjModel, columns: Sequence[str], added: Collection[str]) -> Assignment:
        calls.append(columns)
        return assign_columns(model, columns, added)

    monkeypatch.setattr(first_study, "assign_columns", counted)
    monkeypatch.setattr(template, "assign_columns", counted)
    time, command, angles = motion()
    header = HEADER.replace("time", "timestamp_s") + ",clock"
    log = table(tmp_path / "log.csv", header, time, *command.T, *angles.T, time)
    path = write_first_study(model, [log], tmp_path / "study", print)
    assert calls == [("time", "timestamp_s", *HEADER.split(",")[1:])]
    drafted_text = template.draft_study(
        path.parent / "model.xml", [path.parent / "log.csv"], name="arm", added=ADDED
    )
    assert path.read_text() == drafted_text


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
    assert (tmp_path / "study" / DRAFT).is_file()


def test_a_folder_that_exists_is_not_overwritten(model: Path, tmp_path: Path) -> None:
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / "mine.txt").touch()
    with pytest.raises(StudyError, match="exists and is not overwritten"):
        write_first_study(model, [tmp_path / "log.csv"], tmp_path / "study", print)


def drafted(model: Path, folder: Path, *logs: Path) -> tuple[Study, list[str]]:
    """Draft and correct a study; return it with the notes."""
    notes: list[str] = []
    path = write_first_study(model, list(logs), folder / "study", notes.append)
    return correct_columns(path, notes.append), notes


def test_rows_without_a_command_hold_the_one_before(model: Path, tmp_path: Path) -> None:
    """Merged logs have a row for each message."""
    time, command, angles = motion()
    rows = [
        row
        for t, c, q in zip(time, command, angles, strict=True)
        for row in (f"{t},{c[0]},{c[1]},,", f"{t + 0.005},,,{q[0]},{q[1]}")
    ]
    log = tmp_path / "log.csv"
    log.write_text("\n".join([HEADER, *rows]))
    study, notes = drafted(model, tmp_path, log)
    np.testing.assert_allclose(study.episodes[0].command, np.repeat(command, 2, axis=0))
    assert len(study.episodes[0].readings[0].value) == len(time)
    assert any("200 rows without a command" in note for note in notes)


@pytest.mark.parametrize(
    ("cell", "unit", "angle"),
    [
        (-0.4, "", -0.4),
        (-30.0, "", np.radians(-30.0)),
        (-30.0, "_deg", np.radians(-30.0)),
        (1800.0, "", (1800 - 2048) * 2 * np.pi / 4096),
    ],
)
def test_a_joint_at_rest_is_left_out_and_keeps_its_position(
    model: Path, tmp_path: Path, cell: float, unit: str, angle: float
) -> None:
    time, command, angles = motion()
    rest = np.full(len(time), cell)
    columns = (time, command[:, 0], 0.0 * time, angles[:, 0], rest)
    log = table(tmp_path / "log.csv", HEADER + unit, *columns)
    study, notes = drafted(model, tmp_path, log)
    assert [channel.sensor for channel in study.channels] == ["shoulder_pan_position"]
    assert study.episodes[0].joints["elbow_flex"] == pytest.approx(angle, abs=1e-6)
    assert any("elbow_flex_position was left out" in note for note in notes)


@pytest.mark.parametrize(
    ("shift", "first"),
    [(0.3, 20), (-0.25, 20), (1.7e9, 20), (1.7e9, 4), (1.7e9, 75)],
)
def test_clocks_of_two_files_are_aligned(
    model: Path, tmp_path: Path, shift: float, first: int
) -> None:
    """Files without a time in common begin together at first, though one may have begun later."""
    time, command, angles = motion()
    commands = table(
        tmp_path / "commands.csv", "time,cmd_shoulder_pan,cmd_elbow_flex", time, *command.T
    )
    own = time[first:] + shift
    readings = table(
        tmp_path / "readings.csv", "time,q_shoulder_pan,q_elbow_flex", own, *angles[first:].T
    )
    study, notes = drafted(model, tmp_path, commands, readings)
    reading = study.episodes[0].readings[0]
    expected = np.interp(reading.time, time, angles[:, 0])
    np.testing.assert_allclose(reading.value, expected, atol=0.01)
    assert len(reading.time) > 100
    assert any("it was shifted" in note and "readings.csv" in note for note in notes)
    assert "shifts: {readings.csv:" in (tmp_path / "study" / "STUDY.yaml").read_text()


@pytest.mark.parametrize(
    ("delay", "words", "reason"),
    [(0.06, "lag behind", "motors that are slower"), (-0.06, "are ahead", "velocity feed-forward")],
)
def test_a_delay_in_one_file_is_reported_and_kept(
    model: Path, tmp_path: Path, delay: float, words: str, reason: str
) -> None:
    time, command, angles = motion()
    late = np.column_stack([np.interp(time - delay, time, column) for column in angles.T])
    log = table(tmp_path / "log.csv", HEADER, time, *command.T, *late.T)
    study, notes = drafted(model, tmp_path, log)
    np.testing.assert_allclose(study.episodes[0].readings[0].value, late[:, 0], atol=1e-9)
    [note] = [note for note in notes if words in note]
    assert reason in note
    lag = float(note.split(" by ")[1].split(" ms")[0])
    assert lag == pytest.approx(60.0, abs=3.0)


def test_runs_of_one_file_are_one_log_and_keep_their_times(model: Path, tmp_path: Path) -> None:
    time, command, angles = motion()
    both = np.concatenate([time, time + 600.0])
    twice = [np.tile(column, 2) for column in (*command.T, *angles.T)]
    one = table(tmp_path / "monday.csv", HEADER, both, *twice)
    other = table(tmp_path / "tuesday.csv", HEADER, time + 86400.0, *command.T, *angles.T)
    study, _ = drafted(model, tmp_path, one, other)
    assert study.logs == ("monday", "tuesday")
    assert study.episodes_of("monday") == (0, 1)
    begins = np.cumsum([0.0, *(episode.duration for episode in study.episodes[:-1])])
    np.testing.assert_allclose(study.elapsed(begins + 1.0), [1.0, 601.0, 86401.0])


@pytest.mark.parametrize(
    "header",
    [
        "time,shoulder_pan_cmd,elbow_flex_cmd,shoulder_pan,elbow_flex",
        "time,commanded.shoulder_pan,commanded.elbow_flex,positions.shoulder_pan,positions.elbow_flex",
        "time,desired.positions.0,desired.positions.1,actual.positions.0,actual.positions.1",
    ],
)
def test_a_log_of_a_sound_machine_has_its_commands_and_readings(
    model: Path, tmp_path: Path, header: str
) -> None:
    time, command, angles = motion()
    log = table(tmp_path / "log.csv", header, time, *command.T, *angles.T)
    study, notes = drafted(model, tmp_path, log)
    np.testing.assert_allclose(study.episodes[0].command, command)
    values = [reading.value for reading in study.episodes[0].readings]
    np.testing.assert_allclose(np.transpose(values), angles)
    assert not any("corrected" in note for note in notes)


def speeds(time: Floats, angles: Floats) -> Floats:
    """Velocities of the arm, shape (k, 2) [rad/s]."""
    return np.gradient(angles, time, axis=0)


@pytest.mark.parametrize("columns", ["{}_velocity", "velocities.{}", "{}_speed", "qd_{}"])
def test_velocities_are_readings(model: Path, tmp_path: Path, columns: str) -> None:
    """A log of commands and velocities needs no positions."""
    time, command, angles = motion()
    names = [columns.format(joint) for joint in ("shoulder_pan", "elbow_flex")]
    header = ",".join(["time,cmd_shoulder_pan,cmd_elbow_flex", *names])
    rates = speeds(time, angles)
    log = table(tmp_path / "log.csv", header, time, *command.T, *rates.T)
    study, _ = drafted(model, tmp_path, log)
    assert [(channel.sensor, channel.unit) for channel in study.channels] == [
        ("shoulder_pan_velocity", "rad/s"),
        ("elbow_flex_velocity", "rad/s"),
    ]
    np.testing.assert_allclose(study.episodes[0].readings[1].value, rates[:, 1])


def without_actuators(model: Path) -> None:
    text = model.read_text()
    begin, end = text.index("<actuator>"), text.index("</mujoco>")
    model.write_text(text[:begin] + text[end:])


def test_commands_of_a_model_without_actuators_are_refused(model: Path, tmp_path: Path) -> None:
    """A diagnosis would be that of a passive machine."""
    without_actuators(model)
    time, command, angles = motion()
    log = table(tmp_path / "log.csv", HEADER, time, *command.T, *angles.T)
    with pytest.raises(StudyError, match="no actuators, but cmd_shoulder_pan, cmd_elbow_flex seem"):
        write_first_study(model, [log], tmp_path / "study", print)
    assert not (tmp_path / "study").exists()


def test_commands_beside_efforts_need_no_actuators(model: Path, tmp_path: Path) -> None:
    without_actuators(model)
    time, command, angles = motion()
    header = f"{HEADER},effort_shoulder_pan,effort_elbow_flex"
    log = table(tmp_path / "log.csv", header, time, *command.T, *angles.T, *angles.T)
    notes: list[str] = []
    path = write_first_study(model, [log], tmp_path / "study", notes.append)
    assert "\nefforts:\n" in path.read_text()
    assert any(note.endswith("fits: cmd_shoulder_pan, cmd_elbow_flex") for note in notes)


def test_a_passive_machine_needs_no_commands(model: Path, tmp_path: Path) -> None:
    without_actuators(model)
    time, _, angles = motion()
    header = "time,q_shoulder_pan,q_elbow_flex"
    log = table(tmp_path / "log.csv", header, time, *angles.T)
    study, _ = drafted(model, tmp_path, log)
    assert len(study.channels) == 2

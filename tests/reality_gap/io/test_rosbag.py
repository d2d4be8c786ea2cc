"""Bags: recordings of ROS 1 and ROS 2 become tables that a study can use."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reality_gap.__main__ import main
from reality_gap.errors import StudyError
from reality_gap.io.rosbag import unpack
from tests.reality_gap.io.recordings import ROS1, ROS2, Messages, Recorded, columns_of, record


def robot(messages: Messages) -> list[Recorded]:
    """Two seconds of an arm: joints at 10 Hz, commands, a pose, text and an image."""
    recorded: list[Recorded] = [("/log", 0.0, messages.text("hello"))]
    for i in range(20):
        t = 0.1 * i
        joints = messages.joints(t, ["elbow", "wrist"], [t, 2 * t])
        recorded.append(("/joint_states", t + 0.03, joints))
        recorded.append(("/motor/target", t + 0.01, messages.number(5.0 * t)))
        recorded.append(("/camera/pose", t + 0.04, messages.pose(t, 1.0, t, 3.0)))
    recorded.append(("/camera/image", 2.0, messages.image(2.0)))
    return recorded


@pytest.fixture(params=["ros1", "ros2", "mcap folder", "mcap file"])
def bag(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    """The recording of `robot` in each format."""
    if request.param == "ros1":
        messages = Messages(ROS1)
        return record(tmp_path / "run.bag", messages, robot(messages))
    messages = Messages(ROS2)
    folder = record(tmp_path / "run", messages, robot(messages), mcap="mcap" in request.param)
    return next(folder.glob("*.mcap")) if request.param == "mcap file" else folder


def test_all_formats_become_the_same_tables(bag: Path, tmp_path: Path) -> None:
    written = unpack(bag, tmp_path / "logs", ["/joint_states", "/motor/target", "/camera/pose"])
    t = 0.1 * np.arange(20)

    assert [p.name for p in written] == ["camera_pose.csv", "joint_states.csv", "motor_target.csv"]
    pose, joints, target = map(columns_of, written)
    assert list(joints) == ["time", "joint_states_position_elbow", "joint_states_position_wrist"]
    np.testing.assert_allclose(joints["time"], t, atol=1e-6)
    np.testing.assert_allclose(joints["joint_states_position_wrist"], 2 * t)
    # Messages without a stamp have the time of their arrival.
    np.testing.assert_allclose(target["time"], t + 0.01, atol=1e-6)
    np.testing.assert_allclose(target["motor_target_data"], 5 * t)
    np.testing.assert_allclose(pose["camera_pose_pose_position_y"], t)
    assert "camera_pose_pose_orientation_w" in pose


def test_by_default_all_numbers_are_written_without_images_and_text(
    bag: Path, tmp_path: Path
) -> None:
    names = {path.name for path in unpack(bag, tmp_path / "logs")}

    assert {"joint_states.csv", "motor_target.csv", "camera_pose.csv"} <= names
    assert "log.csv" not in names
    assert all("data" not in c for c in columns_of(tmp_path / "logs" / "camera_image.csv"))


def test_time_of_arrival_is_used_on_request_or_without_stamps(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    recorded = [("/a", 0.5 * i, messages.joints(None, ["j"], [float(i)])) for i in range(3)]
    recorded += [
        ("/b", 0.5 * i + 0.2, messages.joints(0.5 * i, ["j"], [float(i)])) for i in range(3)
    ]
    bag = record(tmp_path / "run", messages, recorded)

    empty, stamped = map(columns_of, unpack(bag, tmp_path / "stamps"))
    _, arrived = map(columns_of, unpack(bag, tmp_path / "arrivals", by_arrival=True))

    np.testing.assert_allclose(empty["time"], [0.0, 0.5, 1.0], atol=1e-6)
    np.testing.assert_allclose(stamped["time"], [0.0, 0.5, 1.0], atol=1e-6)
    np.testing.assert_allclose(arrived["time"], [0.2, 0.7, 1.2], atol=1e-6)


def test_times_increase_and_missing_numbers_are_empty(tmp_path: Path) -> None:
    """Two nodes share a topic; one message is late, one has a repeated time, one is NaN."""
    messages = Messages(ROS2)
    recorded = [
        ("/j", 0.0, messages.joints(0.2, ["a"], [1.0])),
        ("/j", 0.1, messages.joints(0.1, ["b"], [2.0])),
        ("/j", 0.2, messages.joints(0.2, ["a"], [3.0])),
        ("/j", 0.3, messages.joints(0.3, ["b"], [np.nan])),
    ]
    [path] = unpack(record(tmp_path / "run", messages, recorded), tmp_path / "logs")
    table = columns_of(path)

    np.testing.assert_allclose(table["time"], [0.0, 0.1, 0.2], atol=1e-6)
    np.testing.assert_array_equal(table["j_position_a"], [np.nan, 3.0, np.nan])
    np.testing.assert_array_equal(table["j_position_b"], [2.0, np.nan, np.nan])


def test_joints_with_the_same_name_are_numbered(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    recorded = [("/j", 0.1 * i, messages.joints(0.1 * i, ["a", "a"], [1.0, 2.0])) for i in range(3)]
    [path] = unpack(record(tmp_path / "run", messages, recorded), tmp_path / "logs")

    assert list(columns_of(path)) == ["time", "j_position_0", "j_position_1"]


def broken(tmp_path: Path, name: str) -> Path:
    """A path that is not a readable bag."""
    path = tmp_path / name
    if name == "cut.bag":
        messages = Messages(ROS1)
        record(path, messages, robot(messages))
        path.write_bytes(path.read_bytes()[:2000])
    elif name == "cut.mcap":
        messages = Messages(ROS2)
        whole = next(record(tmp_path / "r", messages, robot(messages), mcap=True).glob("*.mcap"))
        path.write_bytes(whole.read_bytes()[:500])
    elif name == "text.bag":
        path.write_text("time,x\n0,1\n")
    elif name == "empty.mcap":
        path.write_bytes(b"")
    elif name == "log.csv":
        path.write_text("time,x\n0,1\n")
    elif name == "folder":
        path.mkdir()
    return path


@pytest.mark.parametrize(
    "name", ["cut.bag", "cut.mcap", "text.bag", "empty.mcap", "log.csv", "folder", "absent.bag"]
)
def test_a_file_that_is_not_a_bag_is_refused_in_one_sentence(tmp_path: Path, name: str) -> None:
    bag = broken(tmp_path, name)

    with pytest.raises(StudyError, match=name) as error:
        unpack(bag, tmp_path / "logs")

    assert "\n" not in str(error.value)
    assert not (tmp_path / "logs").exists()


def test_the_error_for_an_unknown_topic_lists_the_known_ones(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    bag = record(tmp_path / "run", messages, robot(messages))

    with pytest.raises(StudyError, match=r"'/joints'; known: .*/joint_states"):
        unpack(bag, tmp_path / "logs", ["/joints"])
    with pytest.raises(StudyError, match="no message that contains a number"):
        unpack(bag, tmp_path / "logs", ["/log"])


def test_topics_with_the_same_file_name_are_refused(tmp_path: Path) -> None:
    messages = Messages(ROS2)
    recorded = [("/a/b", 0.0, messages.number(1.0)), ("/a_b", 0.1, messages.number(2.0))]

    with pytest.raises(StudyError, match=r"would both be a_b\.csv"):
        unpack(record(tmp_path / "run", messages, recorded), tmp_path / "logs")


def test_from_the_command_line_to_a_draft(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    messages = Messages(ROS2)
    bag = record(tmp_path / "run", messages, robot(messages))
    model = """<mujoco><worldbody><body><joint name="elbow" axis="0 1 0"/>
      <geom size=".1" pos=".2 0 0"/></body></worldbody>
      <actuator><motor name="motor" joint="elbow"/></actuator>
      <sensor><jointpos name="angle" joint="elbow"/></sensor></mujoco>"""
    (tmp_path / "m.xml").write_text(model)
    wanted = ["--topics", "/joint_states", "/motor/target"]

    assert main(["unpack", str(bag), "--out", str(tmp_path / "logs"), *wanted]) == 0
    assert "next: python -m reality_gap init MODEL" in capsys.readouterr().out
    logs = [str(p) for p in sorted((tmp_path / "logs").glob("*.csv"))]
    out = ["--out", str(tmp_path / "STUDY.yaml")]
    assert main(["init", str(tmp_path / "m.xml"), *logs, *out]) == 0

    text = (tmp_path / "STUDY.yaml").read_text()
    assert "commands: logs/motor_target.csv" in text
    assert "readings: [logs/joint_states.csv]" in text
    assert "angle: {column: joint_states_position_elbow, unit: rad}" in text
    assert main(["unpack", str(bag), "--out", str(tmp_path / "logs")]) == 2
    assert "is not overwritten" in capsys.readouterr().err

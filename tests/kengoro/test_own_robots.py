"""Robots of other sizes and kinds: derived scales, reachability, names, and what is refused."""

from __future__ import annotations

import pickle  # noqa: TID251  (agents refuse it)
import re
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest

from experiments.other_robots.models import ROBOTS, SIDES, write_model
from jmm_agent import (
    Agent,
    AgentError,
    AgentOptions,
    GuardOptions,
    MotorControl,
    RobotScales,
    SensorReadings,
)
from kengoro import Recording, UsageError, make_agent, write_study
from kengoro.agents import scales_of
from kengoro.robots import sample_postures


@pytest.fixture(scope="module")
def maps(request: pytest.FixtureRequest) -> Path:
    return Path(request.config.cache.mkdir("maps"))


@pytest.fixture(scope="module")
def finger(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_model("planar-finger", tmp_path_factory.mktemp("model"))


def agent_of(scene: Path, maps: Path, **more: object) -> Agent:
    sides = {0: SIDES["planar-finger"]}
    return make_agent(scene=scene, **{"marker_sides": sides, "cache": maps, **more})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("robot", "length", "limit"),
    [
        ("planar-finger", 0.15, 60.0),  # its motors' limit stands in the file
        ("docs-arm", 1.27, 137.0),
        ("pulley-finger", 0.34, 217.0),
        ("neck", 0.72, 78.5),
        ("double-arm", 2.0, 4000.0),
    ],
)
def test_scales_derive_from_the_robot(
    robot: str, length: float, limit: float, tmp_path: Path
) -> None:
    scales = scales_of(write_model(robot, tmp_path), marker_sides={0: SIDES[robot]})
    assert scales.ratios["length"] == pytest.approx(length, rel=0.02)
    assert scales.motors.limit == pytest.approx(limit, rel=0.02)
    options = scales.agent_options()
    assert options.vision.saturation == pytest.approx(0.9 * scales.motors.limit, rel=1e-3)
    assert options.prior.offset == pytest.approx(0.025 * scales.ratios["length"])
    assert set(SIDES) == set(ROBOTS)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"postures": np.zeros((3, 3))}, r"postures .* of shape \(N, 2\).*; got shape \(3, 3\)"),
        ({"postures": np.zeros((0, 2))}, r"of shape \(N, 2\); got shape \(0, 2\)"),
        ({"postures": np.full((3, 2), np.nan)}, "postures must be finite angles"),
        ({"postures": "many"}, "postures must be finite angles"),
        ({"camera": "eye"}, r"camera is 'eye', but must be a Camera; AgentOptions\(camera="),
        ({"marker_sides": 0.05}, "marker_sides is 0.05, but must be a Mapping"),
        ({"motors": (1, 2, 3)}, r"motors is \(1, 2, 3\), but must be a MotorControl"),
        ({"seed": "a"}, "The seed is 'a', but seeds are integers"),
        ({"seed": 1.5}, "The seed is 1.5, but seeds are integers"),
    ],
)
def test_arguments_of_another_type_or_shape_are_named(
    finger: Path, maps: Path, wrong: dict[str, object], message: str
) -> None:
    with pytest.raises(UsageError, match=message):
        agent_of(finger, maps, **wrong)


def test_a_marker_that_no_joint_moves_is_named(finger: Path, maps: Path, tmp_path: Path) -> None:
    path = tmp_path / "fixed.xml"
    text = finger.read_text().replace('"marker_hand"', '"tag"')
    path.write_text(text.replace("<camera", '<site name="marker_hand" pos="0.1 0 0"/><camera'))
    with pytest.raises(AgentError, match="No joint moves the marker 'marker_hand' in the frame of"):
        agent_of(path, maps)


def test_a_model_without_a_camera_has_scales(finger: Path, tmp_path: Path) -> None:
    path = tmp_path / "blind.xml"
    path.write_text(re.sub(r"<camera.*?/>", "", finger.read_text()))
    blind = scales_of(path, options=AgentOptions(camera=""))
    seen = scales_of(finger, marker_sides={0: SIDES["planar-finger"]})
    assert blind.travel == seen.travel
    assert blind.reach == pytest.approx(seen.reach)  # the finger's camera is fixed in the world
    assert (blind.distance, blind.focal) == (RobotScales.distance, RobotScales.focal)


def test_motors_that_are_given_are_used(finger: Path, maps: Path) -> None:
    agent = agent_of(finger, maps, motors=MotorControl(5000.0, 1.0, 20.0), guard=True)
    assert agent.options.vision.saturation == pytest.approx(18.0)


def test_a_posture_that_cannot_be_held_is_named_before_going_and_logged(
    finger: Path, maps: Path, caplog: pytest.LogCaptureFixture
) -> None:
    weak = agent_of(finger, maps, motors=MotorControl(5000.0, 0.1, 1.0))
    posture = sample_postures(finger, 1)[0]
    assert not weak.reachable(posture)[0].reachable
    weak.go(posture, 1.0)
    assert "is not reachable: muscle" in weak.unreachable
    assert "above the motors' limit of 1 N" in caplog.text
    strong = agent_of(finger, maps)
    strong.go(posture, 1.0)
    assert strong.unreachable == ""


def test_names_of_camera_marker_and_grip_are_options(
    finger: Path, maps: Path, tmp_path: Path
) -> None:
    path = tmp_path / "renamed.xml"
    text = finger.read_text().replace('camera name="eye"', 'camera name="cam0"')
    path.write_text(text.replace('"marker_hand"', '"tag"'))
    with pytest.raises(UsageError, match=r"no camera 'eye'; .*AgentOptions\(camera="):
        agent_of(path, maps)
    with pytest.raises(UsageError, match=r"no site of the hand's marker 'marker_hand'"):
        agent_of(path, maps, options=AgentOptions(camera="cam0"))
    options = AgentOptions(camera="cam0", marker_site="tag", hand_marker=7)
    with pytest.raises(UsageError, match="id 7, but marker_sides has no side of it; it has: 0"):
        agent_of(path, maps, options=options)
    sides = {7: SIDES["planar-finger"]}
    agent = agent_of(
        path,
        maps,
        options=options,
        marker_sides=sides,
        guard=True,
        guard_options=GuardOptions(hand="mcp_flex_1"),
    )
    guard = agent.guard.options  # type: ignore[union-attr]
    assert (guard.eye, guard.hand) == ("cam0", "mcp_flex_1")


def test_an_agent_refuses_to_be_pickled_in_one_sentence(finger: Path, maps: Path) -> None:
    with pytest.raises(AgentError, match="cannot be pickled; write what was learned"):
        pickle.dumps(agent_of(finger, maps))


def test_a_copy_of_an_agent_goes_on_by_itself(finger: Path, maps: Path) -> None:
    agent = agent_of(finger, maps, guard=True)
    lengths = agent.map.lengths(agent.joint_angles)
    readings = [SensorReadings(0.02 * i, lengths, np.full(len(lengths), 5.0)) for i in range(20)]
    for one in readings[:10]:
        agent.step(one)
    twin = deepcopy(agent)
    first = [agent.step(one) for one in readings[10:]]
    assert twin.estimator is not agent.estimator
    np.testing.assert_array_equal([twin.step(one) for one in readings[10:]], first)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("command", np.zeros((3, 5))),
        ("lengths", np.zeros(3)),
        ("tensions", np.full((3, 4), np.nan)),
        ("start", np.zeros(3)),
        ("time", np.zeros(0)),
        ("markers", np.zeros((2, 4, 4))),
    ],
)
def test_a_recording_of_wrong_shapes_is_refused(
    finger: Path, tmp_path: Path, field: str, value: np.ndarray
) -> None:
    arrays = {name: np.zeros((3, 4)) for name in ("command", "lengths", "tensions")}
    recording = {"time": 0.02 * np.arange(3), **arrays, "start": np.zeros(2)} | {field: value}
    with pytest.raises(UsageError, match=r"Recording 0: .* must be finite numbers of shape"):
        write_study(tmp_path, "finger", finger, [Recording(**recording)])

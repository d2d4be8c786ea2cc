"""Kengoro's arm without a marker on its hand: robots, agents, and a loop with a fake detector."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from jmm_agent.options import AgentOptions
from jmm_agent.updaters import VisionOptions
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.marker_detector import MarkerDetector
from kengoro import hand_weights
from kengoro.agents import make_agent
from kengoro.errors import UsageError
from kengoro.robots import CAMERA, CAN, HAND, make_env, shuffled_postures
from kengoro.session import Session
from kengoro.visits import no_visits, rmse_deg, visit
from kengoro_env.departures import NoHandMarker
from tests.kengoro.noisy_hand import NoisyHand, NumberedFrames


def loaded(monkeypatch: pytest.MonkeyPatch, load: Callable[..., Any]) -> None:
    """Let a function take the place of loading the detector of a file."""
    monkeypatch.setattr(hand_weights, "TrainedHandDetector", load)
    monkeypatch.setattr(hand_weights, "KENGORO", "mjcf/kengoro_arm/arm.xml")  # a file that exists


def test_without_a_trained_detector_the_error_names_what_is_missing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(hand_weights, "KENGORO", "hand_detectors/none.zip")
    with pytest.raises(UsageError, match="no trained detector of Kengoro's hand") as caught:
        make_agent(hand="seen")
    assert "\n" not in str(caught.value)


def test_the_trained_detector_is_loaded_where_the_hand_is_seen(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    hand, asked = NoisyHand([]), []

    def load(camera: Camera, path: Path) -> NoisyHand:
        asked.append((camera, path.name))
        return hand

    loaded(monkeypatch, load)
    agent = make_agent(hand="seen")
    assert agent.options.vision.hand == "seen"
    assert agent._observer.frames == ("hand", "eye")
    by_options = make_agent(options=AgentOptions(vision=VisionOptions(hand="seen")))
    assert by_options._observer.frames == ("hand", "eye")
    other = CAMERA.binned(2, 2)
    make_agent(hand=Path("mine.zip"), camera=other)
    assert asked == [(CAMERA, "arm.xml"), (CAMERA, "arm.xml"), (other, "mine.zip")]


def test_with_a_marker_no_detector_is_loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded(monkeypatch, lambda *_: pytest.fail("it was loaded"))
    assert make_agent()._observer.frames == ("marker_hand", "eye")
    assert make_agent(hand="marker").options == make_agent().options
    options = AgentOptions(camera="", vision=VisionOptions(hand="seen"))
    assert make_agent(options=options)._observer.frames is None


def test_the_can_keeps_its_marker(monkeypatch: pytest.MonkeyPatch) -> None:
    agent = make_agent(hand=NoisyHand([]))
    finder: Any = agent._observer._finder
    assert isinstance(finder._detector, MarkerDetector)
    assert list(finder._detector._square_by_id) == [CAN]
    without = make_agent(hand=NoisyHand([]), marker_sides={HAND: 0.05})
    assert without._observer._finder._detector is None  # type: ignore[union-attr]


def test_a_hand_is_marked_or_seen() -> None:
    with pytest.raises(UsageError, match="must be 'marker' or 'seen'"):
        make_agent(hand="touched")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match=r"given as a Path: hand=Path\('mine.zip'\)\.$"):
        make_agent(hand="mine.zip")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="must be 'marker' or 'seen'"):
        make_env("Posture", hand="none")  # type: ignore[arg-type]
    for other in (3, object(), NoisyHand):
        with pytest.raises(UsageError, match="or a detector with frame, detect and shows"):
            make_agent(hand=other)  # type: ignore[arg-type]


def test_the_file_of_a_detector_needs_a_camera() -> None:
    with pytest.raises(UsageError, match=r"detector mine.zip needs a camera, but the options name"):
        make_agent(hand=Path("mine.zip"), options=AgentOptions(camera=""))


ROBOT = """
<mujoco><worldbody><camera name="eye" pos="0 -1 0.2" xyaxes="1 0 0 0 0 1" fovy="60"/>
<body name="arm"><joint name="elbow" axis="0 1 0" range="-60 60"/>
<geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.02"/>
<site name="a2" pos="0.03 0 0.1"/><site name="b2" pos="-0.03 0 0.1"/>
<body name="tool" pos="0 0 0.3"><geom type="sphere" size="0.03"/></body></body>
<site name="a1" pos="0.05 0 -0.2"/><site name="b1" pos="-0.05 0 -0.2"/></worldbody>
<tendon><spatial name="a"><site site="a1"/><site site="a2"/></spatial>
<spatial name="b"><site site="b1"/><site site="b2"/></spatial></tendon></mujoco>
"""


def test_ones_own_robot_needs_a_detector_and_no_marker(tmp_path: Path) -> None:
    scene = tmp_path / "robot.xml"
    scene.write_text(ROBOT)
    with pytest.raises(UsageError, match="trained for this robot"):
        make_agent(scene=scene, hand="seen", cache=tmp_path)
    hand = NoisyHand([], frame="tool")
    agent = make_agent(scene=scene, hand=hand, marker_sides={}, cache=tmp_path)
    assert agent._observer.frames == ("tool", "eye")


def test_the_robot_of_a_seed_loses_its_marker_and_nothing_else() -> None:
    given: list[Any] = []

    def note(name: str, departures: Any, **options: Any) -> None:
        given.append(departures)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("kengoro.robots.gym.make", note)
        for robot in (None, 3):
            make_env("Posture", robot)
            make_env("Posture", robot, hand="seen")
    assert given[1] == (*given[0], NoHandMarker(removed=True))
    assert given[3] == (*given[2], NoHandMarker(removed=True))


@pytest.mark.slow
def test_a_robot_learns_from_a_hand_that_is_seen_with_errors() -> None:
    """Posture errors fall to a third; outliers are not learned, and misses cost no more."""
    env = NumberedFrames("Posture", 1)
    hand = NoisyHand(env.poses, position=0.004, outliers=0.05, missed=0.05, seed=1)
    agent = make_agent(1, hand=hand)
    postures = shuffled_postures(1)
    session = Session(env, agent, 1, None, {"posture": postures[0], "target": postures[0]})
    tested = postures[40:44]

    def error() -> float:
        agent.learning = False
        visits = no_visits()
        for target in tested:
            visit(session, target, visits)
        agent.learning = True
        return float(np.mean(rmse_deg(visits, "target_true")))

    before = error()
    for target in postures[1:15]:
        visit(session, target)
    assert error() < before / 3.0
    for found in agent.vision.memory.observations:
        distances = [np.linalg.norm(found.pose[:3, 3] - pose[:3, 3]) for pose in env.poses]
        assert min(distances) < 5.0 * hand.depth * hand.position
    assert env.unwrapped.robot.model.geom("marker_plate").rgba[3] == 0.0  # type: ignore[attr-defined]
    env.close()

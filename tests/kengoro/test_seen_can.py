"""Kengoro's can without a marker: environments, agents, and its place in frames of the robot."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.grasping import GraspPlanner
from jmm_agent.options import AgentOptions
from jmm_agent.types import Floats
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.can_finder import CanDetection, CanFinder, CanSkip
from jmm_agent.vision.can_shape import CanShape
from jmm_agent.vision.marker_detector import MarkerDetector
from kengoro.agents import make_agent
from kengoro.errors import UsageError
from kengoro.hand_search import READY
from kengoro.robots import CAMERA, CAN, HAND, SIDES, make_env
from kengoro.session import Session
from kengoro_env.departures import NoCanMarker, NoHandMarker
from kengoro_env.names import GROUP_JOINTS
from kengoro_env.tasks.can_grasp import CAN_AREA
from tests.kengoro.noisy_hand import NoisyHand

GRASPED = 0.010
"""Error of the can's place that a grasp allows [m]."""
UPPER, MARKER = 0.0575, 0.0585
"""Height of the can's upper end and of its marker above its middle [m]."""
NECKS = ((-0.10, 0.42), (0.0, 0.48), (0.06, 0.55))
"""Yaw and pitch of the neck from which the can is in view [rad]."""


class View(NamedTuple):
    """A frame, the camera that took it, and in its axes the can's middle and the vertical (3,)."""

    frame: np.ndarray
    camera: Camera
    middle: Floats
    up: Floats


@cache
def views(can: str) -> tuple[View, ...]:
    """Frames of cans all over the area, from some postures of the neck."""
    found = []
    env = make_env("CanGrasp", None, hand="seen", can=can)  # type: ignore[arg-type]
    for number, x in enumerate(np.linspace(*CAN_AREA[0], 3)):
        for y in np.linspace(*CAN_AREA[1], 4):
            posture = np.array(READY)
            posture[:2] = NECKS[number]
            found.append(taken(env, posture, np.array([x, y])))
    env.close()
    return tuple(found)


def taken(env: Any, posture: Floats, position: Floats) -> View:
    options = {"posture": posture, "can": position}
    observation, truth = env.reset(seed=0, options=options)
    eye = env.unwrapped.robot.data.camera("eye")
    axes = eye.xmat.reshape(3, 3) @ np.diag([1.0, -1.0, -1.0])
    middle = axes.T @ (truth["can_pose"][:3, 3] - eye.xpos)
    return View(observation["frame"].copy(), CAMERA, middle, axes[2].copy())


def errors(seen: list[tuple[View, CanDetection | CanSkip]]) -> Floats:
    """Errors of the places of the upper ends [m]; NaN where there is none."""
    rows = []
    for view, found in seen:
        top = view.middle + UPPER * view.up
        missed = isinstance(found, CanSkip)
        rows.append(np.nan if missed else np.linalg.norm(found.pose_can_in_camera[:3, 3] - top))
    return np.array(rows)


def test_the_can_is_found_all_over_its_area() -> None:
    finder = CanFinder(CAMERA)
    wrong = errors([(view, finder.detect(view.frame, view.up)) for view in views("seen")])
    assert np.isfinite(wrong).all()
    assert np.median(wrong) < 0.3 * GRASPED
    assert wrong.max() < GRASPED


def test_the_marker_is_there_on_the_same_frames_and_gone_without_it() -> None:
    detector = MarkerDetector(CAMERA, {CAN: SIDES[CAN]})
    for marked, seen in zip(views("marker"), views("seen"), strict=True):
        pose = detector.detect(marked.frame).poses[CAN].pose_marker_in_camera
        position = marked.middle + MARKER * marked.up
        assert np.linalg.norm(pose[:3, 3] - position) < GRASPED
        assert CAN not in detector.detect(seen.frame).poses


@pytest.mark.parametrize("light", [0.1, 0.5, 1.4])
def test_the_can_is_found_in_other_light_and_noise(light: float) -> None:
    rng, finder, seen = np.random.default_rng(0), CanFinder(CAMERA), []
    for view in views("seen")[::3]:
        frame = light * view.frame + rng.normal(0.0, 1.0 + 8.0 * light, view.frame.shape)
        frame = np.clip(np.rint(frame), 0, 255).astype(np.uint8)
        seen.append((view, finder.detect(frame, view.up)))
    wrong = errors(seen)
    assert np.isfinite(wrong).all()
    assert wrong.max() < GRASPED


def test_a_can_behind_the_hand_has_a_right_pose_or_none() -> None:
    """The hand comes to the can, and then hides it more and more."""
    planner = GraspPlanner(make_agent().kinematics, "eye", GROUP_JOINTS["neck"])
    can, ready = np.eye(4), np.array(READY)
    can[:3, 3] = 0.40, -0.15, -0.264
    offsets = [(-0.06, 0.0, 0.1), (-0.1, 0.05, 0.1), (-0.12, 0.0, 0.14)]
    postures = [*planner.plan(can, ready).approach]
    postures += [planner.hover(can, np.array(offset), ready) for offset in offsets]
    env, finder = make_env("CanGrasp", None, hand="seen", can="seen"), CanFinder(CAMERA)
    outcomes = []
    for posture in postures:
        posture[:2] = postures[0][:2]
        view = taken(env, posture, can[:2, 3])
        outcomes.append((view, finder.detect(view.frame, view.up)))
    env.close()
    wrong = errors(outcomes)
    assert np.isfinite(wrong[0])
    assert np.all(wrong[np.isfinite(wrong)] < GRASPED)
    hidden = [found for _, found in outcomes if isinstance(found, CanSkip)]
    assert set(hidden) == {CanSkip.HIDDEN}


def test_a_can_is_marked_or_seen() -> None:
    for wrong in ("touched", 3):
        with pytest.raises(UsageError, match=r"must be 'marker', 'seen', or the jmm_agent\.Can"):
            make_agent(can=wrong)  # type: ignore[arg-type]
        with pytest.raises(UsageError, match="must be 'marker' or 'seen'"):
            make_env("CanGrasp", can=wrong)  # type: ignore[arg-type]
    with pytest.raises(AgentError, match="must be 'marker' or 'seen'"):
        AgentOptions(can="touched")  # type: ignore[arg-type]


def test_the_robot_of_a_seed_loses_its_markers_and_nothing_else() -> None:
    given: list[Any] = []

    def note(name: str, departures: Any, **options: Any) -> None:
        given.append(departures)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("kengoro.robots.gym.make", note)
        make_env("CanGrasp", 3)
        make_env("CanGrasp", 3, can="seen")
        make_env("CanGrasp", 3, hand="seen", can="seen")
    gone = NoCanMarker(removed=True)
    assert given[1] == (*given[0], gone)
    assert given[2] == (*given[0], NoHandMarker(removed=True), gone)


@pytest.mark.slow
def test_a_seen_can_takes_its_marker_from_the_detector() -> None:
    agent: Any = make_agent(can="seen")
    assert agent.options.can == "seen"
    assert list(agent._observer._finder._detector._square_by_id) == [HAND]
    nothing: Any = make_agent(hand=NoisyHand([]), can="seen")
    assert nothing._observer._finder._detector is None
    assert make_agent(can="marker").options == make_agent().options


def test_the_shape_of_a_can_is_an_option() -> None:
    shape = CanShape(radius=0.04, hue=120.0)
    for agent in (
        make_agent(can=shape),
        make_agent(options=AgentOptions(can="seen", can_shape=shape)),
    ):
        assert (agent.options.can, agent.options.can_shape) == ("seen", shape)
        assert agent._can is not None
        assert agent._can.shape == shape


def test_a_robot_without_a_camera_has_no_finder() -> None:
    agent = make_agent(options=AgentOptions(camera="", can="seen"))
    assert agent._can is None


@pytest.fixture(params=["marker", "seen"])
def session(request: pytest.FixtureRequest) -> Iterator[Session]:
    agent = make_agent(can=request.param, learning=False)
    env = make_env("CanGrasp", None, can=request.param)
    yield Session(env, agent, 0, None, {"posture": np.array(READY), "can": np.array([0.42, -0.15])})
    env.close()


def test_an_agent_detects_its_can_by_either_kind(session: Session) -> None:
    session.wait(0.6)
    found = session.agent.detect_can(session.readings)
    assert isinstance(found, CanDetection)
    pose = session.agent.kinematics.pose("eye", session.agent.joint_angles)
    position = (pose @ found.pose_can_in_camera)[:3, 3]
    top = session.truth["can_pose"][:3, 3] + (0.0, 0.0, UPPER)
    assert np.linalg.norm(position - top) < 2 * GRASPED  # the camera's place is an estimate
    empty = session.readings._replace(frame=None)
    if session.agent.options.can == "seen":
        assert session.agent.detect_can(empty) is CanSkip.NO_FRAME

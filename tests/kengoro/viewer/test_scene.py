"""What is shown is true: colours, marks, curves, and a scene that leaves the robot alone."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest

from jmm_agent.agent import AgentOptions
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from kengoro.viewer.scene import (
    BELIEVED,
    FULL_TENSION,
    MOST_POINTS,
    SEEN,
    Curves,
    Marks,
    Panel,
    Scene,
    Story,
    add_marks,
    muscle_colours,
    place_outside_camera,
)
from kengoro.visits import grip
from kengoro_env.assets import asset_path
from kengoro_env.departures import TendonStretch
from kengoro_env.env import OUTSIDE
from kengoro_env.names import JOINTS
from kengoro_env.postures import posture_set
from kengoro_env.robot.robot import Robot

ARM = asset_path("mjcf/kengoro_arm/arm.xml")
POSTURE = posture_set()[0]


@pytest.fixture(scope="module")
def robot() -> Robot:
    robot = Robot(asset_path("mjcf/kengoro_arm/posture.xml"), [TendonStretch(1e-5)])
    robot.reset(POSTURE, np.random.default_rng(0))
    return robot


def test_wires_go_from_yellow_to_red_and_stay_red() -> None:
    colours = muscle_colours(np.array([0.0, FULL_TENSION / 2, FULL_TENSION, 3 * FULL_TENSION]))
    assert colours.shape == (4, 4)
    np.testing.assert_allclose(colours[0], [1, 1, 0, 1], atol=0.01)
    assert 0.4 < colours[1, 1] < 0.6
    np.testing.assert_allclose(colours[2:], [[1, 0, 0, 1]] * 2, atol=0.01)


def new_scene(room: int) -> mujoco.MjvScene:
    return mujoco.MjvScene(mujoco.MjModel.from_xml_string("<mujoco/>"), room)


def test_marks_stand_where_the_hand_is_believed_and_seen() -> None:
    believed, seen, then = np.eye(3)
    scene = new_scene(10)
    add_marks(scene, Marks(believed))
    assert scene.ngeom == 1
    np.testing.assert_allclose(scene.geoms[0].pos, believed)
    assert scene.geoms[0].type == mujoco.mjtGeom.mjGEOM_BOX
    scene.ngeom = 0
    add_marks(scene, Marks(believed, seen, then))
    assert scene.ngeom == 3
    np.testing.assert_allclose(scene.geoms[1].pos, seen)
    np.testing.assert_allclose(scene.geoms[2].pos, (seen + then) / 2, atol=1e-6)
    for geom, colour in zip(scene.geoms[:3], (BELIEVED, SEEN, SEEN), strict=True):
        assert "#" + "".join(f"{round(255 * c):02x}" for c in geom.rgba[:3]) == colour


def test_a_full_scene_takes_no_more_marks() -> None:
    scene = new_scene(1)
    add_marks(scene, Marks(np.zeros(3), np.ones(3), np.zeros(3)))
    assert scene.ngeom == 1


def session_at(time: float, estimate: np.ndarray, true: np.ndarray, **more: Any) -> Any:
    """What a story reads of a session."""
    agent = SimpleNamespace(
        options=AgentOptions(), seen=None, markers={}, joint_angles=estimate, learning=True
    )
    vars(agent).update(more)
    robot = SimpleNamespace(tensions=np.zeros(36))
    return SimpleNamespace(
        time=time,
        stage="",
        agent=agent,
        truth={"joint_angles": true},
        world=SimpleNamespace(robot=robot),
    )


def test_curves_are_errors_of_the_estimate_against_the_truth_and_what_was_seen() -> None:
    story, off = Story(), POSTURE + np.radians(2.0)
    look = SimpleNamespace(angles=POSTURE, error=np.radians(np.full(len(POSTURE), 3.0)))
    for step in range(1, 11):
        seen = {"seen": look} if step >= 4 else {}
        story.note(session_at(0.02 * step, off, POSTURE, **seen))
    curves = story.curves()
    np.testing.assert_allclose(curves.time, [0.02, 0.12])  # one in 0.1 s
    np.testing.assert_allclose(curves.true_deg, 2.0)
    np.testing.assert_allclose(curves.true_mm, 1e3 * np.linalg.norm(grip(off) - grip(POSTURE)))
    np.testing.assert_allclose(curves.observation_time, [0.08])  # each look once
    np.testing.assert_allclose(curves.seen_deg, [3.0])
    at_look = grip(POSTURE + look.error)
    np.testing.assert_allclose(curves.seen_mm, [1e3 * np.linalg.norm(at_look - grip(POSTURE))])


def test_long_curves_are_thinned() -> None:
    story = Story()
    for step in range(3 * MOST_POINTS):
        story.note(session_at(0.2 * step, POSTURE, POSTURE))
    assert MOST_POINTS / 2 <= len(story.curves().time) <= MOST_POINTS


def test_the_hand_is_seen_from_where_the_head_is_believed_to_be() -> None:
    """A marker seen right where it is believed to be has both marks at one place."""
    story, kinematics = Story(), ArmKinematics(ARM, JOINTS)
    expected = kinematics.pose("marker_hand", POSTURE, relative_to="eye")
    shifted = expected.copy()
    shifted[:3, 3] += [0.0, 0.0, 0.1]
    options = AgentOptions()
    for pose, off in ((expected, 0.0), (shifted, 0.1)):
        look = SimpleNamespace(angles=POSTURE, error=np.zeros(len(POSTURE)))
        markers = {options.hand_marker: SimpleNamespace(pose_marker_in_camera=pose)}
        session = session_at(1.0, POSTURE, POSTURE, seen=look, markers=markers)
        story.note(session)
        marks = story.moment(session).marks
        assert marks.seen is not None
        assert marks.believed_then is not None
        np.testing.assert_allclose(marks.believed, kinematics.pose("marker_hand", POSTURE)[:3, 3])
        assert np.linalg.norm(marks.seen - marks.believed_then) == pytest.approx(off, abs=1e-9)


def test_a_moment_tells_what_the_robot_does() -> None:
    story = Story()
    session = session_at(1.0, POSTURE, POSTURE)
    assert story.moment(session).doing == "learns"
    session.agent.learning = False
    assert "learning is off" in story.moment(session).doing
    session.stage = "approach 2"
    assert story.moment(session).doing == "approach 2"
    assert story.moment(session).marks.seen is None
    assert story.moment(session).observation_time is None


def test_the_scene_is_a_copy_with_coloured_wires(robot: Robot) -> None:
    model, before = robot.model, robot.model.tendon_rgba.copy()
    state = robot.data.qpos.copy(), robot.data.wrap_xpos.copy()
    scene = Scene(model, robot.muscles, 160, 120)
    moment = Story().moment(session_at(0.0, POSTURE, POSTURE))
    pictures = []
    for tension in (0.0, FULL_TENSION):
        scene.follow(robot.data, moment._replace(tensions=np.full(len(robot.muscles), tension)))
        pictures.append(scene.draw(moment.marks).astype(int))
    scene.close()
    assert pictures[0].shape == (120, 160, 3)
    assert pictures[0].mean() > 50
    redder = pictures[1] - pictures[0]
    changed = redder[np.abs(redder).max(axis=2) > 30]
    assert len(changed) > 50
    assert np.all(changed[:, 1] < 0)  # yellow loses its green
    np.testing.assert_array_equal(model.tendon_rgba, before)
    np.testing.assert_array_equal(robot.data.qpos, state[0])
    np.testing.assert_array_equal(robot.data.wrap_xpos, state[1])


def test_what_is_wound_up_of_a_wire_has_no_length(robot: Robot) -> None:
    scene = Scene(robot.model, robot.muscles)
    scene.follow(robot.data, Story().moment(session_at(0.0, POSTURE, POSTURE)))
    muscle = robot.model.tendon(robot.muscles[0]).id
    for data, wound_up in ((robot.data, True), (scene.data, False)):
        end, guide = data.wrap_xpos.reshape(-1, 3)[data.ten_wrapadr[muscle] :][:2]
        assert (np.linalg.norm(end - guide) > 0.01) == wound_up


def test_a_moved_view_begins_where_the_camera_outside_is(robot: Robot) -> None:
    camera, outside = mujoco.MjvCamera(), robot.data.camera(OUTSIDE)
    place_outside_camera(camera, robot.data)
    scene = mujoco.MjvScene(robot.model, 1000)
    options, nothing = mujoco.MjvOption(), mujoco.MjvPerturb()
    mujoco.mjv_updateScene(
        robot.model, robot.data, options, nothing, camera, mujoco.mjtCatBit.mjCAT_ALL, scene
    )
    detector = scene.camera[0].pos + scene.camera[1].pos
    np.testing.assert_allclose(detector / 2, outside.xpos, atol=1e-3)
    np.testing.assert_allclose(
        scene.camera[0].forward, -outside.xmat.reshape(3, 3)[:, 2], atol=0.01
    )


def test_the_panel_shows_the_curves() -> None:
    panel, none = Panel(), np.zeros(0)
    empty = panel.draw(Curves(none, none, none, none, none, none))
    times = np.linspace(0.0, 5.0, 20)
    full = panel.draw(Curves(times, 10 - times, 100 - times, times[:3], times[:3], times[:3]))
    assert empty.shape == full.shape == (600, 460, 3)
    assert (empty != full).any(axis=2).sum() > 500

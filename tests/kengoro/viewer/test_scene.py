"""The scene: muscle colours, marks, the outside camera, and a robot that it does not change."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from kengoro.viewer.history import Marks
from kengoro.viewer.scene import (
    ESTIMATED_COLOUR,
    FULL_TENSION,
    SEEN_COLOUR,
    Scene,
    add_marks,
    match_outside_camera,
    muscle_colours,
)
from kengoro_env.assets import asset_path
from kengoro_env.departures import TendonStretch
from kengoro_env.env import OUTSIDE
from kengoro_env.postures import posture_set
from kengoro_env.robot.robot import Robot

POSTURE = posture_set()[0]


@pytest.fixture(scope="module")
def robot() -> Robot:
    robot = Robot(asset_path("mjcf/kengoro_arm/posture.xml"), [TendonStretch(1e-5)])
    robot.reset(POSTURE, np.random.default_rng(0))
    return robot


def test_muscles_turn_from_yellow_to_red_and_stay_red() -> None:
    colours = muscle_colours(np.array([0.0, FULL_TENSION / 2, FULL_TENSION, 3 * FULL_TENSION]))
    assert colours.shape == (4, 4)
    np.testing.assert_allclose(colours[0], [1, 1, 0, 1], atol=0.01)
    assert 0.4 < colours[1, 1] < 0.6
    np.testing.assert_allclose(colours[2:], [[1, 0, 0, 1]] * 2, atol=0.01)


def empty_scene(max_geoms: int) -> mujoco.MjvScene:
    return mujoco.MjvScene(mujoco.MjModel.from_xml_string("<mujoco/>"), max_geoms)


def test_marks_are_at_the_estimated_and_the_seen_position() -> None:
    estimated, seen, then = np.eye(3)
    scene = empty_scene(10)
    add_marks(scene, Marks(estimated))
    assert scene.ngeom == 1
    np.testing.assert_allclose(scene.geoms[0].pos, estimated)
    assert scene.geoms[0].type == mujoco.mjtGeom.mjGEOM_BOX
    scene.ngeom = 0
    add_marks(scene, Marks(estimated, seen, then))
    assert scene.ngeom == 3
    np.testing.assert_allclose(scene.geoms[1].pos, seen)
    np.testing.assert_allclose(scene.geoms[2].pos, (seen + then) / 2, atol=1e-6)
    colours = (ESTIMATED_COLOUR, SEEN_COLOUR, SEEN_COLOUR)
    for geom, colour in zip(scene.geoms[:3], colours, strict=True):
        assert "#" + "".join(f"{round(255 * c):02x}" for c in geom.rgba[:3]) == colour


def test_a_full_scene_takes_no_more_marks() -> None:
    scene = empty_scene(1)
    add_marks(scene, Marks(np.zeros(3), np.ones(3), np.zeros(3)))
    assert scene.ngeom == 1


def test_the_scene_is_a_copy_with_coloured_muscles(robot: Robot) -> None:
    model, before = robot.model, robot.model.tendon_rgba.copy()
    state = robot.data.qpos.copy(), robot.data.wrap_xpos.copy()
    scene = Scene(model, robot.muscles, 160, 120)
    marks = Marks(robot.data.site("marker_hand").xpos)
    pictures = []
    for tension in (0.0, FULL_TENSION):
        scene.update(robot.data, np.full(len(robot.muscles), tension))
        pictures.append(scene.draw(marks).astype(int))
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


def test_the_part_of_a_tendon_before_its_guide_has_no_length_in_the_scene(robot: Robot) -> None:
    scene = Scene(robot.model, robot.muscles)
    scene.update(robot.data, np.zeros(len(robot.muscles)))
    tendon = robot.model.tendon(robot.muscles[0]).id
    for data, has_length in ((robot.data, True), (scene.data, False)):
        end, guide = data.wrap_xpos.reshape(-1, 3)[data.ten_wrapadr[tendon] :][:2]
        assert (np.linalg.norm(end - guide) > 0.01) == has_length


def test_a_free_camera_starts_with_the_view_of_the_outside_camera(robot: Robot) -> None:
    camera, outside = mujoco.MjvCamera(), robot.data.camera(OUTSIDE)
    match_outside_camera(camera, robot.data)
    scene = mujoco.MjvScene(robot.model, 1000)
    options, perturbation = mujoco.MjvOption(), mujoco.MjvPerturb()
    mujoco.mjv_updateScene(
        robot.model, robot.data, options, perturbation, camera, mujoco.mjtCatBit.mjCAT_ALL, scene
    )
    centre = (
        scene.camera[0].pos + scene.camera[1].pos
    ) / 2  # between both cameras of a stereo pair
    np.testing.assert_allclose(centre, outside.xpos, atol=1e-3)
    np.testing.assert_allclose(
        scene.camera[0].forward, -outside.xmat.reshape(3, 3)[:, 2], atol=0.01
    )

"""A can without a marker: it moves as with it to the bit, and frames show a round can."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from kengoro_env.assets import asset_path
from kengoro_env.departures import NoCanMarker, NoHandMarker, actual
from kengoro_env.departures.bodies import CAN_SIDES
from kengoro_env.postures import posture_set
from kengoro_env.robot.draft import Departure
from kengoro_env.robot.nominal_model import NominalArm
from kengoro_env.robot.robot import Robot

SCENE = asset_path("mjcf/kengoro_arm/can_grasp.xml")
GONE = NoCanMarker(removed=True)
START, GOAL = posture_set()[[0, 5]]


def motion(*chosen: Departure) -> list[bytes]:
    """All that robot and can do and measure in a movement, the can falling over, as bytes."""
    arm = Robot(SCENE, chosen)
    arm.reset(START, np.random.default_rng(0))
    start, goal = NominalArm(SCENE).lengths(np.array([START, GOAL]))
    arm.data.joint("can").qvel[:] = (0.3, 0.1, 0.0, 3.0, 6.0, 1.0)
    rows = []
    for step in range(1, 41):
        arm.step(start + min(1.0, step / 25) * (goal - start))
        rows += [arm.data.qpos.tobytes(), arm.data.qvel.tobytes(), arm.measured_lengths().tobytes()]
        rows.append(arm.measured_tensions().tobytes())
    return rows


@pytest.mark.parametrize("robot", [(), actual(0)], ids=["nominal", "actual"])
def test_robot_and_can_move_as_with_the_marker_to_the_bit(robot: tuple[Departure, ...]) -> None:
    assert motion(*robot, GONE) == motion(*robot)


def test_what_is_seen_of_the_can_has_no_marker_and_is_round() -> None:
    usual, without = Robot(SCENE).model, Robot(SCENE, (GONE,)).model
    seen = [geom for geom in range(without.ngeom) if without.geom_rgba[geom, 3] > 0.0]
    can = [geom for geom in seen if without.geom_bodyid[geom] == without.body("can").id]
    assert len(can) == 3
    for geom in can:
        assert without.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH
        assert without.geom_contype[geom] == without.geom_conaffinity[geom] == 0
        assert without.mesh_vertnum[without.geom_dataid[geom]] == 2 * CAN_SIDES
    materials = {without.geom_matid[geom] for geom in can}
    assert materials == {without.material("can").id, without.material("tin").id}
    assert without.body_mass.tobytes() == usual.body_mass.tobytes()
    assert without.body_inertia.tobytes() == usual.body_inertia.tobytes()


def view(*chosen: Departure) -> np.ndarray:
    """The can from above, away from the arm."""
    arm = Robot(SCENE, chosen)
    arm.reset(START, np.random.default_rng(0))
    arm.data.joint("can").qpos[:2] = (0.65, -0.45)
    mujoco.mj_forward(arm.model, arm.data)
    camera = mujoco.MjvCamera()
    camera.lookat, camera.distance = arm.data.body("can").xpos, 0.3
    camera.azimuth, camera.elevation = 90.0, -89.0
    with mujoco.Renderer(arm.model, 240, 320) as renderer:
        renderer.update_scene(arm.data, camera)
        return np.array(renderer.render())


def test_no_frame_shows_the_marker() -> None:
    """The black squares of the marker are gone; tin and paint are not black."""
    usual, without = view(), view(GONE)
    middle = np.s_[100:140, 140:180]
    assert usual[middle].min() < 40
    assert without[middle].min() > 100


def test_both_markers_can_be_removed_and_a_scene_without_a_can_stays_as_it_is() -> None:
    both = Robot(SCENE, (NoHandMarker(removed=True), GONE)).model
    for name in ("marker_plate", "marker_can_plate"):
        assert both.geom(name).rgba[3] == 0.0
    posture = asset_path("mjcf/kengoro_arm/posture.xml")
    usual, same = Robot(posture).model, Robot(posture, (GONE,)).model
    assert np.array_equal(usual.geom_rgba, same.geom_rgba)
    assert usual.ngeom == same.ngeom

"""A hand without a marker: the same robot to the bit, and no marker in its frames."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from kengoro_env.assets import asset_path
from kengoro_env.departures import MarkerError, NoHandMarker, actual
from kengoro_env.postures import posture_set
from kengoro_env.robot.draft import Departure
from kengoro_env.robot.nominal_model import NominalArm
from kengoro_env.robot.robot import Robot

ARM = asset_path("mjcf/kengoro_arm/posture.xml")
GONE = NoHandMarker(removed=True)
START, GOAL = posture_set()[[0, 5]]


def motion(*chosen: Departure) -> list[bytes]:
    """All that the robot does and measures in a movement, as bytes."""
    arm = Robot(ARM, chosen)
    arm.reset(START, np.random.default_rng(0))
    start, goal = NominalArm(ARM).lengths(np.array([START, GOAL]))
    rows = []
    for step in range(1, 61):
        arm.step(start + min(1.0, step / 25) * (goal - start))
        rows += [arm.data.qpos.tobytes(), arm.data.qvel.tobytes(), arm.measured_lengths().tobytes()]
        rows.append(arm.measured_tensions().tobytes())
    return rows


@pytest.mark.parametrize("robot", [(), actual(0)], ids=["nominal", "actual"])
def test_the_robot_moves_as_with_the_marker_to_the_bit(robot: tuple[Departure, ...]) -> None:
    assert motion(*robot, GONE) == motion(*robot)


def test_only_the_colour_of_the_plate_differs() -> None:
    """Every array of the model is the same but the colour and the material of one geom."""
    usual, without = Robot(ARM).model, Robot(ARM, (GONE,)).model
    plate, differs = usual.geom("marker_plate").id, set()
    for name in dir(usual):
        one = getattr(usual, name)
        if isinstance(one, np.ndarray) and not np.array_equal(one, getattr(without, name)):
            differs.add(name)
    assert differs == {"geom_rgba", "geom_matid"}
    others = np.arange(usual.ngeom) != plate
    assert np.array_equal(usual.geom_rgba[others], without.geom_rgba[others])
    assert without.geom_rgba[plate, 3] == 0.0


def view(*chosen: Departure) -> np.ndarray:
    """What the camera in the head sees of the hand at a posture."""
    arm = Robot(ARM, chosen)
    arm.reset(START, np.random.default_rng(0))
    with mujoco.Renderer(arm.model, 480, 640) as renderer:
        renderer.update_scene(arm.data, "eye")
        return np.array(renderer.render())


def test_no_frame_shows_the_marker() -> None:
    usual, without, moved = view(), view(GONE), view(GONE, MarkerError(position=0.05, seed=1))
    assert np.any(usual != without)
    assert np.array_equal(without, moved)


def test_a_scene_without_a_marker_stays_as_it_is() -> None:
    spec = mujoco.MjSpec.from_string("<mujoco><worldbody/></mujoco>")

    class Bare:
        pass

    bare = Bare()
    bare.spec = spec  # type: ignore[attr-defined]
    GONE.edit(bare)  # type: ignore[arg-type]
    assert spec.to_xml() == mujoco.MjSpec.from_string("<mujoco><worldbody/></mujoco>").to_xml()

"""The posture set meets the conditions of its docstring, and covers a wide range of angles."""

import numpy as np
import pytest

from kengoro_env.assets import asset_path
from kengoro_env.departures import AttachmentDisplacement
from kengoro_env.departures.presets import actual
from kengoro_env.names import JOINTS
from kengoro_env.postures import PostureChecker, least_tension, posture_set, postures_within
from kengoro_env.robot.draft import Departure, Draft
from kengoro_env.robot.model_file import load_spec
from kengoro_env.robot.nominal_model import NominalArm
from kengoro_env.robot.robot import Robot

ARM = "mjcf/kengoro_arm/arm.xml"


@pytest.mark.parametrize(
    ("joint", "span"),
    [("sh_pitch", 70), ("sh_roll", 40), ("sh_yaw", 50), ("elbow", 60), ("neck_yaw", 20)],
)
def test_spans(joint: str, span: float) -> None:
    low, high = np.degrees(np.percentile(posture_set()[:, JOINTS.index(joint)], [5, 95]))
    assert high - low >= span


def test_moment_arms() -> None:
    arm = NominalArm(asset_path(ARM))
    arms = np.array([arm.moment_arms(posture) for posture in posture_set()])
    both = np.minimum(arms.max(axis=1), -arms.min(axis=1))
    assert np.all(np.mean(both >= 0.010, axis=0) >= 0.95)


def test_every_twentieth_posture_is_accepted_in_the_nominal_model() -> None:
    checker = PostureChecker()
    assert all(checker.accepts(posture) for posture in posture_set()[::20])


def test_checker_refuses() -> None:
    checker, posture = PostureChecker(), posture_set()[0].copy()
    beyond = posture.copy()
    beyond[JOINTS.index("elbow")] = checker.nominal.upper[JOINTS.index("elbow")]
    assert not checker.inside(beyond)
    away = posture.copy()
    away[JOINTS.index("neck_yaw")] += np.radians(60.0)
    assert not checker.seen(away)


@pytest.mark.parametrize("seed", range(4))
def test_displaced_tendons_hold_gravity(seed: int, tmp_path) -> None:
    displacement = next(d for d in actual(seed) if isinstance(d, AttachmentDisplacement))
    draft = Draft.of(load_spec(asset_path(ARM)))
    displacement.edit(draft)
    path = asset_path(ARM).with_name("arm.xml")
    scene = tmp_path / path.name
    draft.spec.texturedir = str(path.parent / "textures")
    draft.spec.meshdir = str(path.parent / "meshes")
    draft.spec.compile()
    scene.write_text(draft.spec.to_xml())
    arm = NominalArm(scene)
    held = [
        least_tension(arm.moment_arms(posture), arm.gravity(posture)) <= 400.0
        for posture in posture_set()[seed::10]
    ]
    assert np.mean(held) >= 0.99


def test_least_tension_of_a_pulley() -> None:
    """Two tendons on one joint: the agonist carries torque and tension of the antagonist."""
    arms, gravity = np.array([[-0.05], [0.05]]), np.array([-1.0])
    assert least_tension(arms, gravity) == pytest.approx(25.0)
    assert least_tension(arms, gravity, most=20.0) == np.inf


@pytest.mark.parametrize("departures", [(), actual(1)])
def test_all_postures_are_within_the_joint_ranges_of_our_robots(
    departures: tuple[Departure, ...],
) -> None:
    """So that targets are sampled from all of them, in their order."""
    robot = Robot(asset_path(ARM), departures)
    assert np.array_equal(postures_within(robot.lower, robot.upper), posture_set())


def test_postures_within_a_narrower_range_are_those_of_the_set() -> None:
    lower, upper = np.full(14, -np.inf), np.full(14, np.inf)
    elbow = JOINTS.index("elbow")
    upper[elbow] = np.radians(45.0)
    found = postures_within(lower, upper)
    assert 0 < len(found) < len(posture_set())
    assert found[:, elbow].max() <= upper[elbow]
    assert len(found) == np.sum(posture_set()[:, elbow] <= upper[elbow])


def test_postures_are_moved_to_the_limits_where_none_is_within_them() -> None:
    lower, upper = np.full(14, 1.0), np.full(14, 1.5)
    found = postures_within(lower, upper)
    assert found.shape == posture_set().shape
    assert found.min() >= 1.0
    assert found.max() <= 1.5

"""Agents of Kengoro's arm, and of another robot."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from jmm_agent import AgentOptions, Guard, NullGuard, SensorReadings
from kengoro.agents import make_agent
from kengoro_env.departures import EncoderError, TensionSensorError
from kengoro_env.robot.robot import Robot

ARM3 = Path(__file__).parents[2] / "examples" / "arm3.xml"


@pytest.fixture(scope="module")
def maps(request: pytest.FixtureRequest) -> Path:
    return Path(request.config.cache.mkdir("maps"))


@pytest.mark.slow
def test_an_agent_is_guarded_if_asked_for(maps: Path) -> None:
    assert isinstance(make_agent(cache=maps).guard, NullGuard)
    assert isinstance(make_agent(cache=maps, guard=True).guard, Guard)


@pytest.mark.parametrize("scene", [None, ARM3])
def test_an_agent_knows_what_displaced_points_do(maps: Path, scene: Path | None) -> None:
    agent = make_agent(scene=scene, marker_sides={0: 0.05, 1: 0.06}, cache=maps)
    points = agent.vision.forecast.prior.points
    assert points is not None
    for weights, group in zip(points, agent.map.groups, strict=True):
        assert weights.shape[:2] == group.W2.shape
        assert np.abs(weights).max() > 0.0


def test_agents_of_one_seed_command_the_same(maps: Path) -> None:
    first, second = (make_agent(7, cache=maps) for _ in range(2))
    np.testing.assert_array_equal(
        first.map.lengths(first.target), second.map.lengths(second.target)
    )


@pytest.mark.parametrize("guard", [False, True])
def test_an_agent_of_another_robot_needs_no_site_but_the_marker(maps: Path, guard: bool) -> None:
    agent = make_agent(scene=ARM3, marker_sides={0: 0.05}, guard=guard, cache=maps)
    robot = Robot(ARM3, [EncoderError(noise=1e-4), TensionSensorError(noise=1.0)])
    robot.reset(agent.target, np.random.default_rng(0))
    for _ in range(200):
        lengths, tensions = robot.measured_lengths(), robot.measured_tensions()
        robot.step(agent.step(SensorReadings(robot.time, lengths, tensions)))
    assert not agent.faults
    assert np.abs(robot.joint_angles - agent.target).max() < np.radians(5.0)  # it sags


@pytest.mark.parametrize("guard", [False, True])
def test_a_robot_without_a_camera_is_seen_by_a_tracker(
    maps: Path, guard: bool, tmp_path: Path
) -> None:
    blind = tmp_path / "blind.xml"
    seen = r" texturedir=\".*?\"|<camera.*?/>|<asset>.*?</asset>| material=\".*?\""
    blind.write_text(re.sub(seen, "", ARM3.read_text(encoding="utf-8"), flags=re.DOTALL))
    agent = make_agent(scene=blind, options=AgentOptions(camera=""), guard=guard, cache=maps)
    robot = Robot(ARM3, [EncoderError(noise=1e-4), TensionSensorError(noise=1.0)])
    robot.reset(agent.target, np.random.default_rng(0))
    for _ in range(100):
        lengths, tensions = robot.measured_lengths(), robot.measured_tensions()
        robot.step(agent.step(SensorReadings(robot.time, lengths, tensions)))
        pose = np.eye(4)
        pose[:3, 3] = robot.data.site("marker_hand").xpos
        agent.observe(pose, np.diag([1e-6] * 3 + [np.inf] * 3), robot.time)
    assert agent.vision.fired == 1
    assert not agent.faults

"""A stiffness that is set while the arm holds still: agent, session, environment and guard."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from jmm_agent import (
    Agent,
    AgentOptions,
    CommandLimits,
    HeatOptions,
    JointMuscleMap,
    MotorControl,
    MuscleOrder,
    RecordedAgent,
    SensorReadings,
)
from kengoro import Session, make_agent, make_env
from kengoro.robots import NO_END, shuffled_postures
from kengoro.trained_maps import trained_map
from kengoro_env.errors import ArgumentError
from kengoro_env.robot.muscle_law import Gains
from kengoro_env.robot.nominal_model import NominalArm
from kengoro_env.robot.robot import Robot

POSTURE = shuffled_postures(2)[0]
OPTIONS = AgentOptions(camera="", feed_forward=True)

TWO_JOINTS = """<mujoco><compiler autolimits="true"/><worldbody>
<site name="a" pos="-0.04 0 0.05"/><site name="b" pos="-0.04 0 -0.05"/>
<site name="c" pos="-0.02 0 0.04"/>
<body><joint name="near" axis="0 1 0" range="-40 40"/>
<geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.01" mass="0.3"/>
<site name="over" pos="0.06 0 0.03"/><site name="under" pos="0.05 0 -0.03"/>
<body pos="0.2 0 0"><joint name="far" axis="0 1 0" range="-40 40"/>
<geom type="capsule" fromto="0 0 0 0.15 0 0" size="0.01" mass="0.2"/>
<site name="top" pos="0.05 0 0.03"/><site name="low" pos="0.05 0 -0.03"/>
<site name="marker_hand" pos="0.15 0 0"/></body></body></worldbody><tendon>
<spatial name="long_over"><site site="a"/><site site="over"/><site site="top"/></spatial>
<spatial name="long_under"><site site="b"/><site site="under"/><site site="low"/></spatial>
<spatial name="short_over"><site site="c"/><site site="over"/></spatial></tendon></mujoco>"""
"""A robot of two joints and three muscles, two of which cross both joints."""


@pytest.fixture(scope="module")
def nominal_map(request: pytest.FixtureRequest) -> JointMuscleMap:
    return trained_map(request.config.cache.mkdir("maps"))


def session_of(env: Any, agent: Agent, posture: np.ndarray = POSTURE) -> Session:
    return Session(env, agent, 2, None, {"posture": posture, "target": posture})


@pytest.fixture
def env() -> Any:
    made = make_env("Posture", None, max_episode_steps=NO_END, camera=False)
    yield made
    made.close()


def gains_of(env: gym.Env[Any, Any]) -> np.ndarray:
    stiffness: np.ndarray = env.unwrapped.robot.motors.stiffness.copy()  # type: ignore[attr-defined]
    return stiffness


@pytest.mark.parametrize("stiffness", [5_000.0, 45_000.0])
def test_the_arm_holds_its_posture_while_the_motors_change(
    env: Any, nominal_map: JointMuscleMap, stiffness: float
) -> None:
    agent = make_agent(2, jmm=nominal_map, options=OPTIONS, learning=False)
    session = session_of(env, agent)
    session.wait(2.0)
    here = session.truth["joint_angles"]
    np.testing.assert_array_equal(gains_of(env), 30_000.0)
    found = agent.set_stiffness(stiffness)
    assert found.missed == ""
    moved, before = 0.0, gains_of(env)
    for _ in range(150):
        session.step()
        moved = max(moved, float(np.abs(session.truth["joint_angles"] - here).max()))
        now = gains_of(env)
        np.testing.assert_array_equal(now, agent.stiffness)
        assert np.all((now - before) * (stiffness - 30_000.0) >= 0.0)
        before = now
    np.testing.assert_array_equal(before, stiffness)
    assert np.degrees(moved) < 1.0  # without new commands it would sag by 10 deg


def test_without_feed_forward_a_soft_arm_sags(env: Any, nominal_map: JointMuscleMap) -> None:
    options = AgentOptions(camera="", feed_forward=False)
    agent = make_agent(2, jmm=nominal_map, options=options, learning=False)
    session = session_of(env, agent)
    session.wait(1.0)
    agent.set_stiffness(5_000.0)
    session.wait(3.0)
    away = np.degrees(np.abs(session.truth["joint_angles"] - POSTURE))
    assert away.max() > 5.0


def test_it_stays_for_further_episodes_in_which_a_robot_begins_with_its_own(
    env: Any, nominal_map: JointMuscleMap
) -> None:
    agent = make_agent(2, jmm=nominal_map, options=OPTIONS, learning=False)
    session_of(env, agent)
    agent.set_stiffness(8_000.0)
    env.reset(seed=2)
    np.testing.assert_array_equal(gains_of(env), 30_000.0)
    session = session_of(env, agent)
    np.testing.assert_array_equal(gains_of(env), 8_000.0)
    session.step()
    np.testing.assert_array_equal(agent.stiffness, np.full(36, 8_000.0))


def test_guard_and_limits_use_the_stiffness_of_now(env: Any, nominal_map: JointMuscleMap) -> None:
    agent = make_agent(2, jmm=nominal_map, options=OPTIONS, learning=False, guard=True)
    agent.limits = CommandLimits(np.inf, MotorControl())
    session = session_of(env, agent)
    session.wait(1.0)
    agent.set_stiffness(5_000.0)
    session.wait(3.0)
    lengths = session.observation["lengths"]
    limit = agent.limits.motors.limit  # type: ignore[union-attr]
    shortest = agent.guard.limit(lengths - 1.0)
    np.testing.assert_allclose(lengths - shortest, (limit - 30.0) / 5_000.0, atol=2e-3)
    assert agent.faults == []
    motors = agent.limits.with_stiffness(agent.stiffness).motors  # type: ignore[union-attr]
    np.testing.assert_array_equal(motors.gains, 5_000.0)  # type: ignore[union-attr]


def test_a_wanted_joint_is_as_stiff_as_a_push_shows(env: Any, nominal_map: JointMuscleMap) -> None:
    agent = make_agent(2, jmm=nominal_map, options=OPTIONS, learning=False)
    session = session_of(env, agent)
    session.wait(1.5)
    number = nominal_map.joints.index("elbow")
    usual = agent.set_stiffness(30_000.0).joints["elbow"]
    found = agent.set_stiffness({"elbow": 0.4 * usual})
    assert found.joints["elbow"] == pytest.approx(0.4 * usual, rel=0.05)
    session.wait(2.5)
    robot = session.world.robot
    dof = int(robot.model.joint("elbow").dofadr[0])
    angles = []
    for torque in (-0.4, 0.4):
        robot.data.qfrc_applied[dof] = torque
        session.wait(2.5)
        angles.append(float(session.truth["joint_angles"][number]))
    measured = 0.8 / (angles[1] - angles[0])
    assert measured == pytest.approx(found.joints["elbow"], rel=0.25)


def test_a_recorded_change_is_replayed_to_the_bit(env: Any, nominal_map: JointMuscleMap) -> None:
    recorded = RecordedAgent(make_agent(2, jmm=nominal_map, options=OPTIONS, learning=False))
    session = session_of(env, recorded)  # type: ignore[arg-type]
    commands = []
    for step in range(40):
        if step == 10:
            recorded.set_stiffness(12_000.0)
        session.step()
        commands.append(session._command)
    again = make_agent(2, jmm=nominal_map, options=OPTIONS, learning=False)
    np.testing.assert_array_equal(recorded.log.replay(again), commands)


def test_the_environment_takes_a_stiffness_alone_or_with_a_bias(env: Any) -> None:
    world = env.unwrapped
    world.set_stiffness(5_000.0, 20.0)
    world.set_stiffness(np.full(36, 6_000.0))
    np.testing.assert_array_equal(world.robot.motors.bias, 20.0)
    np.testing.assert_array_equal(gains_of(env), 6_000.0)
    for bad in (-1.0, np.nan, np.ones(3), "soft"):
        with pytest.raises(ArgumentError, match="stiffness must be finite"):
            world.set_stiffness(bad)
    made = make_env("Posture", None, camera=False, gains=Gains(stiffness=7_000.0))
    made.reset(seed=0)
    np.testing.assert_array_equal(gains_of(made), 7_000.0)
    made.close()


def test_a_small_soft_robot_holds_its_posture_and_names_what_it_cannot_hold(
    tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    scene = tmp_path / "two.xml"
    scene.write_text(TWO_JOINTS)
    maps = Path(request.config.cache.mkdir("maps"))
    agent = make_agent(scene=scene, cache=maps, options=OPTIONS, learning=False)
    assert agent.motors is not None
    target = np.array([0.1, 0.2])
    robot = Robot(scene, gains=Gains(agent.motors.stiffness, agent.motors.bias, agent.motors.limit))
    robot.reset(target, np.random.default_rng(0))
    agent.go(target, 0.5)
    assert agent.unreachable == ""

    def run(seconds: float) -> np.ndarray:
        for _ in range(round(seconds / robot.control_period)):
            readings = SensorReadings(robot.time, robot.measured_lengths(), robot.tensions)
            command = agent.step(readings)
            if agent.stiffness is not None:
                robot.motors.set_stiffness(agent.stiffness, robot.motors.bias.copy())
            robot.step(command)
        return np.abs(robot.joint_angles - target)

    assert run(2.0).max() < 0.02
    agent.set_stiffness(0.3 * agent.motors.stiffness)
    assert run(3.0).max() < 0.04
    with pytest.raises(ValueError, match="there is no joint 'elbow'; joints are near, far"):
        agent.set_stiffness({"elbow": 1.0})

    arm = NominalArm(scene)
    heavy = make_agent(scene=scene, cache=maps, options=OPTIONS, learning=False)
    heavy.statics, heavy.motors = None, MotorControl(agent.motors.stiffness, 0.01, 0.02)
    heavy.go(target, 0.5)
    assert heavy.unreachable.startswith("The posture cannot be held by the map as learned: no pull")
    assert any(repr(joint) in heavy.unreachable for joint in arm.joints)


def test_heat_limits_tensions_of_motors_with_another_stiffness(
    nominal_map: JointMuscleMap,
) -> None:
    agent = make_agent(2, jmm=nominal_map, options=replace(OPTIONS, heat=HeatOptions()))
    lengths = nominal_map.lengths(POSTURE)
    agent.set_stiffness(3_000.0)
    tensions, bias, warm = np.full(36, 40.0), 30.0, np.full(36, 45.0)
    for step in range(400):
        agent.step(SensorReadings(0.02 * step, lengths, tensions, temperatures=warm))
    assert agent.heat is not None
    limits = agent.heat.tension_limits()
    assert (limits > 2.0 * bias).all()
    command = agent.heat.limit(lengths - 1.0, lengths)
    np.testing.assert_allclose(bias + 3_000.0 * (lengths - command), limits, rtol=1e-9)


def test_motors_get_their_stiffness_in_the_order_of_the_robot(
    nominal_map: JointMuscleMap,
) -> None:
    agent, count = make_agent(2, jmm=nominal_map, options=OPTIONS), len(nominal_map.muscles)
    channels, ones = np.roll(np.arange(count), 1), np.ones(count)
    parts = [channels, channels, channels, ones, ones, ones]
    agent.order = MuscleOrder(nominal_map.muscles, count, *parts)
    wanted = np.linspace(5_000.0, 30_000.0, count)
    agent.set_stiffness(wanted)
    lengths = np.empty(count)
    lengths[channels] = nominal_map.lengths(POSTURE)
    for step in range(400):
        agent.step(SensorReadings(0.02 * step, lengths, np.full(count, 40.0)))
    assert agent.stiffness is not None
    np.testing.assert_allclose(agent.stiffness[channels], wanted)

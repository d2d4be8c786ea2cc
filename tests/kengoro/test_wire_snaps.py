"""A wire that snaps in motion: noticed, left out, and the robot moves on or says why not."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from experiments.other_robots.models import write_model
from jmm_agent import Agent, AgentOptions, NullGuard, SensorReadings
from jmm_agent.guard.faults import MUSCLE_SNAPPED, POSTURE_NOT_HELD, PUSHED
from jmm_agent.types import Floats
from kengoro import Session, make_agent
from kengoro.robots import NO_END, make_env, shuffled_postures
from kengoro_env.departures import MotorInertia, TendonStretch
from kengoro_env.robot.robot import Robot

POSTURES = shuffled_postures(3)[:3]
SNAPPED = 1e3
TENDONS = TendonStretch(compliance=1e-5, hardening=4e6), MotorInertia(1.0)
"""Tendons that go slack, which those of the nominal model do not."""


@pytest.fixture(scope="module")
def maps(request: pytest.FixtureRequest) -> Path:
    return Path(request.config.cache.mkdir("maps"))


def kinds(agent: Agent) -> dict[str, str]:
    return {fault.kind: fault.where for fault in agent.faults}


def snapped(muscle: str, maps: Path, noticed: bool = True) -> tuple[Session, float]:
    """Session in which a muscle snaps in a movement, and the time after which it is named [s]."""
    agent = make_agent(0, guard=True, cache=maps, options=AgentOptions(camera=""))
    if not noticed:
        agent.guard, agent.wiring.watching = NullGuard(), False
    env = gym.make("Kengoro/Posture-v0", departures=TENDONS, camera=False, max_episode_steps=NO_END)
    session = Session(env, agent, 0, None, {"posture": POSTURES[0], "target": POSTURES[0]})
    session.wait(1.0)
    agent.go(POSTURES[1], 1.5)
    session.wait(0.7)
    session.world.robot.elongate(muscle, SNAPPED)
    named, begin = np.inf, session.time
    for _ in range(140):
        session.step()
        assert len({fault.where for fault in agent.faults}) == len(agent.faults)
        if kinds(agent).get(MUSCLE_SNAPPED) == muscle:
            named = min(named, session.time - begin)
    return session, named


def missed_deg(session: Session, posture: Floats) -> float:
    return float(np.degrees(np.sqrt(np.mean((session.truth["joint_angles"] - posture) ** 2))))


@pytest.mark.parametrize("muscle", ["delt_mid", "splenius_right"])
def test_a_muscle_that_others_replace_is_left_out_and_the_arm_stands_where_it_should(
    muscle: str, maps: Path
) -> None:
    session, named = snapped(muscle, maps)
    agent = session.agent
    assert named < 0.5
    assert agent.in_use.left_out == (muscle,)
    assert missed_deg(session, POSTURES[1]) < 1.0
    assert np.degrees(np.abs(agent.joint_angles - session.truth["joint_angles"]).max()) < 3.0
    blind, _ = snapped(muscle, maps, noticed=False)
    assert missed_deg(blind, POSTURES[1]) > 2.0 * missed_deg(session, POSTURES[1])
    agent.go(POSTURES[2], 1.5)
    session.wait(3.0)
    assert agent.unreachable == ""
    blind.agent.go(POSTURES[2], 1.5)
    blind.wait(3.0)
    assert missed_deg(session, POSTURES[2]) < 0.7 * missed_deg(blind, POSTURES[2])
    assert PUSHED not in kinds(agent)
    learned = agent.antagonism.fired
    assert learned >= 1  # it learns on


@pytest.mark.parametrize(
    ("muscle", "joints"), [("ecu", ("wrist_flex", "wrist_dev")), ("triceps", ("elbow",))]
)
def test_a_posture_that_cannot_be_held_is_named_and_the_nearest_one_is_taken(
    muscle: str, joints: tuple[str, ...], maps: Path
) -> None:
    session, _ = snapped(muscle, maps)
    agent = session.agent
    assert kinds(agent)[POSTURE_NOT_HELD] in joints
    assert agent.unreachable.startswith(f"Without {muscle} joint '")
    assert "N m; the arm goes to the nearest posture that can be held" in agent.unreachable
    assert np.abs(agent.target - POSTURES[1]).max() > np.radians(5.0)
    session.wait(3.0)
    # It may have fallen to another balance, from which it does not return, but then it says so.
    assert missed_deg(session, agent.target) < 3.0 or agent.missed() != ""
    copied, kinematics = deepcopy(agent), agent.kinematics
    copied.go(POSTURES[1], 1.0, goal="grip")
    grips = [kinematics.pose("grip", q)[:3, 3] for q in (POSTURES[1], agent.target, copied.target)]
    near, far = (float(np.linalg.norm(grips[0] - other)) for other in (grips[2], grips[1]))
    assert near < 0.5 * far
    agent.repaired(muscle)
    assert POSTURE_NOT_HELD not in kinds(agent)
    agent.go(POSTURES[1], 1.0)
    np.testing.assert_allclose(agent.target, POSTURES[1], atol=1e-9)


@pytest.mark.parametrize("muscle", ["mcp_flex", "pip_extend"])
def test_a_finger_of_another_size_names_which_joint_it_cannot_hold(
    muscle: str, maps: Path, tmp_path: Path
) -> None:
    scene = write_model("planar-finger", tmp_path)
    options = AgentOptions(camera="", marker_site="marker_hand")
    agent = make_agent(0, scene=scene, guard=True, cache=maps, options=options)
    tendons = TendonStretch(compliance=1e-4), MotorInertia(0.05)
    robot, rng = Robot(scene, tendons), np.random.default_rng(0)
    start, end = np.radians([20.0, 30.0]), np.radians([30.0, 20.0])
    robot.reset(start, rng)
    agent.begin_episode()
    agent.go(end, 1.0)
    for step in range(300):
        readings = SensorReadings(
            robot.time, robot.measured_lengths(), robot.measured_tensions(), None, -np.inf
        )
        robot.step(agent.step(readings))
        if step == 25:
            robot.elongate(muscle, SNAPPED)
    assert agent.in_use.left_out == (muscle,)
    joint = muscle.split("_")[0]
    assert kinds(agent)[POSTURE_NOT_HELD] == joint
    number = agent.map.joints.index(joint)
    np.testing.assert_allclose(agent.target[1 - number], end[1 - number], atol=1e-6)
    low, high = agent.kinematics.limits[number]
    stop, side = (high, 1.0) if muscle.endswith("extend") else (low, -1.0)
    assert agent.target[number] == pytest.approx(stop, abs=1e-3)
    assert side * (robot.joint_angles[number] - stop) > -np.radians(2.0)  # stops are soft
    assert np.abs(robot.joint_angles - agent.target)[1 - number] < np.radians(2.0)


class Remounted(Session):
    """A session whose lengths are longer by ``longer`` (m,) [m] since a muscle was mounted anew."""

    longer: Floats | float = 0.0

    def step(self) -> None:
        """One control step."""
        self.step_by(
            lambda readings: (
                self.agent.step(readings._replace(lengths=readings.lengths + self.longer))
                - self.longer
            )
        )


@pytest.mark.slow
@pytest.mark.parametrize("muscle", ["rhomb", "biceps"])
def test_a_repaired_muscle_is_learned_again_without_fault_or_jump(muscle: str, maps: Path) -> None:
    agent, postures = make_agent(1, guard=True, cache=maps), shuffled_postures(1)
    env = make_env("Posture", 1, max_episode_steps=NO_END)
    session = Remounted(env, agent, 1, None, {"posture": postures[-1]})
    for posture in postures[:4]:
        session.move(posture, 1.5, 1.5)
    agent.leave_out(muscle)
    session.move(postures[4], 1.5, 1.5)
    session.longer = 0.03 * (np.array(agent.map.muscles) == muscle)
    session.wait(0.1)
    agent.repaired(muscle)
    before = len(session.log.tensions)
    for posture in postures[5:9]:
        session.move(posture, 1.5, 1.5)
    assert agent.faults == []
    assert agent.in_use.all
    assert agent.taken_back == 0
    assert np.max(session.log.tensions[before:]) < 300.0
    number = agent.map.muscles.index(muscle)
    lengths = session.readings.lengths + session.longer
    away = agent.map.lengths(session.truth["joint_angles"]) - lengths
    assert abs(away[number]) < 0.012  # of 30 mm
    session.env.close()

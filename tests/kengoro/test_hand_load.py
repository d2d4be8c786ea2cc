"""What the hand holds: its mass from tensions, and postures with it."""

from __future__ import annotations

from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from jmm_agent import AgentOptions
from jmm_agent.hand_load import LoadedHand
from jmm_agent.types import Floats
from kengoro import Session, make_agent
from kengoro.robots import shuffled_postures
from kengoro.session import CLOSED, OPEN
from kengoro_env.departures import Payload
from kengoro_env.robot.nominal_model import NominalArm
from tests.kengoro.test_set_stiffness import TWO_JOINTS


@pytest.fixture
def maps(request: pytest.FixtureRequest) -> Path:
    return Path(request.config.cache.mkdir("maps"))


def holding(mass: float, maps: Path, postures: Floats) -> Session:
    """Session of the nominal robot that closes its hand about a mass [kg] and moves."""
    departures = (Payload(mass),)
    env = gym.make(
        "Kengoro/Posture-v0", departures=departures, camera=False, max_episode_steps=5000
    )
    start = {"posture": postures[0], "target": postures[0]}
    session = Session(env, make_agent(0, cache=maps), 0, None, start)
    session.fingers = CLOSED
    for posture in postures[1:]:
        session.agent.go(posture, 1.5)
        session.wait(3.0)
    return session


def missed(session: Session) -> float:
    """Distance of the joints from the target, RMS [deg]."""
    true = session.truth["joint_angles"]
    return float(np.degrees(np.sqrt(np.mean((true - session.agent.target) ** 2))))


@pytest.mark.parametrize("mass", [0.5, 1.0])
def test_the_mass_of_a_load_is_estimated_and_held(mass: float, maps: Path) -> None:
    postures = shuffled_postures(3)[:4]
    session, empty = holding(mass, maps, postures), holding(0.0, maps, postures)
    load, none = session.agent.hand_load, empty.agent.hand_load
    assert load is not None
    assert none is not None
    assert abs(load.mass - mass) < min(0.1 * mass, 2.0 * load.std)
    assert abs(none.mass) < 2.0 * none.std
    q = session.agent.joint_angles
    np.testing.assert_array_equal(none.loads.gravity(q), none._empty.gravity(q))
    assert missed(session) < missed(empty) + 0.3
    session.fingers = OPEN
    session.wait(0.1)
    assert (load.mass, load.std) == (0.0, np.inf)


def test_no_mass_follows_from_tensions_that_are_not_believed(maps: Path) -> None:
    """As in another unit: the Vision Updater has named them wrong."""
    session = holding(1.0, maps, shuffled_postures(3)[:1])
    vision = session.agent.vision
    rests = vision.memory.rests._replace(unbalanced=9.8)
    vision.memory = vision.memory._replace(rests=rests)
    session.agent.go(shuffled_postures(3)[1], 1.5)
    session.wait(3.0)
    assert session.agent.hand_load is not None
    assert (session.agent.hand_load.mass, session.agent.hand_load.rests) == (0.0, 0)


def test_the_weight_is_the_slope_of_the_height(maps: Path) -> None:
    agent = make_agent(0, cache=maps)
    assert agent.hand_load is not None
    q = shuffled_postures(5)[2]
    hand = LoadedHand(agent.hand_load._empty, agent.kinematics, "grip", 2.0)
    heights = [
        [agent.kinematics.pose("grip", q + sign * step)[2, 3] for sign in (1.0, -1.0)]
        for step in 1e-5 * np.eye(len(q))
    ]
    slope = np.diff(heights, axis=1)[:, 0] / -2e-5
    np.testing.assert_allclose(hand.weight(q), -9.81 * slope, atol=1e-6)
    more = hand.gravity(q) - agent.hand_load._empty.gravity(q)
    np.testing.assert_allclose(more, 2.0 * hand.weight(q), atol=1e-12)


@pytest.mark.parametrize("gravity", ["0 0 -9.81", "-6 0 -7", "0 0 0"])
def test_the_weight_is_that_of_the_model_with_the_load(
    gravity: str, maps: Path, tmp_path: Path
) -> None:
    """A robot of two joints, which may be mounted on a wall; MuJoCo says what the load adds."""
    scene, loaded = tmp_path / "arm.xml", tmp_path / "loaded.xml"
    text = TWO_JOINTS.replace("<worldbody>", f'<option gravity="{gravity}"/><worldbody>')
    scene.write_text(text)
    site = '<site name="marker_hand" pos="0.15 0 0"/>'
    ball = '<body pos="0.15 0 0"><geom type="sphere" size="0.01" mass="0.3"/></body>'
    loaded.write_text(text.replace(site, site + ball))
    agent = make_agent(scene=scene, cache=maps, options=AgentOptions(camera=""))
    assert agent.hand_load is not None
    empty, full = NominalArm(scene), NominalArm(loaded)
    hand = LoadedHand(empty, agent.kinematics, "marker_hand", 0.3)
    for q in np.array([[0.0, 0.0], [0.4, -0.3], [-0.5, 0.6]]):
        np.testing.assert_allclose(hand.gravity(q), full.gravity(q), atol=1e-9)

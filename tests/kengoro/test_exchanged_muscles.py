"""Wires that are exchanged, or lost, on the arm: found while it learns, without a guard."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from jmm_agent import SensorReadings
from jmm_agent.guard.faults import MUSCLE_SNAPPED, MUSCLES_SWAPPED
from jmm_agent.types import Floats
from kengoro import Session, make_agent
from kengoro.robots import NO_END, make_env, shuffled_postures

SEED = 2


@pytest.fixture(scope="module")
def maps(request: pytest.FixtureRequest) -> Path:
    return Path(request.config.cache.mkdir("maps"))


class Changed(Session):
    """A session whose robot has other wires.

    Attributes:
        reads: what the agent gets of the readings.
        moves: what the robot gets of a command (m,) [m].
    """

    reads: Callable[[SensorReadings], SensorReadings] = staticmethod(lambda readings: readings)
    moves: Callable[[Floats], Floats] = staticmethod(lambda command: command)

    def step(self) -> None:
        """One control step."""
        self.step_by(lambda readings: self.moves(self.agent.step(self.reads(readings))))


def session_of(maps: Path) -> Changed:
    env = make_env("Posture", SEED, max_episode_steps=NO_END)
    agent = make_agent(SEED, cache=maps)
    return Changed(env, agent, SEED, None, {"posture": shuffled_postures(SEED)[-1]})


def missed_deg(session: Session, posture: Floats) -> float:
    return float(np.degrees(np.sqrt(np.mean((session.truth["joint_angles"] - posture) ** 2))))


@pytest.mark.slow
def test_exchanged_muscles_are_exchanged_back_and_the_memory_keeps_it(
    maps: Path, tmp_path: Path
) -> None:
    session, postures = session_of(maps), shuffled_postures(SEED)
    agent = session.agent
    pair = [agent.map.muscles.index(name) for name in ("delt_mid", "delt_post")]
    order = np.arange(len(agent.map.muscles))
    order[pair] = pair[::-1]
    commands = []

    def reads(readings: SensorReadings) -> SensorReadings:
        return readings._replace(lengths=readings.lengths[order], tensions=readings.tensions[order])

    def moves(command: Floats) -> Floats:
        commands.append(command[order])
        return command[order]

    session.reads, session.moves = reads, moves
    for posture in postures[:6]:
        session.move(posture, 1.5, 1.5)
    named = [(fault.kind, fault.where) for fault in agent.faults]
    assert named == [(MUSCLES_SWAPPED, "delt_mid and delt_post")]
    assert np.abs(np.diff(commands, axis=0)).max() < 0.01
    assert missed_deg(session, postures[5]) < 4.0
    fired = agent.vision.fired
    session.move(postures[6], 1.5, 1.5)
    assert agent.vision.fired > fired
    agent.save(tmp_path / "learned.npz")
    session.env.close()

    later = session_of(maps)
    later.reads, later.moves = reads, moves
    later.agent.load(tmp_path / "learned.npz")
    later.move(postures[7], 1.5, 1.5)
    assert [fault.kind for fault in later.agent.faults] == [MUSCLES_SWAPPED]
    assert missed_deg(later, postures[7]) < 4.0
    later.env.close()


@pytest.mark.slow
@pytest.mark.parametrize("then", ["repaired", "another memory"])
def test_a_lost_muscle_is_lost_no_more_once_it_is_repaired_or_another_memory_is_loaded(
    then: str, maps: Path, tmp_path: Path
) -> None:
    session, postures = session_of(maps), shuffled_postures(SEED)
    agent, muscle = session.agent, "rhomb"
    number = agent.map.muscles.index(muscle)
    for posture in postures[:3]:
        session.move(posture, 1.5, 1.5)
    agent.save(tmp_path / "before.npz")
    wound = 0.0

    def loses(readings: SensorReadings) -> SensorReadings:
        nonlocal wound
        wound = max(-0.4, wound - 0.006)  # the motor winds the wire up
        lengths, tensions = readings.lengths.copy(), readings.tensions.copy()
        lengths[number], tensions[number] = lengths[number] + wound, 0.0
        return readings._replace(lengths=lengths, tensions=tensions)

    session.reads = loses
    session.move(postures[3], 1.5, 1.5)
    assert [(f.kind, f.where) for f in agent.faults] == [(MUSCLE_SNAPPED, muscle)]
    assert agent.in_use.left_out == (muscle,)

    longer = 0.01 * (np.arange(len(agent.map.muscles)) == number)
    if then == "repaired":
        session.reads = lambda one: one._replace(lengths=one.lengths + longer)
        agent.repaired(muscle)
        seen = [one.lengths[number] for one in agent.vision.memory.observations]
        assert len(seen) >= 3
        assert np.isnan(seen).all()  # the wire may have been lost before it was noticed
    else:
        session.reads = lambda one: one
        agent.load(tmp_path / "before.npz")
    for posture in postures[4:8]:
        session.move(posture, 1.5, 1.5)
    assert agent.in_use.all
    assert agent.faults == []
    assert not agent.wiring.left_out.any()
    lengths = session.reads(session.readings).lengths
    away = agent.map.lengths(session.truth["joint_angles"]) - lengths
    assert abs(away[number]) < 0.006
    session.env.close()

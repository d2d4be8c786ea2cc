"""A load in the hand: its mass by the tensions, and the postures that the robot holds with it.

The load is a ball at the grip of the same robot, put there in the model; the agent is told that the
hand holds something, and nothing else.
"""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import gymnasium as gym
import numpy as np

from jmm_agent.agent import Agent
from jmm_agent.types import Floats
from kengoro.robots import NO_END
from kengoro.session import CLOSED, Session
from kengoro.visits import errors, no_visits, visit
from kengoro_env.departures import Payload, actual
from kengoro_env.robot.draft import Departure


def carried(
    agent: Agent,
    seed: int,
    postures: Floats,
    mass: float,
    move: float,
    settle: float,
    known: int,
    departures: tuple[Departure, ...] | None = None,
) -> dict[str, Any]:
    """Move a load from posture to posture.

    Args:
        agent: has learned with an empty hand; it is copied.
        seed: of the robot.
        postures: joint angles (1 + K, n) [rad], where it starts and where it goes.
        mass: of the load [kg]; 0: an empty hand, which the agent believes to be full.
        move: duration of a movement [s].
        settle: time to come to rest [s].
        known: number of postures after which the mass is noted and errors count.
        departures: of the robot; those of the preset if left out.

    Returns:
        Estimated mass and standard deviation [kg] after these postures, the latter None if nothing
        was estimated yet; errors at the others.
    """
    departures = (*(actual(seed) if departures is None else departures), Payload(mass))
    options: dict[str, Any] = {"camera": False, "max_episode_steps": NO_END}
    env = gym.make("Kengoro/Posture-v0", departures=departures, **options)
    start = {"posture": postures[0], "target": postures[0]}
    session, visits = Session(env, deepcopy(agent), seed, None, start), no_visits()
    session.fingers = CLOSED
    load = session.agent.hand_load
    assert load is not None
    estimate = (0.0, np.inf)
    for number, posture in enumerate(postures[1:]):
        into = no_visits() if number < known else visits
        visit(session, posture, into, move, settle, search=False)
        if number == known - 1:
            estimate = load.mass, load.std
    env.close()
    return estimated(*estimate) | errors(visits)


def estimated(mass: float, std: float) -> dict[str, float | None]:
    """An estimated mass and its standard deviation [kg], for JSON, which has no infinity."""
    return {"mass_kg": round(mass, 4), "std_kg": round(std, 4) if np.isfinite(std) else None}

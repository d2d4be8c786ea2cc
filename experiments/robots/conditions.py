"""Conditions of most experiments: an actual robot, or the nominal model without departures."""

from __future__ import annotations

from jmm_agent.agent import Agent
from jmm_agent.types import Floats
from kengoro.robots import NO_END, make_env
from kengoro.session import Session

ACTUAL, NOMINAL = "actual", "nominal"
"""The actual robot of a seed, and the same trial on the nominal model."""


def robot_of(condition: str, seed: int) -> int | None:
    """Seed of the actual robot of a condition; None for the nominal model."""
    return seed if condition == ACTUAL else None


def make_session(condition: str, seed: int, agent: Agent, start: Floats) -> Session:
    """Session in ``Kengoro/Posture-v0`` without an end.

    Args:
        condition: `ACTUAL` or `NOMINAL`.
        seed: of the robot and of the noise of its sensors.
        agent: moves the robot.
        start: joint angles at the start, shape (n,) [rad].
    """
    env = make_env("Posture", robot_of(condition, seed), max_episode_steps=NO_END)
    return Session(env, agent, seed, None, {"posture": start, "target": start})

"""The robots and minds of the experiments: an actual arm or the drawn one, and who moves it."""

from __future__ import annotations

from math import radians
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from jmm_agent.agent import Agent, AgentOptions
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Rule
from jmm_agent.types import Floats
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.marker_detector import Detector, MarkerDetector
from kengoro.hand_search import READY
from kengoro.session import Session
from kengoro.trained_maps import ARM, trained_map
from kengoro_env.assets import asset_path
from kengoro_env.departures import actual, drawing
from kengoro_env.names import JOINTS
from kengoro_env.postures import posture_set

ACTUAL, NOMINAL = "actual", "nominal"
"""The conditions of most experiments: the robot of a seed, and the same without departures."""

CAMERA = Camera.from_fovy(640, 480, radians(45.0))
"""The camera as drawn; the robot's own differs a little."""

HAND, CAN = 0, 1
SIDES = {HAND: 0.050, CAN: 0.036}
NO_END = 10_000_000


def make_env(task: str, seed: int | None, **more: Any) -> gym.Env[Any, Any]:
    """An environment with the actual robot of ``seed``, or the drawing for None."""
    departures = drawing() if seed is None else actual(seed)
    return gym.make(f"Kengoro/{task}-v0", departures=departures, **more)


def make_agent(
    start: JointMuscleMap,
    seed: int,
    options: AgentOptions | None = None,
    rule: Rule | None = None,
    learning: bool = True,
    detector: Detector | None = None,
) -> Agent:
    """An agent that knows the drawing and nothing of the robot.

    Args:
        start: the map it begins with.
        seed: of what it draws by chance.
        options, rule: of the agent; the defaults if left out.
        learning: whether it learns from what it feels and sees.
        eyes: find markers in frames; a `MarkerDetector` if left out.
    """
    agent = Agent(
        start,
        ArmKinematics(asset_path(ARM), JOINTS),
        detector or MarkerDetector(CAMERA, SIDES),
        posture_set(),
        np.array(READY),
        np.random.default_rng([seed, 2]),
        options,
        rule,
    )
    agent.learning = learning
    return agent


def make_session(condition: str, seed: int, agent: Agent, start: Floats) -> Session:
    """An episode of ``Kengoro/Posture-v0`` without an end, for an agent that knows the drawing.

    Args:
        condition: `ACTUAL` or `NOMINAL`.
        seed: of the robot and of its sensors' noise.
        agent: its mind.
        start: joint angles (n,) [rad] to begin at.
    """
    robot = seed if condition == ACTUAL else None
    env = make_env("Posture", robot, max_episode_steps=NO_END)
    return Session(env, agent, seed, None, {"posture": start, "target": start})


def new_agent(cache: Path | None, seed: int, **more: Any) -> Agent:
    """`make_agent` with the trained map of the drawing."""
    return make_agent(trained_map(cache), seed, **more)


def shuffled_postures(seed: int) -> Floats:
    """The posture set (N, n) [rad] in the random order of a robot.

    Learn from its beginning and test on its end, so that no posture serves both.
    """
    postures = posture_set()
    return postures[np.random.default_rng([seed, 1]).permutation(len(postures))]

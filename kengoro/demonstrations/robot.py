"""A robot that learns once, as in `kengoro demo`, and then grasps cans at new positions.

The drawing, in place of a robot, needs no learning: the agent's map is its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path

from jmm_agent.agent import Agent
from kengoro.agents import make_agent
from kengoro.demonstrations.episode import Episode, Recorder
from kengoro.grasp_trial import begin_trial
from kengoro.hand_search import TrialOptions
from kengoro.robots import make_env, shuffled_postures
from kengoro.session import EpisodeEndedError, Session
from kengoro.trained_maps import trained_map
from kengoro_env.vision.rendering import Image

MOST = 10_000
"""Most episodes of a robot; their seeds are those from `MOST` times (robot + 1) on."""

FIXED_TIMES = TrialOptions(arrival=0.0)
"""The fingers close at the same time in each demonstration: a policy that is given the time follows
these, and would have to find out when the hand has arrived in others."""

Stage = Callable[[str], None]
"""Called with what the robot is doing."""


def no_stage(stage: str) -> None:
    """A `Stage` that shows nothing."""


def episode_seed(robot: int | None, number: int) -> int:
    """Seed of an episode of a robot (None: the drawing), from which the can's position follows."""
    return MOST * (-1 if robot is None else robot) + MOST + number


def learned_agent(
    robot: int | None,
    options: TrialOptions | None = None,
    cache: Path | None = None,
    stage: Stage = no_stage,
) -> Agent:
    """The agent after the trial of `kengoro demo`, with learning off.

    Args:
        robot: seed of the actual robot; None: the drawing, on which there is no trial.
        options: of the trial.
        cache: folder of trained maps.
        stage: called with what the robot is doing.
    """
    agent = make_agent(robot or 0, jmm=trained_map(cache))
    if robot is None:
        agent.learning = False
        return agent
    env = make_env("CanGrasp", robot)

    def watch(session: Session) -> None:
        stage(session.stage)

    begin_trial(env, agent, robot, shuffled_postures(robot), options, watch).run_to_end()
    env.close()
    agent.finish_learning()
    agent.learning = False
    return agent


def grasps(
    agent: Agent,
    robot: int | None,
    seeds: Iterable[int],
    options: TrialOptions | None = None,
    add_frame: Callable[[Image], None] | None = None,
) -> Iterator[Episode]:
    """Episodes in which a robot grasps a can at a new position.

    Each begins with the arm beside the body and ends after the lift, or what ended it before.

    Args:
        agent: that has learned on this robot.
        robot: seed of the actual robot; None: the drawing.
        seeds: of the episodes, see `episode_seed`.
        options: durations of the movements; `FIXED_TIMES` if left out.
        add_frame: called with each frame of the camera, at the camera's rate.
    """
    options, postures = options or FIXED_TIMES, shuffled_postures(robot or 0)
    env = Recorder(make_env("CanGrasp", robot), add_frame)
    for seed in seeds:
        trial = begin_trial(env, agent, seed, postures, options)
        with suppress(EpisodeEndedError):
            trial.approach(options.arrival)
        yield env.episode
    env.close()

"""Conditions of most experiments: an actual robot, or the nominal model without departures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from experiments.harness.common import Args
from experiments.harness.errors import ExperimentError
from experiments.harness.experiment import Experiment
from jmm_agent.agent import Agent
from jmm_agent.errors import AgentError
from jmm_agent.options import AgentOptions
from jmm_agent.types import Floats
from jmm_agent.updaters import VisionOptions
from jmm_agent.updaters.vision_options import HandKind
from kengoro.errors import UsageError
from kengoro.hand_weights import trained_hand
from kengoro.robots import NO_END, make_env
from kengoro.session import Session

ACTUAL, NOMINAL = "actual", "nominal"
"""The actual robot of a seed, and the same trial on the nominal model."""


def robot_of(condition: str, seed: int) -> int | None:
    """Seed of the actual robot of a condition; None for the nominal model."""
    return seed if condition == ACTUAL else None


AnyArgs = TypeVar("AnyArgs", bound=Args)


def with_hand(
    experiment: Experiment, args: AnyArgs, hand: HandKind, out: Path
) -> tuple[Experiment, AnyArgs]:
    """An experiment on robots with this hand; results without a marker have names of their own.

    Args:
        experiment: whose sizes have a ``hand``.
        args: its arguments.
        hand: "marker" or "seen".
        out: folder of the results with a marker, if none is given.

    Raises:
        ExperimentError: the hand is to be seen, and there is no trained detector of it.
    """
    if hand == "marker":
        return experiment, args
    try:
        trained_hand(AgentOptions(vision=VisionOptions(hand=hand)), False, None)
    except (UsageError, AgentError) as error:
        raise ExperimentError(str(error)) from None
    sizes, quick = (replace(one, hand=hand) for one in (experiment.sizes, experiment.quick))
    if args.out == out:
        args = replace(args, out=out.with_name(f"{out.name}-{hand}"))
    return replace(experiment, sizes=sizes, quick=quick, variant=hand), args


def make_session(
    condition: str, seed: int, agent: Agent, start: Floats, hand: HandKind = "marker"
) -> Session:
    """Session in ``Kengoro/Posture-v0`` without an end.

    Args:
        condition: `ACTUAL` or `NOMINAL`.
        seed: of the robot and of the noise of its sensors.
        agent: moves the robot.
        start: joint angles at the start, shape (n,) [rad].
        hand: whether the hand carries its marker ("marker") or none ("seen").
    """
    env = make_env("Posture", robot_of(condition, seed), hand=hand, max_episode_steps=NO_END)
    return Session(env, agent, seed, None, {"posture": start, "target": start})

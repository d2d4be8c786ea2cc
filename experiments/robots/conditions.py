"""Conditions of most experiments: an actual robot, or the nominal model without departures."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from experiments.harness.common import Args, files_digest
from experiments.harness.errors import ExperimentError
from experiments.harness.experiment import Experiment
from jmm_agent.agent import Agent
from jmm_agent.errors import AgentError
from jmm_agent.options import AgentOptions
from jmm_agent.types import Floats
from jmm_agent.updaters import VisionOptions
from jmm_agent.updaters.vision_options import HandKind
from jmm_agent.vision.can_shape import CanKind
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


class Seen(NamedTuple):
    """What robots carry no marker on, and what sees it.

    Attributes:
        hand: whether the hand carries its marker ("marker") or none ("seen").
        detector: file of `kengoro hand-detector` that sees it; None: Kengoro's own.
        can: whether the can carries its marker ("marker") or none ("seen").
    """

    hand: HandKind = "marker"
    detector: Path | None = None
    can: CanKind = "marker"

    @property
    def variant(self) -> str:
        """Name of the experiment's variant; empty with both markers."""
        hand = self.hand if self.hand != "marker" else ""
        return "-".join(filter(None, (hand, f"can-{self.can}" if self.can != "marker" else "")))


def with_seen(
    experiment: Experiment, args: AnyArgs, seen: Seen, out: Path
) -> tuple[Experiment, AnyArgs]:
    """An experiment on robots without some markers, whose results have names of their own.

    Args:
        experiment: whose sizes have ``hand``, ``detector`` and, if the can may be seen, ``can``,
            and whose run takes the file of a detector as ``detector``.
        args: its arguments.
        seen: without which markers; a detector that is given sees the hand.
        out: folder of the results with all markers, if none is given.

    Raises:
        ExperimentError: the hand is to be seen, and there is no trained detector of it.
    """
    if seen.detector is not None:
        seen = seen._replace(hand="seen")
    if not seen.variant:
        return experiment, args
    changes: dict[str, Any] = {}
    if seen.hand != "marker":
        _check_detector(seen)
        changes["hand"] = seen.hand
    if seen.detector is not None:
        changes["detector"] = files_digest([seen.detector])
        own: Any = experiment.run
        experiment = replace(experiment, run=partial(own, detector=seen.detector))
    if seen.can != "marker":
        changes["can"] = seen.can
    sizes, quick = (replace(one, **changes) for one in (experiment.sizes, experiment.quick))
    if args.out == out:
        args = replace(args, out=out.with_name(f"{out.name}-{seen.variant}"))
    return replace(experiment, sizes=sizes, quick=quick, variant=seen.variant), args


def _check_detector(seen: Seen) -> None:
    """Raise an `ExperimentError` if the hand's detector cannot be used."""
    options = AgentOptions(vision=VisionOptions(hand=seen.hand))
    try:
        trained_hand(options, False, None, seen.detector)
    except (UsageError, AgentError) as error:
        raise ExperimentError(str(error)) from None


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

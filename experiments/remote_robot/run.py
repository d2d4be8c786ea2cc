"""An agent drives a robot in another process, and learns on the way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rich.console import Console

from experiments.harness.errors import ExperimentError
from kengoro.remote_robot import robot_process


@dataclass(frozen=True)
class Args:
    """What is driven.

    Attributes:
        robot: seed of the actual robot.
        postures: how many it goes to, one after the other.
    """

    robot: int = 1
    postures: int = 4


def main(args: Args) -> None:
    """Drive a robot in another process to some postures, and learn on the way."""
    from jmm_agent.driver import drive
    from kengoro.arm import make_agent
    from kengoro.trained_maps import trained_map
    from kengoro_env.postures import posture_set

    if args.postures < 1:
        raise ExperimentError(f"Postures are {args.postures}, but at least 1 is needed.")
    console = Console()
    agent = make_agent(trained_map(), args.robot)
    with robot_process("Posture", args.robot) as robot:
        for i, posture in enumerate(posture_set()[: args.postures]):
            agent.go(posture, 2.0)
            drive(agent, robot, 5.0)
            error = float("nan") if agent.seen is None else np.abs(agent.seen.error).mean()
            console.print(
                f"posture {i}: {np.degrees(error):.2f} deg between what it believed and saw"
            )

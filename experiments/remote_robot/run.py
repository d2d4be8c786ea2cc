"""Agent that drives a robot in another process and learns meanwhile."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rich.console import Console

from experiments.harness.errors import ExperimentError
from kengoro.remote_robot.process import robot_process


@dataclass(frozen=True)
class Args:
    """An agent drives a robot in another process and learns meanwhile.

    Attributes:
        robot: seed of the actual robot.
        postures: number of postures to visit.
        period: control period of the robot's own clock [s]; without, it waits for each command.
    """

    robot: int = 1
    postures: int = 4
    period: float | None = None


def main(args: Args) -> None:
    """Drive a robot in another process to some postures and learn meanwhile."""
    from jmm_agent.driving.drive import drive
    from kengoro.agents import make_agent
    from kengoro_env.postures import posture_set

    if args.postures < 1:
        raise ExperimentError(f"Postures are {args.postures}, but at least 1 is needed.")
    console = Console()
    agent = make_agent(args.robot)
    with robot_process("Posture", args.robot, args.period) as robot:
        for i, posture in enumerate(posture_set()[: args.postures]):
            agent.go(posture, 2.0)
            drive(agent, robot, 5.0)
            error = float("nan") if agent.seen is None else np.abs(agent.seen.error).mean()
            console.print(
                f"posture {i}: {np.degrees(error):.2f} deg between estimate and observation"
            )

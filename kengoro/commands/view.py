"""`kengoro view`: watch a robot while it moves between postures and learns."""

from __future__ import annotations

from dataclasses import dataclass

from kengoro.agents import make_agent
from kengoro.errors import UsageError
from kengoro.robots import NO_END, make_env, shuffled_postures
from kengoro.session import Session, shown_by
from kengoro.viewer.window import open_window


@dataclass(frozen=True)
class Args:
    """Watch a robot that learns: in MuJoCo's viewer on a display, else on a page for a browser.

    Attributes:
        robot: seed of the actual robot.
        nominal: watch the nominal model instead, without departures.
        postures: number of postures that it visits.
    """

    robot: int = 1
    nominal: bool = False
    postures: int = 27


def main(args: Args) -> None:
    """Show the robot until the last posture, or until Ctrl-C.

    Raises:
        UsageError: there is no posture to visit.
    """
    if args.postures < 1:
        raise UsageError(f"Postures are {args.postures}, but at least 1 is needed.")
    start, *targets = shuffled_postures(args.robot)[: args.postures + 1]
    env = make_env("Posture", None if args.nominal else args.robot, max_episode_steps=NO_END)
    title = "Nominal model" if args.nominal else f"Robot {args.robot}"
    with open_window(title) as window, shown_by(window.show):
        options = {"posture": start, "target": start}
        session = Session(env, make_agent(args.robot), args.robot, options=options)
        for target in targets:
            session.move(target, duration=2.0, patience=2.0)
    env.close()

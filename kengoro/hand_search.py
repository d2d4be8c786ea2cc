"""Looking for the hand: the head turns until its marker is in view."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

from jmm_agent.types import Floats
from kengoro.session import Session

READY = tuple(radians(angle) for angle in (-15, 10, 0, -8, 0, -3, 0, 5, -32, -50, 95, 0, 0, 0))
"""The arm beside the body, the hand out of view; the head towards the table [rad]."""


@dataclass(frozen=True)
class TrialOptions:
    """How the experiment runs.

    Attributes:
        approaches: number of approaches at most.
        postures: number of postures before the eyes, between the first two approaches.
        near: number of postures near the can, before each later approach.
        move: duration of a movement from posture to posture [s].
        patience: longest wait for rest and for a look [s].
        turn: duration of a turn of the head [s].
        reach: duration of the way from the stand-off to the can [s].
        ready: joint angles of an arm that is out of the camera's way [rad].
        table_point: where the head is turned to find the can (3,) [m].
        scan: how far the head is turned when it is not there, (yaw, pitch) [rad].
    """

    approaches: int = 4
    postures: int = 27
    near: int = 8
    move: float = 2.0
    patience: float = 3.0
    turn: float = 0.8
    reach: float = 1.5
    ready: tuple[float, ...] = READY
    table_point: tuple[float, float, float] = (0.40, -0.15, -0.28)
    scan: tuple[float, float] = (0.28, 0.22)


def find_hand(session: Session, posture: Floats, options: TrialOptions) -> None:
    """Turn the head from a posture (n,) [rad] until the hand's marker is in view, if it is not."""
    agent = session.agent
    for offset in scan_offsets(options):
        if agent.options.hand_marker in agent.markers:
            return
        turned = posture.copy()
        turned[:2] += offset
        session.move(turned, options.turn, options.patience)


def scan_offsets(options: TrialOptions) -> list[tuple[float, float]]:
    """Turns of the head to look around, (yaw, pitch) [rad]."""
    yaw, pitch = options.scan
    sides = [(0.0, pitch), (0.0, -pitch), (yaw, 0.0), (-yaw, 0.0)]
    return [*sides, (yaw, pitch), (-yaw, pitch), (yaw, -pitch), (-yaw, -pitch)]

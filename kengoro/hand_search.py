"""Search for the hand: the head turns until the hand is in view."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

from jmm_agent.types import Floats
from kengoro.session import Session

READY = tuple(radians(angle) for angle in (-15, 10, 0, -8, 0, -3, 0, 5, -32, -50, 95, 0, 0, 0))
"""Posture with the arm beside the body, out of view, and the head towards the table [rad]."""


@dataclass(frozen=True)
class TrialOptions:
    """Sizes and durations of a can-grasping trial.

    Attributes:
        approaches: largest number of approaches.
        postures: number of postures in view of the camera, between the first two approaches.
        near: number of postures near the can, before each later approach.
        move: duration of a movement between postures [s].
        patience: longest wait for rest and for a marker observation [s].
        turn: duration of a turn of the head [s].
        reach: duration of the path from the stand-off point to the can [s].
        arrival: longest wait until the hand has arrived at the can after it has learned, see
            `GraspTrial.grasp` [s].
        ready: joint angles with the arm out of view, shape (n,) [rad].
        table_point: point that the camera is turned to when it looks for the can, shape (3,) [m].
        scan: largest turns of the head in a search, (yaw, pitch) [rad].
    """

    approaches: int = 4
    postures: int = 27
    near: int = 8
    move: float = 2.0
    patience: float = 3.0
    turn: float = 0.8
    reach: float = 1.5
    arrival: float = 3.0
    ready: tuple[float, ...] = READY
    table_point: tuple[float, float, float] = (0.40, -0.15, -0.28)
    scan: tuple[float, float] = (0.28, 0.22)


def find_hand(session: Session, posture: Floats, options: TrialOptions) -> None:
    """Turn the head until the hand is in view, unless it is already.

    Args:
        session: whose agent looks for its hand.
        posture: joint angles that the head turns from, shape (n,) [rad].
        options: durations and range of the search.
    """
    agent = session.agent
    for offset in scan_offsets(options):
        if agent.hand is not None:
            return
        turned = posture.copy()
        turned[:2] += offset
        session.move(turned, options.turn, options.patience)


def scan_offsets(options: TrialOptions) -> list[tuple[float, float]]:
    """Turns of the head that a search tries in this order, (yaw, pitch) [rad]."""
    yaw, pitch = options.scan
    sides = [(0.0, pitch), (0.0, -pitch), (yaw, 0.0), (-yaw, 0.0)]
    return [*sides, (yaw, pitch), (-yaw, pitch), (yaw, -pitch), (-yaw, -pitch)]

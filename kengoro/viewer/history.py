"""History of a session for its viewers: marker positions now, and curves of the estimation error.

A history only reads the session. Kinematics are computed on the nominal model.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jmm_agent.types import Floats
from kengoro.session import Session
from kengoro.visits import grip, nominal_kinematics

CURVE_PERIOD = 0.1
"""Simulated time between two points of the curves [s]."""

MAX_POINTS = 600
"""Largest number of points of a curve."""


class Marks(NamedTuple):
    """Positions of the hand's marker in the world, each of shape (3,) [m].

    Attributes:
        estimated: at the joint angles that the agent estimates now.
        seen: at the newest marker observation, with the camera at the joint angles estimated then;
            None before the first observation.
        estimated_then: at the joint angles estimated at that observation.
    """

    estimated: Floats
    seen: Floats | None = None
    estimated_then: Floats | None = None


class Moment(NamedTuple):
    """State of a session at one moment.

    Attributes:
        time: simulated time [s].
        stage: what the robot is doing, in a few words.
        tensions: true tensions of the muscles, shape (m,) [N].
        marks: positions of the hand's marker.
        observation_time: time of the newest marker observation [s]; None before the first.
    """

    time: float
    stage: str
    tensions: Floats
    marks: Marks
    observation_time: float | None


class Curves(NamedTuple):
    """Errors of the estimate over time.

    Attributes:
        time: shape (k,) [s].
        true_deg: estimate - true, root mean square over joints, shape (k,) [deg].
        true_mm: estimate - true, distance of the grip points, shape (k,) [mm].
        observation_time: of each marker observation, shape (l,) [s].
        seen_deg: estimate - seen, root mean square over joints, shape (l,) [deg].
        seen_mm: estimate - seen, distance of the grip points, shape (l,) [mm].
    """

    time: Floats
    true_deg: Floats
    true_mm: Floats
    observation_time: Floats
    seen_deg: Floats
    seen_mm: Floats


class SessionHistory:
    """Records the estimation errors and marker observations of a session."""

    def __init__(self) -> None:
        self._rows: list[tuple[float, float, float]] = []
        self._observations: list[tuple[float, float, float]] = []
        self._seen: object = None
        self._observed_marks: tuple[Floats, Floats] | None = None
        self._frame = ""

    def record(self, session: Session) -> None:
        """Record the session after a step.

        Every marker observation is recorded, and the estimate every `CURVE_PERIOD`.
        """
        agent = session.agent
        if agent.seen is not None and agent.seen is not self._seen:
            self._seen = agent.seen
            seen, error = agent.seen.angles, agent.seen.error
            self._observations.append((session.time, *_error(seen + error, seen)))
            self._record_hand(session, seen + error)
        if not self._rows or session.time >= self._rows[-1][0] + CURVE_PERIOD - 1e-9:
            error_now = _error(agent.joint_angles, session.truth["joint_angles"])
            self._rows.append((session.time, *error_now))

    def _record_hand(self, session: Session, estimate: Floats) -> None:
        options, hand = session.agent.options, session.agent.hand
        if hand is not None:
            frame, camera = hand.frames or (options.marker_site, options.camera)
            seen = nominal_kinematics().pose(camera or options.camera, estimate) @ hand.pose
            estimated = nominal_kinematics().pose(frame, estimate)
            self._observed_marks = seen[:3, 3], estimated[:3, 3]
            self._frame = frame

    def moment(self, session: Session) -> Moment:
        """State of the session now."""
        agent = session.agent
        frame = self._frame or agent.options.marker_site
        estimated = nominal_kinematics().pose(frame, agent.joint_angles)[:3, 3]
        learning = "learns" if agent.learning else "is tested: learning is off"
        return Moment(
            session.time,
            session.stage or learning,
            session.world.robot.tensions,
            Marks(estimated, *(self._observed_marks or ())),
            self._observations[-1][0] if self._observations else None,
        )

    def curves(self) -> Curves:
        """Curves so far, thinned to `MAX_POINTS`."""
        rows = np.array(self._rows[:: 1 + len(self._rows) // MAX_POINTS]).reshape(-1, 3)
        return Curves(*rows.T, *np.array(self._observations).reshape(-1, 3).T)


def _error(one: Floats, other: Floats) -> tuple[float, float]:
    """Difference of two postures: RMS over joints [deg], distance of the grip points [mm]."""
    rmse = float(np.degrees(np.sqrt(np.mean(np.square(one - other)))))
    return rmse, 1e3 * float(np.linalg.norm(grip(one) - grip(other)))

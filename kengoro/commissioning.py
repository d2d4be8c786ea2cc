"""Commissioning run of a robot in a session."""

from __future__ import annotations

from jmm_agent.commissioning.commissioning import Commissioning
from jmm_agent.commissioning.options import CommissionOptions
from jmm_agent.driving.commission import commissioner_of
from jmm_agent.types import Floats
from kengoro.session import Session


def commission(
    session: Session,
    posture: Floats | None = None,
    options: CommissionOptions | None = None,
    held: Floats | None = None,
) -> Commissioning:
    """Pull each muscle of a session's robot a little, and name what does not fit the nominal map.

    The session's agent only gives the nominal map, and is not changed. `make_agent` takes the
    result.

    Args:
        session: with a robot at rest.
        posture: joint angles (n,) [rad] at which the robot is, about; where the agent believes to
            start if left out.
        options: how muscles are pulled; the defaults if left out.
        held: target lengths (m,) [m] that the motors hold now; the first readings if left out. A
            first command that contradicts the motors' own encoders moves the arm at once.

    Raises:
        EpisodeEndedError: the environment ended the episode.
    """
    commissioner = commissioner_of(session.agent, posture, options, held)
    if not commissioner.refuse(session.readings):
        session.stage = "commissioning"
        while not commissioner.done:
            session.step_by(commissioner.step)
        session.stage = ""
    return commissioner.result()

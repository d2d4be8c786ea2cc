"""Robot of the experiment on muscle Jacobians: learning, and estimation by both Jacobians."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from experiments.robots.conditions import ACTUAL, make_session
from experiments.robots.variants import PAPER_OPTIONS
from jmm_agent.arm_estimate import START_UPDATES
from jmm_agent.kalman_filter import JointEstimator
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.length_map import LengthMap, QuadraticJacobian
from jmm_agent.mapping.minibatch import MinibatchRule
from jmm_agent.observation import CONTROL_PERIOD
from jmm_agent.types import Floats
from kengoro.agents import make_agent
from kengoro.session import Session
from kengoro.visits import visit


def learn(
    jmm: JointMuscleMap, seed: int, postures: Floats, as_paper: bool, move: float, patience: float
) -> Session:
    """Let the actual robot of a seed learn from postures.

    Args:
        jmm: the initial map.
        seed: of the robot.
        postures: joint angles, shape (K, n) [rad]; the robot starts at the first.
        as_paper: whether the map is updated as in the paper, or by the default rule.
        move: duration of a movement [s].
        patience: longest wait for rest [s].
    """
    options, rule = (PAPER_OPTIONS, MinibatchRule()) if as_paper else (None, None)
    agent = make_agent(seed, jmm=jmm, options=options, rule=rule)
    session = make_session(ACTUAL, seed, agent, postures[0])
    for posture in postures[1:]:
        visit(session, posture, None, move, patience)
    return session


@dataclass
class FilteredReadings:
    """Filtered readings and true angles, by control step.

    Attributes:
        lengths: muscle lengths, shape (m,) [m] each.
        true: joint angles, shape (n,) [rad] each.
    """

    lengths: list[Floats] = field(default_factory=list)
    true: list[Floats] = field(default_factory=list)


def record(session: Session, postures: Floats, move: float) -> FilteredReadings:
    """Move through postures, shape (K, n) [rad], without learning, ``move`` [s] each."""
    session.agent.learning = False
    readings = FilteredReadings()
    for posture in postures:
        session.agent.go(posture, move)
        for _ in range(round(move / CONTROL_PERIOD)):
            session.step()
            readings.lengths.append(session.readings.lengths)
            readings.true.append(session.truth["joint_angles"])
    return readings


def estimator_errors(
    readings: FilteredReadings, jmm: JointMuscleMap, limits: Floats
) -> dict[str, float]:
    """RMS over time and joints of estimate - true by both Jacobians, and between both [deg]."""
    true = np.array(readings.true)
    analytic = estimates(readings, jmm, limits)
    quadratic = estimates(readings, QuadraticJacobian(jmm), limits)
    gaps = {
        "analytic": analytic - true,
        "quadratic": quadratic - true,
        "between": quadratic - analytic,
    }
    return {name: float(np.degrees(np.sqrt(np.mean(np.square(gap))))) for name, gap in gaps.items()}


def estimates(readings: FilteredReadings, length_map: LengthMap, limits: Floats) -> Floats:
    """Joint angles of an estimator that starts at the true ones, shape (K, n) [rad]."""
    estimator = JointEstimator(length_map, limits, q=readings.true[0])
    for _ in range(START_UPDATES):
        estimator.update(readings.lengths[0], CONTROL_PERIOD)
    return np.array([estimator.update(lengths, CONTROL_PERIOD).q for lengths in readings.lengths])

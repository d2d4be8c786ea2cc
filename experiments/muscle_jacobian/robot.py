"""The robot in the experiment on muscle Jacobians: it learns, then estimates by both Jacobians."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from experiments.robots.variants import PAPER_OPTIONS
from jmm_agent.agent import PERIOD, WAKING
from jmm_agent.kalman_filter import JointEstimator
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.length_map import LengthMap, QuadraticJacobian
from jmm_agent.mapping.minibatch import MinibatchRule
from jmm_agent.types import Floats
from kengoro.arm import ACTUAL, make_agent, make_session
from kengoro.session import Session
from kengoro.visits import visit


def learn(
    jmm: JointMuscleMap, seed: int, postures: Floats, as_paper: bool, move: float, patience: float
) -> Session:
    """The actual robot of a seed learns from all ``postures`` (K, n) [rad] but the first.

    Args:
        jmm: the map that it begins with.
        as_paper: whether its map is moved as in the paper, or by the agent's defaults.
        move, patience: time for each movement and longest wait for rest [s].
    """
    options, rule = (PAPER_OPTIONS, MinibatchRule()) if as_paper else (None, None)
    agent = make_agent(jmm, seed, options, rule)
    session = make_session(ACTUAL, seed, agent, postures[0])
    for posture in postures[1:]:
        visit(session, posture, None, move, patience)
    return session


@dataclass
class FilteredReadings:
    """What the robot measured and where it was, by control step.

    Attributes:
        lengths: (m,) [m] each.
        true: joint angles (n,) [rad] each.
    """

    lengths: list[Floats] = field(default_factory=list)
    true: list[Floats] = field(default_factory=list)


def feel(session: Session, postures: Floats, move: float) -> FilteredReadings:
    """Move through postures (K, n) [rad] without learning, ``move`` [s] each."""
    session.agent.learning = False
    felt = FilteredReadings()
    for posture in postures:
        session.agent.go(posture, move)
        for _ in range(round(move / PERIOD)):
            session.step()
            felt.lengths.append(session.readings.lengths)
            felt.true.append(session.truth["joint_angles"])
    return felt


def estimator_errors(
    felt: FilteredReadings, jmm: JointMuscleMap, limits: Floats
) -> dict[str, float]:
    """RMS over time and joints [deg] of estimate - true by both Jacobians, and between the two."""
    true = np.array(felt.true)
    analytic = estimates(felt, jmm, limits)
    quadratic = estimates(felt, QuadraticJacobian(jmm), limits)
    gaps = {
        "analytic": analytic - true,
        "quadratic": quadratic - true,
        "between": quadratic - analytic,
    }
    return {name: float(np.degrees(np.sqrt(np.mean(np.square(gap))))) for name, gap in gaps.items()}


def estimates(felt: FilteredReadings, length_map: LengthMap, limits: Floats) -> Floats:
    """Joint angles (K, n) [rad] by an estimator that begins at the true ones."""
    estimator = JointEstimator(length_map, limits, q=felt.true[0])
    for _ in range(WAKING):
        estimator.update(felt.lengths[0], PERIOD)
    return np.array([estimator.update(lengths, PERIOD).q for lengths in felt.lengths])

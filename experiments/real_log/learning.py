"""Our method on a log: learning in the order of time, then joint angles from lengths alone.

The estimator, the prior, the fit of rests with the posture at which the lengths were zeroed, and
the ridge rule are those of the agent with its default options, scaled to the robot. A sample with
measured joint angles enters as an observation without a pose of the hand. There are no tensions, so
the fit has no balance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from experiments.real_log.machine import LIMITS, Machine, sheet_angles
from jmm_agent.kalman_filter import JointEstimator
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Learner, RidgeRule
from jmm_agent.mapping.prior import MapPrior
from jmm_agent.types import Floats
from jmm_agent.updaters import VisionUpdater
from jmm_agent.vision.marker_observation import Frames

FIRST_PERIOD = 1.0
"""Time before the first sample [s]."""


@dataclass(frozen=True)
class Learned:
    """What was learned from a log.

    Attributes:
        maps: the map after each number of samples.
        samples: indices of the samples that were learned from, in the order of time.
        dropped: number of observations that were not learned from, by reason.
        elongations: largest number of permanent elongations of a muscle that were believed in.
    """

    maps: dict[int, JointMuscleMap]
    samples: list[int]
    dropped: dict[str, int]
    elongations: float


def learn(
    machine: Machine,
    time: Floats,
    lengths: Floats,
    angles: Floats,
    counts: Sequence[int],
) -> Learned:
    """Learn from the first samples of a log that are far enough from each other.

    As in the agent, a sample is learned from if the estimated posture is farther from that of the
    last one than `VisionOptions.distance`. Measured joint angles are used at these samples only.

    Args:
        machine: the robot.
        time: (N,) [s].
        lengths: (N, 6) [m].
        angles: measured joint angles (N, 6) [rad].
        counts: numbers of samples after which the map is kept.
    """
    options = machine.options
    vision_options = replace(options.vision, lengths="l")
    prior = MapPrior(machine.map, machine.typical, options.prior)
    rng = np.random.default_rng(0)
    learner = Learner(machine.map, LIMITS, RidgeRule(prior), options.batch, rng)
    vision = VisionUpdater(learner, prior, _no_pose, LIMITS, vision_options)
    estimator = JointEstimator(machine.map, LIMITS, options.estimator, sheet_angles(lengths[0]))
    unknown = np.full(lengths.shape[1], np.nan)
    maps: dict[int, JointMuscleMap] = {}
    samples: list[int] = []
    last: Floats | None = None
    for number, dt in enumerate(np.diff(time, prepend=time[0] - FIRST_PERIOD)):
        q = estimator.update(lengths[number], float(dt)).q
        if last is not None and np.linalg.norm(q - last) < vision_options.distance:
            continue
        seen = vision.seen(
            np.eye(4),
            q,
            lengths[number],
            lengths[number],
            unknown,
            joint_angles=angles[number],
        )
        if not seen.learned:
            continue
        last = seen.angles
        samples.append(number)
        estimator.set_map(learner.map)
        if len(samples) in counts:
            maps[len(samples)] = learner.map
        if len(samples) == max(counts):
            break
    elongations = float(vision.elongated.max(initial=0.0))
    return Learned(maps, samples, dict(vision.dropped), elongations)


class Estimated(NamedTuple):
    """Joint angles of the estimator (N, 6) [rad], and their predicted standard deviations."""

    angles: Floats
    spread: Floats


def estimate(machine: Machine, jmm: JointMuscleMap, time: Floats, lengths: Floats) -> Estimated:
    """Estimate joint angles from lengths (N, 6) [m] at times (N,) [s] alone.

    The estimator starts at the first posture by the data sheet.
    """
    start = sheet_angles(lengths[0])
    estimator = JointEstimator(jmm, LIMITS, machine.options.estimator, start)
    periods = np.diff(time, prepend=time[0] - FIRST_PERIOD)
    pairs = zip(lengths, periods, strict=True)
    found = [estimator.update(row, float(dt)) for row, dt in pairs]
    variances = np.array([np.diag(one.covariance) for one in found])
    return Estimated(np.array([one.q for one in found]), np.sqrt(variances))


def _no_pose(q: Floats, pose: Floats, frames: Frames | None = None) -> tuple[Floats, Floats]:
    """Residual (6,) and Jacobian (6, n) of a hand whose pose was not measured."""
    return np.zeros(6), np.zeros((6, len(q)))

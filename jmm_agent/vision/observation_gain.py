"""How much a look at a posture is expected to tell of the robot's lengths, and of its hand.

At a posture q the robot has the lengths F(q), known by their posterior
(`jmm_agent.vision.map_posterior`). A rest there that is seen measures l = F + G d + e and the pose
p = h + J d + v: d is how far the joints are from q, which is unknown, e and v have the covariances
s^2 and R. Once d is eliminated, the information on F is

    I = (1 - G (G' G / s^2 + J' R^-1 J)^-1 G' / s^2) / s^2 = L L',

so the look measures y = L' F with unit noise. With the covariance S of F at q and at the postures
p at which the hand's error is a_p' F, a look lowers the sum of the mean squares of this error by

    sum_p |a_p' S_pq L (1 + L' S_qq L)^-1/2|^2

whatever it shows: expected information of a linear model with Gaussian errors. What tensions tell
beside the lengths is left out.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from jmm_agent.types import Floats
from jmm_agent.vision.hand_error import HandPostures
from jmm_agent.vision.map_posterior import MapPosterior


class ObservationGain(NamedTuple):
    """What looks at C postures are expected to tell.

    Attributes:
        before: root mean square of the hand's error that is unknown now [m].
        after: the same after a look at each posture (C,) [m].
        angles: covariance of the joint angles that a command of each reaches (C, n, n) [rad^2].
    """

    before: float
    after: Floats
    angles: Floats


def information(arms: Floats, pose: Floats, noise: float) -> Floats:
    """L of the module docstring for a look at a posture (m, k) [1/m], k <= m.

    Args:
        arms: G, how the lengths move with the joint angles (m, n) [m/rad].
        pose: J' R^-1 J, what the pose tells of the joint angles (n, n) [1/rad^2].
        noise: s, of the lengths, standard deviation [m].
    """
    muscles, joints = arms.shape
    known = arms.T @ arms / noise**2 + pose
    known[np.diag_indices(joints)] += 1e-12 * np.trace(known) / joints
    explained = arms @ np.linalg.solve(known, arms.T) / noise**2
    values, axes = np.linalg.eigh((np.eye(muscles) - explained) / noise**2)
    most = min(muscles, max(muscles - joints, 0) + 6)
    return np.asarray(axes[:, -most:] * np.sqrt(np.maximum(values[-most:], 0.0)))


def observation_gains(
    posterior: MapPosterior,
    judged: HandPostures,
    rows: Floats,
    candidates: Floats,
    shown: Floats,
    follows: Floats,
) -> ObservationGain:
    """What looks at postures are expected to tell of the hand.

    Args:
        posterior: of the robot's lengths.
        judged: postures at which the hand's error counts.
        rows: how the hand is off by errors of the lengths at each of these (P, 3, m) [1].
        candidates: joint angles (C, n) [rad].
        tells: L of a look at each candidate (C, m, k) [1/m].
        follows: how joint angles follow lengths at each candidate (C, n, m) [rad/m].
    """
    hand = posterior.project(judged.postures, rows)
    turned = np.swapaxes(shown, 1, 2)
    both = posterior.project(candidates, np.concatenate([turned, follows], axis=1))
    own, count = posterior.own_covariance(both), shown.shape[2]
    observations = both._replace(rows=both.rows[:, :count], solved=both.solved[..., :count])
    shared = posterior.covariance(hand, observations)  # (P, 3, C, k)
    before = float(np.mean(np.trace(posterior.own_covariance(hand), axis1=1, axis2=2)))
    after = np.empty(len(candidates))
    for number in range(len(candidates)):
        known = np.eye(count) + own[number, :count, :count]
        shown = shared[:, :, number].reshape(-1, count)
        gained = np.sum(shown.T * cho_solve(cho_factor(known), shown.T)) / len(judged.postures)
        after[number] = np.sqrt(max(before - float(gained), 0.0))
    return ObservationGain(float(np.sqrt(before)), after, own[:, count:, count:])

"""Part of the remaining error that depends on the direction of motion.

A joint behind friction and an elastic or slack cable follows what its motor asks for with play: a
point p is dragged along by the asked joint angle x, p <- min(max(p, x - w), x + w), where w is half
the play. The state x - p is w after a motion upwards, -w after one downwards, and in between after
a reversal. Real friction begins piece by piece, as a sum of plays of many widths does (Prandtl and
Ishlinskii). What a map leaves is regressed on the asked joint angles of the group and their
products, which is what a better map could still learn, and beside them on the states of these
joints: on their signs, on those of one width, and on those of all widths. All are fitted to one
part of the log and evaluated on another one.

No method that knows the motor angles alone is better than the spread of the joint angle among
samples with the same motor angles. It is taken from pairs of such samples, many samples apart.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from experiments.real_log.machine import GROUPS, joints_of
from jmm_agent.types import Floats

PLAYS = np.radians([0.1, 0.25, 0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 11.0, 15.0, 20.0, 28.0])
"""Halves of the play to choose from [rad]."""
LEAST_MOTION = np.radians(0.05)
"""Half the play of the state whose sign is the direction of motion [rad]."""
RIDGE = 1e-3
"""Ridge of the regressions, per sample and in units of the terms' variance [1]."""
SAME = np.radians(1.0)
"""Largest distance of asked joint angles that count as the same [rad]."""
APART = 20
"""Least number of samples between two of a pair, so that they are not of the same motion."""
CANDIDATES = 60
"""Number of nearest samples among which partners are chosen."""
AT_END = 0.99
"""State from which on the whole play was passed, as a share of it [1]."""
LEAST = 30
"""Least number of samples, fitted and others, from which `Direction.one_side` is computed."""


class Direction(NamedTuple):
    """How much of a joint's remaining error depends on the direction of motion.

    The shares are those of the mean squared error on samples that were not fitted.

    Attributes:
        static: RMS error that asked joint angles leave without a state [rad].
        play: half of the play of one width [rad].
        by_sign: share that the directions of the last motions explain [1].
        by_play: share that the states of one width explain [1].
        by_plays: share that the states of all widths explain [1].
        left: RMS error that is left with all widths [rad].
        one_side: RMS error at postures that all joints of the group have approached from one side
            by more than the play of one width, with a constant for each side [rad]; NaN if there
            are less than `LEAST` of them.
        approached: share of the samples that were approached so [1].
    """

    static: float
    play: float
    by_sign: float
    by_play: float
    by_plays: float
    left: float
    one_side: float
    approached: float


class Spread(NamedTuple):
    """Joint angles at the same motor angles.

    Attributes:
        pairs: number of samples with a partner.
        floor: RMS error of the best function of the motor angles [rad].
        repeated: the same among samples that the joint reached in the same direction [rad].
        gap: mean of the joint angle after a motion upwards minus that after one downwards [rad].
    """

    pairs: int
    floor: float
    repeated: float
    gap: float


def play_states(asked: Floats, play: float) -> Floats:
    """States x - p (N, n) [rad] of asked joint angles (N, n) [rad] with half the play [rad]."""
    dragged, result = asked[0].copy(), np.empty_like(asked)
    for number, row in enumerate(asked):
        dragged = np.minimum(np.maximum(dragged, row - play), row + play)
        result[number] = row - dragged
    return result


def directions(asked: Floats) -> Floats:
    """Direction of the last motion of each joint (N, n): 1, -1, or 0 before the first one."""
    return np.sign(np.round(play_states(asked, LEAST_MOTION) / LEAST_MOTION, 9))


def by_direction(asked: Floats, missed: Floats, split: int) -> list[Direction]:
    """How much of the remaining error of each joint depends on the direction of motion.

    Args:
        asked: joint angles by the data sheet (N, 6) [rad], in the order of time.
        missed: measured joint angles minus those of a map (N, 6) [rad].
        split: number of first samples that are fitted; the others evaluate.
    """
    result: dict[int, Direction] = {}
    signs = directions(asked)
    states = [play_states(asked, float(play)) for play in PLAYS]
    for group in GROUPS:
        own = joints_of(group)
        static = _static(asked[:, own])
        parts = [np.hstack([static, state[:, own]]) for state in states]
        bank = np.hstack([static, *(state[:, own] for state in states)])
        turned = np.hstack([static, signs[:, own]])
        for joint in own:
            error = missed[:, joint]
            before = _regressed(static, error, split)
            single = [_regressed(part, error, split) for part in parts]
            best = min(range(len(PLAYS)), key=lambda number: single[number].fitted)
            after = _regressed(bank, error, split).other
            by_sign = _regressed(turned, error, split).other
            result[int(joint)] = Direction(
                static=float(np.sqrt(before.other)),
                play=float(PLAYS[best]),
                by_sign=1.0 - by_sign / before.other,
                by_play=1.0 - single[best].other / before.other,
                by_plays=1.0 - after / before.other,
                left=float(np.sqrt(after)),
                **_one_sided(states[best][:, own] / PLAYS[best], static, error, split),
            )
    return [result[joint] for joint in range(missed.shape[1])]


class _Fit(NamedTuple):
    """Mean squared errors of a regression on the samples that are fitted, and on the others."""

    fitted: float
    other: float


def _static(asked: Floats) -> Floats:
    """Joint angles (N, k) [rad] of a group, their squares and products (N, k + k (k + 1) / 2)."""
    rows, columns = np.triu_indices(asked.shape[1])
    return np.hstack([asked, asked[:, rows] * asked[:, columns]])


def _one_sided(states: Floats, static: Floats, missed: Floats, split: int) -> dict[str, float]:
    """`Direction.one_side` and `Direction.approached` of states (N, k) as shares of the play."""
    ends = np.all(np.abs(states) > AT_END, axis=1)
    fitted, others = int(ends[:split].sum()), int(ends[split:].sum())
    spread = np.nan
    if min(fitted, others) >= LEAST:
        terms = np.hstack([static, np.sign(states)])
        spread = float(np.sqrt(_regressed(terms[ends], missed[ends], fitted).other))
    return {"one_side": spread, "approached": float(ends.mean())}


def spreads(asked: Floats, missed: Floats) -> list[Spread]:
    """Spread of each joint angle at the same motor angles; NaN without any pair.

    Args:
        asked: joint angles by the data sheet (N, 6) [rad], in the order of time.
        missed: measured joint angles minus those of the data sheet (N, 6) [rad], so that small
            differences of the motor angles do not count.
    """
    result: dict[int, Spread] = {}
    signs = directions(asked)
    for group in GROUPS:
        own = joints_of(group)
        near, partners = _near(asked[:, own])
        for joint in own:
            error, sign = missed[:, joint], signs[:, joint]
            same = sign[:, None] == sign[partners]
            opposite = sign[:, None] * sign[partners] < 0.0
            found = _differences(error, partners, near)
            alike = _differences(error, partners, near & same)
            turned = _differences(error, partners, near & opposite, sign)
            result[int(joint)] = Spread(len(found), _rms(found), _rms(alike), _mean(turned))
    return [result[joint] for joint in range(missed.shape[1])]


def _near(asked: Floats) -> tuple[NDArray[np.bool_], NDArray[np.intp]]:
    """Which neighbours (N, c) of each sample are pairs with it, and their indices, shuffled."""
    most = min(CANDIDATES, len(asked))
    away, partners = cKDTree(asked).query(asked, most)
    apart = np.abs(partners - np.arange(len(asked))[:, None]) >= APART
    rng = np.random.default_rng(0)
    order = rng.permuted(np.tile(np.arange(most), (len(asked), 1)), axis=1)
    near = np.take_along_axis((away <= SAME) & apart, order, axis=1)
    return near, np.take_along_axis(partners, order, axis=1)


def _differences(
    values: Floats,
    partners: NDArray[np.intp],
    allowed: NDArray[np.bool_],
    signs: Floats | None = None,
) -> Floats:
    """Differences of samples from their first allowed partners, times the samples' signs."""
    rows = np.flatnonzero(allowed.any(axis=1))
    first = partners[rows, allowed[rows].argmax(axis=1)]
    return (values[rows] - values[first]) * (1.0 if signs is None else signs[rows])


def _rms(differences: Floats) -> float:
    """RMS of values about their means, by differences of pairs; NaN without any."""
    return float(np.sqrt(np.mean(differences**2) / 2.0)) if len(differences) else np.nan


def _mean(differences: Floats) -> float:
    return float(np.mean(differences)) if len(differences) else np.nan


def _regressed(terms: Floats, missed: Floats, split: int) -> _Fit:
    """Ridge regression of the first samples on terms (N, t)."""
    centre, scale = terms[:split].mean(axis=0), terms[:split].std(axis=0)
    scaled = (terms - centre) / np.where(scale > 0.0, scale, 1.0)
    mean = missed[:split].mean()
    matrix = scaled[:split].T @ scaled[:split] + RIDGE * split * np.eye(scaled.shape[1])
    weights = np.linalg.solve(matrix, scaled[:split].T @ (missed[:split] - mean))
    squares = (missed - mean - scaled @ weights) ** 2
    return _Fit(float(squares[:split].mean()), float(squares[split:].mean()))

"""The incremental fit against the full one, on recorded sequences of observations."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pytest

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.prior import MapPrior, PriorOptions
from jmm_agent.types import Floats
from jmm_agent.vision.incremental_fit import fit_incrementally, fit_newest
from jmm_agent.vision.incremental_problem import IncrementalProblem, Rows
from jmm_agent.vision.marker_observation import MarkerObservation, PoseResidual
from jmm_agent.vision.marker_residual import MarkerResidual
from jmm_agent.vision.observation_fit import ObservationFitOptions, ObservationProblem
from jmm_agent.vision.permanent_elongation import fit_with_elongation
from tests.jmm_agent.nominal_arm import ARM, JOINTS, Tendons, posture_set, trained_map
from tests.jmm_agent.small_map import LIMITS, make_map, postures

COUNT = 20
OPTIONS = ObservationFitOptions()
ANGLE = 5e-3
"""Largest difference between the angles of both fits for the arm [rad]; 0.3 deg."""


def marker_residual(q: Floats, pose: Floats, frames: object = None) -> tuple[Floats, Floats]:
    """The marker shows a curved function of the joints."""
    error = np.append(q[:2], [q[2] + 0.3 * np.sin(q[3]), 0.05 * q[3], 0.0, 0.0])
    slope = np.zeros((6, 4))
    slope[0, 0] = slope[1, 1] = slope[2, 2] = 1.0
    slope[2, 3], slope[3, 3] = 0.3 * np.cos(q[3]), 0.05
    return error - np.append(pose[:3, 3], [pose[3, 0], 0.0, 0.0]), slope


COST = 1.0
"""Largest difference of the costs, which are twice a negative log-likelihood."""


class Sequence(NamedTuple):
    """Observations of a robot whose lengths are off by a smooth function of the posture."""

    prior: MapPrior
    observations: list[MarkerObservation]


def record(seed: int, elongated_from: int = COUNT) -> Sequence:
    """Make a sequence; the last muscle elongates by 30 mm at one of the observations."""
    jmm, rng = make_map(seed), np.random.default_rng([seed, 5])
    prior = MapPrior(jmm, postures(100, 8), PriorOptions(shape=0.003, noise=0.0005))
    true = postures(COUNT, seed)
    features = [prior.features(rank, g.hidden(true)) for rank, g in enumerate(jmm.groups)]
    lengths = jmm.lengths(true) + 0.0003 * rng.normal(size=(COUNT, 5))
    for group, phi in zip(jmm.groups, features, strict=True):
        change = rng.normal(size=(phi.shape[1], len(group.muscle_index)))
        lengths[:, group.muscle_index] += phi @ change
    lengths[elongated_from:, 4] += 0.03
    observations = []
    for q, measured in zip(true, lengths, strict=True):
        pose = np.eye(4)
        shown = marker_residual(q, np.zeros((4, 4)))[0]
        pose[:3, 3], pose[3, 0] = shown[:3] + 0.002 * rng.normal(size=3), shown[3]
        observations.append(MarkerObservation(pose, measured, q + 0.1 * rng.normal(size=4)))
    return Sequence(prior, observations)


class Recorded(NamedTuple):
    """What both fits are given."""

    prior: MapPrior
    residual: PoseResidual
    limits: Floats
    observations: list[MarkerObservation]


def grown(recorded: Recorded) -> Iterator[tuple[int, Floats, Floats, Floats, Floats]]:
    """After each observation: count, angles by both fits, and elongations by both fits."""
    prior, residual, limits, observations = recorded
    joints, muscles = len(prior.map.joints), len(prior.map.muscles)
    full = incremental = np.empty((0, joints))
    known = believed = np.empty((0, muscles))
    for k in range(len(observations)):
        given = observations[: k + 1], prior, residual, limits, OPTIONS
        guess, none = observations[k].guess, np.zeros(muscles)
        one, known = fit_with_elongation(*given, np.vstack([full, guess]), np.vstack([known, none]))
        other, believed = fit_incrementally(
            *given, np.vstack([incremental, guess]), np.vstack([believed, none])
        )
        assert other.converged
        full, incremental = one.angles, other.angles
        yield k + 1, full, incremental, known, believed


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("elongated_from", [COUNT, 12])
def test_it_ends_as_low_as_the_full_fit(seed: int, elongated_from: int) -> None:
    prior, observations = record(seed, elongated_from)
    recorded = Recorded(prior, marker_residual, LIMITS, observations)
    for count, full, incremental, known, believed in grown(recorded):
        np.testing.assert_array_equal(believed, known)
        some = observations[:count]
        problem = ObservationProblem(some, prior, marker_residual, OPTIONS, known)
        assert problem.cost(incremental)[0] < problem.cost(full)[0] + COST
    assert bool(known[:, 4].any()) == (elongated_from < COUNT)


def test_on_the_arm_its_angles_are_those_of_the_full_fit(
    request: pytest.FixtureRequest,
) -> None:
    arm, tendons, jmm = ArmKinematics(ARM, JOINTS), Tendons(), trained_map(request)
    prior = MapPrior(jmm, posture_set(), PriorOptions())
    true = posture_set()[np.random.default_rng(0).permutation(len(posture_set()))[:9]]
    lengths = tendons.relative_lengths(true) - tendons.relative_lengths(0.1 * true[0])
    rng = np.random.default_rng(1)
    observations = [
        MarkerObservation(
            arm.pose("marker_hand", q, relative_to="eye"), row, q + 0.05 * rng.normal(size=14)
        )
        for q, row in zip(true, lengths, strict=True)
    ]
    residual = MarkerResidual(arm, "eye", "marker_hand")
    for count, full, incremental, *_ in grown(Recorded(prior, residual, arm.limits, observations)):
        if count > 1:
            np.testing.assert_allclose(incremental, full, atol=ANGLE)


def test_the_cost_and_its_slopes_are_those_of_the_full_problem() -> None:
    prior, observations = record(0)
    rng = np.random.default_rng(0)
    angles = postures(COUNT, 0) + 0.02 * rng.normal(size=(COUNT, 4))
    elongated = np.zeros((COUNT, 5))
    elongated[:7, 4], elongated[:3, 1] = 1.0, 2.0
    full = ObservationProblem(observations, prior, marker_residual, OPTIONS, elongated)
    rows = Rows(prior, marker_residual)
    problem = IncrementalProblem(observations, rows, prior, OPTIONS, elongated)
    np.testing.assert_allclose(problem.cost(angles)[0], full.cost(angles)[0], rtol=1e-9)
    for one, other in zip(
        problem.normal_equations(angles), full.normal_equations(angles), strict=True
    ):
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-6 * np.abs(other).max())


def test_the_newest_alone_is_fitted_to_the_minimum_of_the_full_cost() -> None:
    prior, observations = record(1)
    start, elongated = postures(COUNT, 1).copy(), np.zeros((COUNT, 5))
    start[-1] = observations[-1].guess
    found = fit_newest(observations, prior, marker_residual, LIMITS, OPTIONS, start, elongated)
    np.testing.assert_array_equal(found.angles[:-1], start[:-1])
    full = ObservationProblem(observations, prior, marker_residual, OPTIONS, elongated)
    least = full.cost(found.angles)[0]
    for move in 0.003 * np.vstack([np.eye(4), -np.eye(4)]):
        moved = found.angles.copy()
        moved[-1] = np.clip(moved[-1] + move, *LIMITS.T)
        assert full.cost(moved)[0] > least - OPTIONS.gain


def test_a_fit_keeps_nothing_for_the_next_one() -> None:
    prior, observations = record(2)
    start, elongated = postures(COUNT, 2), np.zeros((COUNT, 5))
    arguments = (observations, prior, marker_residual, LIMITS, OPTIONS, start, elongated)
    first, second = fit_incrementally(*arguments)[0], fit_incrementally(*arguments)[0]
    np.testing.assert_array_equal(first.angles, second.angles)

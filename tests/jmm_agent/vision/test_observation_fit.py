"""Marker observations fitted together show joint angles that none of them shows alone."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.kinematics.bounded_least_squares import minimise
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.prior import MapPrior, PriorOptions
from jmm_agent.vision.marker_residual import MarkerResidual
from jmm_agent.vision.observation_fit import (
    MarkerObservation,
    ObservationFit,
    ObservationFitOptions,
    fit_alone,
    fit_observations,
)
from tests.jmm_agent.nominal_arm import Tendons, posture_set

COUNT = 10
MISTAKE = np.radians([2, -2, 1, 8, -7, 6, 7, -15, 14, 16, -14, 6, -6, 5])
"""Posture (14,) [rad] at which the lengths were zeroed."""


@pytest.fixture(scope="module")
def marker_residual(arm: ArmKinematics) -> MarkerResidual:
    return MarkerResidual(arm, "eye", "marker_hand")


@pytest.fixture(scope="module")
def prior(nominal_map: JointMuscleMap) -> MapPrior:
    return MapPrior(nominal_map, posture_set(), PriorOptions())


def estimate(nominal_map: JointMuscleMap, lengths: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """Joint angles (14,) [rad] by the nominal map from lengths (36,) [m]."""

    def residual(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        expected, jacobian = nominal_map.lengths_and_jacobian(q)
        return expected - lengths, jacobian

    middle = posture_set().mean(axis=0)
    return minimise(residual, middle, *limits.T, 1e-8 * np.eye(14), 60).x


@pytest.fixture(scope="module")
def true() -> np.ndarray:
    order = np.random.default_rng(0).permutation(len(posture_set()))
    return posture_set()[order[:COUNT]]


@pytest.fixture(scope="module")
def observations(
    true: np.ndarray, nominal_map: JointMuscleMap, arm: ArmKinematics
) -> list[MarkerObservation]:
    """Exact observations of a robot that is the nominal model but for its zero."""
    tendons = Tendons()
    lengths = tendons.relative_lengths(true) - tendons.relative_lengths(MISTAKE)
    return [
        MarkerObservation(
            arm.pose("marker_hand", q, relative_to="eye"),
            row,
            estimate(nominal_map, row, arm.limits),
        )
        for q, row in zip(true, lengths, strict=True)
    ]


@pytest.fixture(scope="module")
def fit(
    observations: list[MarkerObservation],
    prior: MapPrior,
    marker_residual: MarkerResidual,
    arm: ArmKinematics,
) -> ObservationFit:
    return fit_observations(
        observations, prior, marker_residual, arm.limits, ObservationFitOptions(steps=40)
    )


def rms_deg(error: np.ndarray) -> float:
    return float(np.degrees(np.sqrt(np.mean(error**2))))


def test_planted_offsets_are_seen_through(
    observations: list[MarkerObservation], fit: ObservationFit, true: np.ndarray, arm: ArmKinematics
) -> None:
    before = rms_deg(np.array([found.guess for found in observations]) - true)
    assert before > 5.0
    assert fit.converged
    assert rms_deg(fit.angles - true) < before / 3
    assert fit.residual_norms[:, 0].max() < 0.003
    assert fit.residual_norms[:, 1].max() < 0.02
    alone = [
        arm.solve(
            "marker_hand", found.pose, found.guess, "eye", prior_precision=np.full(14, 1e-8)
        ).q
        for found in observations
    ]
    assert rms_deg(np.array(alone) - true) > before / 3


def test_the_gradient_vanishes_where_the_fit_ends(
    observations: list[MarkerObservation],
    fit: ObservationFit,
    prior: MapPrior,
    marker_residual: MarkerResidual,
    arm: ArmKinematics,
) -> None:
    """The cost is written out from the module's docstring; a step from the end must not lower it.

    Only in joints that are inside their box: at a limit the cost may go on falling outside.
    """
    options = ObservationFitOptions()
    lengths = np.array([found.lengths for found in observations])

    def cost(angles: np.ndarray) -> float:
        errors = np.array(
            [
                marker_residual(q, found.pose)[0]
                for q, found in zip(angles, observations, strict=True)
            ]
        )
        total = np.sum((errors[:, :3] / options.position_noise) ** 2)
        total += np.sum((errors[:, 3:] / options.rotation_noise) ** 2)
        residual = lengths - prior.map.lengths(angles)
        for group in prior.groups(angles):
            kernel = group.features @ group.features.T + prior.options.noise**2 * np.eye(COUNT)
            mine = residual[:, group.muscles]
            total += np.sum(mine * np.linalg.solve(kernel, mine))
        return float(total)

    least = cost(fit.angles)
    rng = np.random.default_rng(0)
    low, high = arm.limits[:, 0] - 0.02, arm.limits[:, 1] + 0.02
    for _ in range(20):
        step = rng.normal(0.0, 0.02, fit.angles.shape)
        assert cost(np.clip(fit.angles + step, low, high)) > least
    assert cost(np.array([found.guess for found in observations])) > least


def test_angles_stay_inside_the_limits(
    observations: list[MarkerObservation],
    prior: MapPrior,
    marker_residual: MarkerResidual,
    arm: ArmKinematics,
) -> None:
    middle = posture_set().mean(axis=0)
    narrow = np.clip(np.column_stack([middle - 0.1, middle + 0.1]), *arm.limits.T[:, :, None])
    fit = fit_observations(
        observations, prior, marker_residual, narrow, ObservationFitOptions(limit_margin=0.0)
    )
    assert np.all(fit.angles >= narrow[:, 0])
    assert np.all(fit.angles <= narrow[:, 1])
    assert np.any((fit.angles == narrow[:, 0]) | (fit.angles == narrow[:, 1]))
    assert fit.residual_norms[:, 0].max() > 0.01


def test_a_first_observation_of_a_robot_far_from_nominal_is_explained(
    true: np.ndarray,
    nominal_map: JointMuscleMap,
    arm: ArmKinematics,
    prior: MapPrior,
    marker_residual: MarkerResidual,
) -> None:
    """Its guesses have joints at their limits: the fit must hold them there and move the others."""
    low, high = arm.limits.T
    tendons = Tendons()
    lengths = tendons.relative_lengths(true) - tendons.relative_lengths(1.5 * MISTAKE)
    guesses = np.array([estimate(nominal_map, row, arm.limits) for row in lengths])
    assert np.count_nonzero(np.any((guesses <= low) | (guesses >= high), axis=1)) >= COUNT / 2
    for q, row, guess in zip(true, lengths, guesses, strict=True):
        found = MarkerObservation(arm.pose("marker_hand", q, relative_to="eye"), row, guess)
        fit = fit_observations([found], prior, marker_residual, arm.limits, ObservationFitOptions())
        assert fit.converged
        assert fit.residual_norms[0, 0] < 0.003
        assert fit.residual_norms[0, 1] < 0.01


def test_a_fit_that_is_cut_short_has_not_converged(
    observations: list[MarkerObservation],
    prior: MapPrior,
    marker_residual: MarkerResidual,
    arm: ArmKinematics,
) -> None:
    assert not fit_observations(
        observations, prior, marker_residual, arm.limits, ObservationFitOptions(steps=1)
    ).converged


def test_where_it_starts_does_not_matter_and_the_end_is_kept(
    observations: list[MarkerObservation],
    fit: ObservationFit,
    prior: MapPrior,
    marker_residual: MarkerResidual,
    arm: ArmKinematics,
) -> None:
    options = ObservationFitOptions(steps=40)
    near = fit.angles + np.random.default_rng(0).normal(0.0, 0.02, fit.angles.shape)
    again = fit_observations(observations, prior, marker_residual, arm.limits, options, near)
    np.testing.assert_allclose(again.angles, fit.angles, atol=0.02)
    warm = fit_observations(
        observations, prior, marker_residual, arm.limits, ObservationFitOptions(steps=2), fit.angles
    )
    assert warm.converged
    np.testing.assert_allclose(warm.angles, fit.angles, atol=2e-3)


def test_an_observation_alone_is_explained_but_leaves_the_joints_wrong(
    observations: list[MarkerObservation],
    true: np.ndarray,
    marker_residual: MarkerResidual,
    arm: ArmKinematics,
) -> None:
    """As the paper's inverse kinematics, it explains the marker by the least movement."""
    alone = [
        fit_alone(found, marker_residual, arm.limits, ObservationFitOptions())
        for found in observations
    ]
    angles = np.concatenate([fit.angles for fit in alone])
    guesses = np.array([found.guess for found in observations])
    assert all(fit.converged for fit in alone)
    assert np.max([fit.residual_norms for fit in alone]) < 1e-3
    assert np.all(np.linalg.norm(angles - guesses, axis=1) < np.linalg.norm(true - guesses, axis=1))
    assert rms_deg(angles - true) > 0.5 * rms_deg(guesses - true)

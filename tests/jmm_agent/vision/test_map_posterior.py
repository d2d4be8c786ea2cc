"""Posterior of a robot's lengths, and what a further look is expected to tell."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import block_diag

from jmm_agent.errors import AgentError
from jmm_agent.mapping.prior import MapPrior, PointWeights
from jmm_agent.types import Floats
from jmm_agent.vision.hand_error import HandPostures, followed
from jmm_agent.vision.map_posterior import MapPosterior
from jmm_agent.vision.observation_fit import ObservationFitOptions
from jmm_agent.vision.observation_gain import information, observation_gains
from jmm_agent.vision.prior_widths import PriorWidths
from jmm_agent.vision.rest_fit import Rest, RestProblem
from tests.jmm_agent.vision.seen_robots import (
    LEVER,
    POSITION_NOISE,
    PRIOR,
    SeenRobot,
    hand_postures,
    make_map,
    marker_residual,
    postures,
)

WIDTHS = PriorWidths(PRIOR.zeroed_offset, PRIOR.zeroed_shape, PRIOR.zero_posture, PRIOR.points)
NOISE = PRIOR.noise


def problem(
    robot: SeenRobot, seen: Floats, rested: Floats, points: PointWeights | None = None
) -> tuple[RestProblem, Floats]:
    """Problem of postures that are seen or only rested (., 4) [rad], and its unknown angles."""
    prior = MapPrior(make_map(), postures(100, 8), PRIOR, points)
    observations = [robot.observation(q) for q in seen]
    rests = [Rest(robot.lengths(q), np.full(8, np.nan), q) for q in rested]
    options, none = ObservationFitOptions(), np.zeros((len(seen), 8))
    found = RestProblem(observations, rests, prior, WIDTHS, marker_residual, None, options, none)
    return found, np.vstack([seen, rested, 0.05 * np.ones((1, 4))])


def posterior(robot: SeenRobot, seen: Floats, rested: Floats) -> MapPosterior:
    one, unknown = problem(robot, seen, rested)
    return MapPosterior(one.prior, one.linearised(unknown))


def dense(one: RestProblem, unknown: Floats, seen: int, at: Floats) -> tuple[Floats, Floats]:
    """Mean (P, 8) and covariance (P 8, P 8) of the lengths by all unknown numbers explicitly.

    The unknown numbers are all joint angles, the zero posture, and the weights of the features.
    """
    nominal, count = one.prior.map, len(unknown) - 1
    rank = {int(m): r for r, g in enumerate(nominal.groups) for m in g.muscle_index}

    def phi(m: int, at: Floats) -> Floats:
        own = one.prior.features(rank[m], nominal.groups[rank[m]].hidden(at))
        return one.prior.completed(rank[m], own, np.array([m]))

    features = [phi(m, unknown[:-1]) for m in range(8)]
    others = [phi(m, at) for m in range(8)]
    sizes = [own.shape[1] for own in features]
    starts = 4 * (count + 1) + np.concatenate([[0], np.cumsum(sizes)])
    arms, zero_arms = nominal.jacobian(unknown[:-1]), nominal.jacobian(unknown[-1])
    lengths = nominal.lengths(unknown[:-1]) - nominal.lengths(unknown[-1])
    rows, missed = np.zeros((count, 8, starts[-1])), one._lengths - lengths
    predict = np.zeros((len(at), 8, starts[-1]))
    for m in range(8):
        own = slice(starts[m], starts[m + 1])
        for k in range(count):
            rows[k, m, 4 * k : 4 * k + 4] = arms[k, m]
            rows[k, m, 4 * count : 4 * count + 4] = -zero_arms[m]
            rows[k, m, own] = features[m][k]
        predict[:, m, 4 * count : 4 * count + 4] = -zero_arms[m]
        predict[:, m, own] = others[m]
    flat = rows.reshape(-1, starts[-1])
    poses = [LEVER.T @ LEVER / POSITION_NOISE**2] * seen + [np.zeros((4, 4))] * (count - seen)
    prior = block_diag(*poses, np.eye(4) / WIDTHS.zero**2, np.eye(int(sum(sizes))))
    covariance = np.linalg.inv(flat.T @ flat / NOISE**2 + prior)
    # Given the angles as they are, the weights have this mean.
    weights = slice(4 * (count + 1), None)
    inner = np.linalg.inv(
        flat[:, weights].T @ flat[:, weights] / NOISE**2 + np.eye(int(sum(sizes)))
    )
    mean = inner @ flat[:, weights].T @ missed.ravel() / NOISE**2
    expected = nominal.lengths(at) - nominal.lengths(unknown[-1])
    outer = predict.reshape(-1, starts[-1])
    return expected + (outer[:, weights] @ mean).reshape(-1, 8), outer @ covariance @ outer.T


@pytest.mark.parametrize("displaced", [False, True])
@pytest.mark.parametrize(("seen", "rested"), [(3, 0), (2, 3), (0, 4), (0, 0)])
def test_it_is_the_marginal_of_the_posterior_of_all_unknowns(
    seen: int, rested: int, displaced: bool
) -> None:
    robot, at, points = SeenRobot(3), postures(4, 41), None
    if displaced:
        rng = np.random.default_rng(1)
        points = tuple(rng.normal(size=(*g.W2.shape, 3)) for g in make_map().groups)
    one, unknown = problem(robot, postures(seen, 2), postures(rested, 3), points)
    found = MapPosterior(one.prior, one.linearised(unknown))
    mean, covariance = dense(one, unknown, seen, at)
    np.testing.assert_allclose(found.lengths(at), mean, atol=2e-6)
    all_lengths = found.project(at, np.tile(np.eye(8), (4, 1, 1)))
    mutual = found.covariance(all_lengths, all_lengths)
    scale = np.abs(covariance).max()
    np.testing.assert_allclose(mutual.reshape(32, 32), covariance, atol=1e-4 * scale)
    own = found.own_covariance(all_lengths)
    np.testing.assert_allclose(own, [mutual[p, :, p] for p in range(4)], atol=1e-10 * scale)


def gain(robot: SeenRobot, seen: Floats, candidates: Floats, judged: HandPostures) -> Floats:
    """Expected error of the hand after a look at each candidate [m]."""
    nominal = MapPrior(make_map(), postures(100, 8), PRIOR).map
    weight = LEVER.T @ LEVER / POSITION_NOISE**2
    shown = np.array([information(nominal.jacobian(q), weight, NOISE) for q in candidates])
    rows = judged.rows(nominal, NOISE)
    follows = followed(nominal, candidates, NOISE, judged.widest)
    found = posterior(robot, seen, np.empty((0, 4)))
    return observation_gains(found, judged, rows, candidates, shown, follows).after


def test_an_observation_lowers_the_error_as_was_expected_whatever_it_shows() -> None:
    """The posterior after it, with the look in the fit, has the expected error of the hand."""
    judged, candidates, seen = hand_postures(), postures(5, 50), postures(2, 2)
    nominal = MapPrior(make_map(), postures(100, 8), PRIOR).map
    rows = judged.rows(nominal, NOISE)
    expected = gain(SeenRobot(3), seen, candidates, judged)
    for number, q in enumerate(candidates):
        after = posterior(SeenRobot(7), np.vstack([seen, q]), np.empty((0, 4)))
        spread = after.own_covariance(after.project(judged.postures, rows))
        reached = np.sqrt(np.mean(np.trace(spread, axis1=1, axis2=2)))
        assert reached == pytest.approx(expected[number], rel=0.02)
    assert np.ptp(expected) > 0.05 * expected.mean()  # the candidates differ


def test_a_second_observation_of_a_posture_is_worth_less_than_one_of_another() -> None:
    judged, seen = hand_postures(), postures(1, 2)
    candidates = np.vstack([seen, postures(6, 50)])
    after = gain(SeenRobot(3), seen, candidates, judged)
    assert after[0] > np.median(after[1:])


def test_a_camera_with_less_noise_is_worth_more() -> None:
    q = postures(1, 4)[0]
    arms = make_map().jacobian(q)
    coarse, fine = (
        information(arms, LEVER.T @ LEVER / noise**2, NOISE) for noise in (0.03, 0.0003)
    )
    values = np.linalg.eigvalsh(fine @ fine.T - coarse @ coarse.T)
    assert values.min() > -1e-6 * values.max()
    assert values.max() > 0.0


@pytest.mark.parametrize(("noise", "widest"), [(0.0, 0.1), (0.001, 0.0)])
def test_the_error_of_the_hand_needs_noise_and_width(noise: float, widest: float) -> None:
    with pytest.raises(AgentError, match="both must be positive"):
        followed(make_map(), postures(2, 1), noise, widest)

"""Fit of all rests: zero posture, balance of tensions and loads, widths of the prior.

The robot has the small map's five muscles and four joints, and was zeroed at another posture. Its
loads are a made-up function of the posture, and its tensions balance them.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.mapping.group_map import METRES
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import BatchOptions, Learner, Pairs, RidgeRule, Rule
from jmm_agent.mapping.prior import MapPrior, PriorOptions
from jmm_agent.types import Floats
from jmm_agent.updaters import VisionOptions, VisionUpdater
from jmm_agent.vision.balance import Balance, BalanceOptions
from jmm_agent.vision.marker_observation import MarkerObservation
from jmm_agent.vision.observation_fit import ObservationFitOptions
from jmm_agent.vision.prior_widths import PriorWidths
from jmm_agent.vision.rest_fit import Rest, RestFit, RestProblem, fit_rests
from tests.jmm_agent.small_map import LIMITS, make_map, postures
from tests.jmm_agent.test_updaters import marker_residual, picture

ZERO = np.array([0.25, -0.2, 0.15, 0.3])
"""Posture at which the robot was zeroed [rad]."""
USUAL = PriorWidths(0.003, 0.0025, 0.25, 0.004)
OPTIONS = ObservationFitOptions()
WIDE = np.column_stack([LIMITS[:, 0] - 1.0, LIMITS[:, 1] + 1.0])
"""Limits beyond which no posture of the tests is [rad]."""


def tensions_at(q: Floats) -> Floats:
    """Tensions (5,) [N] that balance the loads at joint angles (4,) [rad]."""
    turns = np.arange(20.0).reshape(5, 4) % 7.0 - 3.0
    return np.asarray(120.0 + 60.0 * np.sin(turns @ q))


class MadeUpLoads:
    """Loads that differ from posture to posture, some 2 N m."""

    def gravity(self, posture: Floats) -> Floats:
        return np.asarray(tensions_at(posture) @ make_map(0).jacobian(posture))


def lengths_at(q: Floats, offset: Floats | float = 0.0) -> Floats:
    """Lengths (5,) or (K, 5) [m] of the robot."""
    return make_map(0).lengths(q) - make_map(0).lengths(ZERO) + offset


def problem(
    seen: Floats, rested: Floats, balance: bool, widths: PriorWidths = USUAL, offset: float = 0.0
) -> RestProblem:
    """Problem of postures that are seen, and of others that are only rested (., 4) [rad]."""
    prior = MapPrior(make_map(0), postures(100, 8), PriorOptions())
    observations = [
        MarkerObservation(picture(q), lengths_at(q, offset), q, tensions=tensions_at(q))
        for q in seen
    ]
    rests = [Rest(lengths_at(q, offset), tensions_at(q), q) for q in rested]
    exact = BalanceOptions(share=0.05, noise=0.05)
    rows = Balance(prior.map, MadeUpLoads(), WIDE, exact) if balance else None
    none = np.zeros((len(seen), 5))
    return RestProblem(observations, rests, prior, widths, marker_residual, rows, OPTIONS, none)


def fitted(seen: Floats, rested: Floats, balance: bool, **more: object) -> RestFit:
    """Fit of `problem` from postures that are off."""
    count = len(seen) + len(rested)
    off = 0.1 * np.random.default_rng(5).standard_normal((count, 4))
    start = np.vstack([*seen, *rested])[:count] + off
    start = np.vstack([start, np.zeros(4)])
    one = problem(seen, rested, balance, **more)  # type: ignore[arg-type]
    return fit_rests(one, start, WIDE, OPTIONS, len(seen), USUAL)


NONE = np.empty((0, 4))


@pytest.mark.parametrize("balance", [False, True])
def test_the_gradient_is_that_of_the_cost(balance: bool) -> None:
    subject = problem(postures(3, 2), postures(2, 3), balance)
    at = np.vstack([postures(5, 9), 0.1 * np.ones((1, 4))])
    gradient = subject.normal_equations(at)[1]
    numeric = np.empty(at.size)
    for i in range(at.size):
        step = np.zeros(at.size)
        step[i] = 1e-6
        costs = [subject.cost(at + sign * step.reshape(at.shape))[0] for sign in (1.0, -1.0)]
        numeric[i] = (costs[0] - costs[1]) / 4e-6  # half the slope of the cost
    # The kernel, and the variance of the balance, are held fixed in the gradient: z has neither.
    np.testing.assert_allclose(gradient[-4:], numeric[-4:], rtol=1e-6)


def test_the_slope_of_the_balance_is_that_of_its_cost_where_its_variance_is_constant() -> None:
    balance = Balance(make_map(0), MadeUpLoads(), WIDE, BalanceOptions(share=0.0))
    q, tensions = postures(2, 3), np.array([[20.0, 5.0, 30.0, 12.0, 8.0], [5.0, 9.0, 0.0, 40.0, 3]])
    gradient = balance.normal_equations(q, tensions)[1]
    steps = 1e-5 * np.eye(8).reshape(8, 2, 4)
    numeric = [
        (balance.cost(q + step, tensions) - balance.cost(q - step, tensions)) / 4e-5
        for step in steps
    ]
    np.testing.assert_allclose(gradient.ravel(), numeric, rtol=1e-3)


def test_the_matrix_of_the_balance_is_the_curvature_of_its_cost_where_it_is_balanced() -> None:
    """There the cost is quadratic, and moment arms that are off make rests depend on each other."""
    options = BalanceOptions(share=0.0, freedom=1e9)
    balance = Balance(make_map(0), MadeUpLoads(), WIDE, options)
    q = postures(3, 3)
    tensions = np.array([tensions_at(one) for one in q])
    matrix = balance.normal_equations(q, tensions)[0].reshape(12, 12)
    steps = 1e-4 * np.eye(12).reshape(12, 3, 4)

    def cost(move: Floats) -> float:
        return balance.cost(q + move, tensions) / 2e-8

    singles = np.array([cost(step) for step in steps])
    pairs = np.array([[cost(one + other) for other in steps] for one in steps])
    numeric = pairs - singles[:, None] - singles
    scale = np.abs(matrix).max()
    np.testing.assert_allclose(matrix, numeric, atol=5e-3 * scale)
    assert np.abs(matrix[:4, 4:8]).max() > 0.01 * scale


def test_wrong_moment_arms_are_separated_from_a_wrong_posture() -> None:
    """The same arms at all rests leave the balance nearly as likely as exact ones do."""
    arms = 0.006 * np.random.default_rng(4).standard_normal((5, 4))
    arms[make_map(0).jacobian(postures(1, 1)[0]) == 0.0] = 0.0

    class Displaced(MadeUpLoads):
        def gravity(self, posture: Floats) -> Floats:
            return super().gravity(posture) + tensions_at(posture) @ arms

    q = postures(12, 3)
    tensions = np.array([tensions_at(one) for one in q])
    options = BalanceOptions(share=0.05, noise=0.05)
    rigid = BalanceOptions(arm=0.0, share=0.05, noise=0.05)
    moved, exact = (
        Balance(make_map(0), loads, WIDE, options) for loads in (Displaced(), MadeUpLoads())
    )
    believed = Balance(make_map(0), Displaced(), WIDE, rigid)
    assert moved.cost(q, tensions) < exact.cost(q, tensions) + 3 * arms.size
    assert moved.cost(q, tensions) < 0.5 * believed.cost(q, tensions)


@pytest.mark.parametrize("side", [-1, 1])
def test_a_stop_pushes_back_but_does_not_pull(side: int) -> None:
    """The missing torque of one joint is reversed; the stop explains one direction only."""
    q = postures(1, 3)[0]
    limits = WIDE.copy()
    limits[2] = (q[2], 3.0) if side < 0 else (-3.0, q[2])

    class Pushed(MadeUpLoads):
        def __init__(self, push: float) -> None:
            self.push = push

        def gravity(self, posture: Floats) -> Floats:
            return super().gravity(posture) - self.push * np.eye(4)[2]

    tensions = tensions_at(q)
    options = BalanceOptions(arm=0.0, share=0.1)
    costs = [
        Balance(make_map(0), Pushed(push), limits, options).cost(q[None], tensions[None])
        for push in (-5.0 * side, 5.0 * side)
    ]
    assert costs[0] < 0.1 * costs[1]


def test_observations_show_the_zero_posture() -> None:
    found = fitted(postures(6, 2), NONE, balance=False)
    shift = make_map(0).lengths(ZERO)
    missed = make_map(0).lengths(found.zero) - shift
    assert np.abs(missed).max() < 0.2 * np.abs(shift).max()
    np.testing.assert_allclose(found.observed.angles, postures(6, 2), atol=0.01)


def test_tensions_show_the_postures_of_rests_that_were_not_seen() -> None:
    rested = postures(8, 4)
    errors = []
    for balance in (False, True):
        found = fitted(NONE, rested, balance)
        errors.append(np.sqrt(np.mean((found.rests - rested) ** 2)))
        assert len(found.observed.angles) == 0
    assert errors[1] < 0.5 * errors[0]


@pytest.mark.parametrize("offset", [0.0, 0.02])
def test_the_width_of_offsets_follows_the_robot(offset: float) -> None:
    """Offsets of 20 mm, which no zero posture explains, or none."""
    signs = offset * np.array([1.0, -1.0, 1.0, 1.0, -1.0])
    widths = USUAL
    for _ in range(5):
        widths = fitted(postures(10, 2), NONE, False, widths=widths, offset=signs).widths  # type: ignore[arg-type]
    if offset:
        assert 2.0 * USUAL.offset < widths.offset < 1.5 * offset
    else:
        assert widths[:2] == USUAL[:2]


def updater(
    rule: Rule | None = None, widths: PriorOptions | None = None, **options: object
) -> VisionUpdater:
    prior = MapPrior(make_map(0), postures(100, 8), widths or PriorOptions())
    rng = np.random.default_rng(0)
    learner = Learner(make_map(0), LIMITS, rule or RidgeRule(prior), BatchOptions(), rng)
    chosen = VisionOptions(**options)  # type: ignore[arg-type]
    return VisionUpdater(learner, prior, marker_residual, WIDE, chosen, MadeUpLoads())


@pytest.fixture(scope="module")
def error_without_tensions() -> float:
    """RMS error of a map that is learned without tensions [m]."""
    vision = updater(saturation=np.inf)
    for q in postures(6, 4):
        lengths = lengths_at(q)
        assert vision.seen(picture(q), q + 0.05, lengths, lengths, np.zeros(5)).learned
    return map_error(vision)


def map_error(vision: VisionUpdater) -> float:
    """RMS error of the map over other postures [m]."""
    test = postures(40, 6)
    return float(np.sqrt(np.mean((vision._learner.map.lengths(test) - lengths_at(test)) ** 2)))


def test_a_map_is_corrected_before_the_hand_is_seen() -> None:
    vision = updater()
    before, moved = map_error(vision), []
    for q in postures(10, 4):
        moved.append(vision.rested(Rest(lengths_at(q), tensions_at(q), q + 0.1)) is not None)
        assert vision.rested(Rest(lengths_at(q), tensions_at(q), q)) is None  # the same rest again
    assert moved == [False] * 4 + [True] * 6
    assert map_error(vision) < 0.5 * before


def test_without_loads_or_with_another_fit_nothing_is_learned_from_rests_alone() -> None:
    for vision in (updater(fit="together"), updater(balance=BalanceOptions(rests=0, blind=0))):
        for q in postures(10, 4):
            assert vision.rested(Rest(lengths_at(q), tensions_at(q), q)) is None
        assert vision.zero is None


def test_a_rest_that_is_seen_later_is_not_counted_twice() -> None:
    vision = updater()
    for q in postures(3, 4):
        vision.rested(Rest(lengths_at(q), tensions_at(q), q))
    assert len(vision.memory.rests.rests) == 3
    lengths = lengths_at(q)
    assert vision.seen(picture(q), q + 0.05, lengths, lengths, tensions_at(q)).learned
    assert len(vision.memory.rests.rests) == 2
    vision.begin()
    assert vision.memory.rests.rests == ()
    assert vision.zero is not None


@pytest.mark.parametrize(
    ("factor", "unbalanced"), [(1.0, False), (0.1, True), (10.0, True), (-1.0, True), (0.0, True)]
)
def test_tensions_in_another_unit_or_sign_are_not_believed(
    factor: float, unbalanced: bool, error_without_tensions: float
) -> None:
    """The map is then learned as if there were none."""
    vision = updater(saturation=np.inf)
    for q in postures(6, 4):
        lengths = lengths_at(q)
        tensions = factor * tensions_at(q)
        assert vision.seen(picture(q), q + 0.05, lengths, lengths, tensions).learned
    ratio = vision.memory.rests.unbalanced
    assert (ratio is not None) == unbalanced
    assert map_error(vision) < 1.1 * error_without_tensions
    if factor > 0.0 and ratio is not None:
        assert 0.5 < ratio * factor < 2.0


def test_loads_that_are_too_small_show_nothing_of_tensions() -> None:
    class NoLoads:
        def gravity(self, posture: Floats) -> Floats:
            return np.zeros(4)

    balance = Balance(make_map(0), NoLoads(), WIDE, BalanceOptions())
    q = postures(3, 4)
    assert np.isnan(balance.scale(q, np.array([tensions_at(one) for one in q])))
    assert np.isnan(balance.scale(q[:0], np.empty((0, 5))))


def test_a_tension_that_is_no_number_is_not_learned_from() -> None:
    vision, q = updater(), postures(1, 4)[0]
    broken = tensions_at(q)
    broken[2] = np.nan
    assert vision.rested(Rest(lengths_at(q), broken, q)) is None
    assert vision.memory.rests.rests == ()
    lengths = lengths_at(q)
    seen = vision.seen(picture(q), q + 0.05, lengths, lengths, broken)
    assert seen.learned
    assert np.isfinite(seen.angles).all()
    assert vision.zero is not None
    assert np.isfinite(vision.zero).all()
    assert vision.dropped == {}
    assert len(vision.pairs.postures) == 1


def test_a_robot_that_is_zeroed_again_before_it_is_seen_begins_again() -> None:
    vision = updater()
    for q in postures(6, 4):
        vision.rested(Rest(lengths_at(q), tensions_at(q), q + 0.1))
    assert vision.zero is not None
    vision.zeroed()
    assert vision.zero is None
    test = postures(5, 6)
    np.testing.assert_array_equal(vision._learner.map.lengths(test), make_map(0).lengths(test))


class PlainRule:
    """A rule with one method."""

    def move(self, current: JointMuscleMap, remembered: Pairs, batch: Pairs) -> JointMuscleMap:
        return current


def test_a_rule_without_a_prior_learns_from_observations_only() -> None:
    vision = updater(rule=PlainRule())
    for q in postures(6, 4):
        assert vision.rested(Rest(lengths_at(q), tensions_at(q), q)) is None
    lengths = lengths_at(q)
    assert vision.seen(picture(q), q + 0.05, lengths, lengths, tensions_at(q)).learned


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"noise": 0.0}, "noise is 0.0, but must be positive and finite"),
        ({"freedom": np.inf}, "freedom is inf"),
        ({"share": -0.1}, "share is -0.1, but must be at least 0"),
        ({"rests": 3}, "rests is 3 and blind is 5"),
    ],
)
def test_options_out_of_range_are_refused(wrong: dict[str, Any], text: str) -> None:
    with pytest.raises(AgentError, match=text):
        BalanceOptions(**wrong)


def test_it_takes_three_rests_to_name_wrong_tensions() -> None:
    vision, named = updater(), []
    for q in postures(4, 4):
        lengths = lengths_at(q)
        vision.seen(picture(q), q + 0.05, lengths, lengths, 0.1 * tensions_at(q))
        named.append(vision.memory.rests.unbalanced is not None)
    assert named == [False, False, True, True]


def test_a_change_of_all_lengths_is_no_reason_to_widen_the_prior() -> None:
    """All muscles are elongated by 40 mm at once: a step each, and not a model that is wrong."""
    vision = updater()
    for k, q in enumerate(postures(14, 4)):
        lengths = lengths_at(q, 0.04 if k >= 7 else 0.0)
        assert vision.seen(picture(q), q + 0.02, lengths, lengths, tensions_at(q)).learned
    widths = vision.memory.rests.widths
    assert widths is not None
    assert widths.shape < 2.0 * PriorOptions().zeroed_shape
    np.testing.assert_array_equal(vision.elongated.sum(axis=0), np.full(5, 7.0))


@pytest.mark.parametrize(
    ("zero", "offset", "shape", "rests", "exact"),
    [
        pytest.param(0.0, 1.0, 1.0, 8, True, id="usual errors, zeroed exactly"),
        pytest.param(0.0, 1.0, 6.0, 8, True, id="a shape that is far off"),
        pytest.param(0.0, 1.0, 1.0, 14, True, id="still so when it is no longer asked"),
        pytest.param(1.0, 1.0, 1.0, 8, False, id="zeroed elsewhere"),
        pytest.param(0.15, 0.2, 0.2, 8, False, id="all errors are small"),
    ],
)
@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_the_first_rests_decide_whether_the_lengths_were_zeroed_exactly(
    zero: float, offset: float, shape: float, rests: int, exact: bool, seed: int
) -> None:
    """Errors of lengths in units of the usual ones, and the share of `ZERO`."""
    size, rng, layers = 0.0005, np.random.default_rng(seed), {}
    vision = updater(widths=PriorOptions(zeroed_offset=size, zeroed_shape=size))
    errors = PriorOptions(offset=offset * size, shape=shape * size)
    prior = MapPrior(make_map(0), postures(100, 8), errors)
    for rank, group in enumerate(prior.map.groups):
        change = rng.standard_normal((1 + group.b1.size, group.b2.size)) / METRES
        layers[group.name] = prior._layer(rank, group, change)
    other = prior.map.with_output_layers(layers)
    for q in postures(rests, 4):
        lengths = other.lengths(q) - other.lengths(zero * ZERO)
        vision.seen(picture(q), q + 0.05, lengths, lengths, tensions_at(q))
    widths = vision.memory.rests.widths
    assert widths is not None
    assert (widths.zero < 0.4 * USUAL.zero) == exact


def test_the_evidence_of_widths_is_that_of_a_gaussian_where_all_is_linear() -> None:
    """With other widths of the offsets it changes as the probability of the lengths does."""
    seen = postures(3, 2)
    count, joints = 4, 4
    found = {}
    for offset in (0.003, 0.006):
        subject = problem(seen, NONE, balance=False, widths=USUAL._replace(offset=offset))
        start = np.vstack([seen, ZERO])
        fit = fit_rests(subject, start, WIDE, OPTIONS, 3, None)
        unknown = fit.unknown
        rows, cost = [], subject.cost(unknown)[0]
        matrix = subject.normal_equations(unknown)[0]
        precision = np.linalg.cholesky(matrix)
        rng = np.random.default_rng(3)
        for _ in range(1000):
            step = np.linalg.solve(precision.T, rng.standard_normal(count * joints))
            other = subject.cost(unknown + step.reshape(count, joints))[0]
            rows.append(-0.5 * (other - cost) + 0.5 * step @ matrix @ step)
        correction = np.log(np.mean(np.exp(np.clip(rows, -20.0, 20.0))))
        kernels = subject.prior.groups(unknown[:-1], elongated=np.zeros((3, 5)))
        spread = sum(len(one.muscles) * one.log_det for one in kernels)
        integral = -0.5 * (cost + spread + np.linalg.slogdet(matrix)[1]) + correction
        found[offset] = subject.log_evidence(unknown), integral
    laplace, sampled = (found[0.006][i] - found[0.003][i] for i in (0, 1))
    assert laplace == pytest.approx(sampled, abs=0.3)


@pytest.mark.parametrize("loaded", [0, 3])
def test_the_mass_of_a_load_is_separated_from_wrong_moment_arms(loaded: int) -> None:
    """The robot's arms are wrong at all rests; a load of 0.7 kg is there at the last ones only."""
    rng = np.random.default_rng(4)
    arms = 0.006 * rng.standard_normal((5, 4))
    arms[make_map(0).jacobian(postures(1, 1)[0]) == 0.0] = 0.0
    q = postures(15, 3)
    tensions = np.array([tensions_at(one) for one in q])
    weights = 4.0 * np.cos(3.0 * q) * (np.arange(15) >= 15 - loaded)[:, None]

    class Displaced(MadeUpLoads):
        """Loads of the nominal model, which lacks the load; the tensions hold all of it."""

        def gravity(self, posture: Floats) -> Floats:
            number = int(np.argmin(np.linalg.norm(q - posture, axis=1)))
            held = super().gravity(posture) + tensions[number] @ arms
            return held - 0.7 * weights[number]

    options = BalanceOptions(share=0.02, noise=0.05)
    mass, std = Balance(make_map(0), Displaced(), WIDE, options).mass(q, tensions, weights)
    if loaded:
        assert abs(mass - 0.7) < 3.0 * std < 0.3
    else:
        assert (mass, std) == (0.0, np.inf)


def test_slopes_that_are_kept_are_those_of_their_postures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("jmm_agent.vision.balance.KEPT", 3)
    jmm, loads = make_map(0), MadeUpLoads()
    kept = Balance(jmm, loads, WIDE, BalanceOptions())
    random = np.random.default_rng(0)
    angles = random.uniform(-0.5, 0.5, (8, 1, len(jmm.joints)))
    tensions = random.uniform(5.0, 50.0, (1, len(jmm.muscles)))
    for q in (*angles, *angles[::-1]):
        fresh = Balance(jmm, loads, WIDE, BalanceOptions())
        assert np.array_equal(kept._slopes(q, tensions), fresh._slopes(q, tensions))
    assert len(kept._known) <= 3
    assert copy.deepcopy(kept)._known == {}

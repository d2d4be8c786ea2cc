"""The mapping: values and Jacobians against closed forms and finite differences."""

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jmm_agent.mapping.group_map import LARGEST, MappingError
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from tests.jmm_agent.small_map import JOINTS, MUSCLES, make_map


@pytest.fixture
def jmm():
    return make_map(hidden=7)


@pytest.fixture
def postures():
    return np.random.default_rng(1).normal(size=(6, len(JOINTS)))


def written_out(jmm, q):
    """The paper's network, muscle by muscle, from the fields alone."""
    lengths = np.full(len(MUSCLES), np.nan)
    for group in jmm.groups:
        x = (q[group.joint_index] - group.centre) / group.scale
        hidden = [1 / (1 + np.exp(-(w @ x + b))) for w, b in zip(group.W1, group.b1, strict=True)]
        for muscle, w, b in zip(group.muscle_index, group.W2, group.b2, strict=True):
            lengths[muscle] = 0.001 * (w @ hidden + b)
    return lengths


def differences(f, q, step=1e-5):
    """Central differences of f (n,) -> (m,) as columns (m, n)."""
    return np.stack(
        [(f(q + step * e) - f(q - step * e)) / (2 * step) for e in np.eye(len(q))], axis=1
    )


def test_lengths_are_the_network_in_metres(jmm, postures):
    expected = np.array([written_out(jmm, q) for q in postures])
    np.testing.assert_allclose(jmm.lengths(postures), expected, atol=1e-14)
    np.testing.assert_allclose(jmm.lengths(postures[0]), expected[0], atol=1e-14)


def test_analytic_jacobian_is_the_derivative_of_lengths(jmm, postures):
    expected = np.array([differences(jmm.lengths, q) for q in postures])
    np.testing.assert_allclose(jmm.jacobian(postures), expected, atol=1e-10)
    np.testing.assert_allclose(jmm.jacobian(postures[0]), expected[0], atol=1e-10)


def test_lengths_and_jacobian_are_those_of_the_two_alone(jmm, postures):
    lengths, jacobian = jmm.lengths_and_jacobian(postures)
    np.testing.assert_array_equal(lengths, jmm.lengths(postures))
    np.testing.assert_array_equal(jacobian, jmm.jacobian(postures))


def test_one_posture_has_the_bits_of_each_group_alone(jmm, postures):
    for q in postures:
        lengths, jacobian = jmm.lengths_and_jacobian(q)
        np.testing.assert_array_equal(jmm.lengths(q), lengths)
        for group in jmm.groups:
            hidden = group.hidden(q[None])
            block = jacobian[group.muscle_index[:, None], group.joint_index]
            np.testing.assert_array_equal(lengths[group.muscle_index], group.lengths(q[None])[0])
            np.testing.assert_array_equal(block, group.output_jacobian(hidden)[0])


def test_a_copied_map_holds_its_groups_only(jmm, postures):
    before = set(vars(jmm))
    lengths = jmm.lengths(postures[0])
    copied = deepcopy(jmm)
    assert set(vars(copied)) == before
    np.testing.assert_array_equal(copied.lengths(postures[0]), lengths)


def test_jacobian_is_zero_where_no_group_input_is(jmm, postures):
    jacobian = jmm.jacobian(postures)
    assert not jacobian[:, [0, 3]][..., [2, 3]].any()
    assert not jacobian[:, [1, 4, 2]][..., 0].any()


def test_quadratic_jacobian_is_the_papers_normal_equations(jmm, postures):
    step = 0.17
    q = postures[0]
    expected = np.empty((len(MUSCLES), len(JOINTS)))
    for j in range(len(JOINTS)):
        x = q[j] + step * np.arange(-2, 3)
        y = np.array([jmm.lengths(np.where(np.arange(len(q)) == j, at, q)) for at in x])
        a, b, _ = np.polyfit(x, y, 2)
        expected[:, j] = 2 * a * q[j] + b
    np.testing.assert_allclose(jmm.jacobian_quadratic(q, step), expected, atol=1e-10)
    np.testing.assert_allclose(jmm.jacobian_quadratic(postures, step)[0], expected, atol=1e-10)


def test_quadratic_jacobian_tends_to_the_analytic_one(jmm, postures):
    np.testing.assert_allclose(
        jmm.jacobian_quadratic(postures, 1e-4), jmm.jacobian(postures), atol=1e-8
    )


def test_quadratic_jacobian_steps_ten_degrees(jmm, postures):
    np.testing.assert_array_equal(
        jmm.jacobian_quadratic(postures), jmm.jacobian_quadratic(postures, np.deg2rad(10.0))
    )


@given(st.lists(st.floats(-1e6, 1e6), min_size=4, max_size=4))
def test_far_postures_give_finite_numbers(q):
    lengths, jacobian = make_map().lengths_and_jacobian(np.array(q))
    assert np.isfinite(lengths).all()
    assert np.isfinite(jacobian).all()


def test_output_layers_are_replaced_in_a_new_map(jmm, postures):
    before = jmm.lengths(postures)
    far = jmm.groups[1]
    moved = jmm.with_output_layers({"far": (far.W2, far.b2 + 3.0)})
    np.testing.assert_array_equal(jmm.lengths(postures), before)
    change = moved.lengths(postures) - before
    np.testing.assert_allclose(change[:, [1, 4, 2]], 0.003, atol=1e-12)
    np.testing.assert_array_equal(change[:, [0, 3]], 0.0)


def test_a_map_shares_no_memory_with_what_it_was_made_of(jmm, postures):
    W2, b2 = jmm.groups[0].W2.copy(), jmm.groups[0].b2.copy()
    moved = jmm.with_output_layers({"near": (W2, b2)})
    before = moved.lengths(postures)
    W2 += 1.0
    np.testing.assert_array_equal(moved.lengths(postures), before)
    with pytest.raises(ValueError, match="read-only"):
        moved.groups[0].W2[0, 0] = 0.0


@pytest.mark.parametrize(
    ("layers", "sentence"),
    [
        ({"hip": None}, "unknown group 'hip'; groups are \\['near', 'far'\\]"),
        ({"near": (np.zeros((2, 6)), np.zeros(2))}, "W2 has shape \\(2, 6\\), but \\(2, 7\\) fits"),
        ({"near": (np.full((2, 7), np.nan), np.zeros(2))}, "W2 has a number that is not finite"),
        ({"near": (np.full((2, 7), -1e31), np.zeros(2))}, "W2 has .* beyond 1e\\+30"),
    ],
)
def test_output_layers_that_do_not_fit_are_refused(jmm, layers, sentence):
    with pytest.raises(MappingError, match=sentence):
        jmm.with_output_layers(layers)


@pytest.mark.parametrize(
    ("q", "sentence"),
    [
        (np.zeros(3), "shape \\(3,\\)"),
        (np.zeros((2, 5)), "shape \\(2, 5\\)"),
        (np.zeros((1, 2, 4)), "shape \\(1, 2, 4\\)"),
        (0.0, "shape \\(\\)"),
        (np.array([0, 0, np.nan, 0]), "not finite"),
    ],
)
def test_postures_that_do_not_fit_are_refused(jmm, q, sentence):
    for method in (jmm.lengths, jmm.jacobian, jmm.jacobian_quadratic):
        with pytest.raises(MappingError, match=sentence):
            method(q)


@pytest.mark.parametrize("step", [0.0, -0.1, np.nan, np.inf])
def test_a_step_that_is_not_positive_is_refused(jmm, step):
    with pytest.raises(MappingError, match="must be positive"):
        jmm.jacobian_quadratic(np.zeros(4), step)


def test_each_muscle_needs_exactly_one_group(jmm):
    with pytest.raises(MappingError, match="exactly one group"):
        JointMuscleMap(JOINTS, MUSCLES, jmm.groups[:1])


def test_the_largest_numbers_of_a_map_overflow_nowhere(jmm, postures):
    extreme = {"centre": -LARGEST, "scale": 1.0 / LARGEST, "W1": LARGEST, "W2": LARGEST}
    groups = tuple(
        replace(g, **{name: np.full_like(getattr(g, name), x) for name, x in extreme.items()})
        for g in jmm.groups
    )
    for array in replace(jmm, groups=groups).lengths_and_jacobian(postures):
        assert np.isfinite(array).all()


def test_the_slope_of_torques_is_their_derivative(jmm, postures):
    tensions = np.random.default_rng(1).uniform(0.0, 50.0, (len(postures), len(MUSCLES)))

    def torques(at):
        return np.einsum("km,kmj->kj", tensions, jmm.jacobian(at))

    moves = 1e-5 * np.eye(len(JOINTS))
    numeric = [(torques(postures + d) - torques(postures - d)) / 2e-5 for d in moves]
    slope = jmm.torque_slope(postures, tensions)
    np.testing.assert_allclose(slope, np.stack(numeric, axis=-1), rtol=1e-4, atol=1e-6)

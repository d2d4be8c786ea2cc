"""The network in torch is the one of the control step, in both directions."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.mapping.group_map import METRES, GroupMap, Layers
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.types import Floats

pytestmark = pytest.mark.torch

SIZES = [(1, 1, 1), (2, 3, 7), (8, 10, 1000), (21, 40, 333)]
"""Joints, muscles and hidden units of a group."""


def random_map(sizes: list[tuple[int, int, int]], seed: int) -> JointMuscleMap:
    """A map whose groups have these sizes, each with joints and muscles of its own, in disorder."""
    rng = np.random.default_rng(seed)
    joints = rng.permutation(sum(n for n, _, _ in sizes))
    muscles = rng.permutation(sum(k for _, k, _ in sizes))
    groups, n_before, k_before = [], 0, 0
    for rank, (n, k, hidden) in enumerate(sizes):
        groups.append(
            GroupMap(
                f"group {rank}",
                joints[n_before : n_before + n],
                muscles[k_before : k_before + k],
                rng.normal(size=n),
                rng.uniform(0.01, 3.0, n),
                rng.normal(size=(hidden, n)) * 10.0 ** rng.uniform(-2, 1),
                rng.normal(size=hidden),
                rng.normal(size=(k, hidden)) * 10.0 ** rng.uniform(-1, 3),
                rng.normal(size=k),
            )
        )
        n_before, k_before = n_before + n, k_before + k
    names = tuple(f"joint {j}" for j in range(n_before)), tuple(f"m{i}" for i in range(k_before))
    return JointMuscleMap(*names, tuple(groups))


def lengths_by_torch(jmm: JointMuscleMap, q: Floats) -> tuple[Floats, Floats]:
    """Lengths (B, m) [m] and Jacobian (B, m, n) [m/rad] by torch's forward and autograd."""
    import torch

    from jmm_agent.networks.network import Network, tensor

    lengths = np.zeros((len(q), len(jmm.muscles)))
    jacobian = np.zeros((len(q), len(jmm.muscles), len(jmm.joints)))
    for group in jmm.groups:
        network, inputs = Network.of(group), tensor(q[:, group.joint_index])
        lengths[:, group.muscle_index] = METRES * network(inputs).detach().numpy()
        slopes = torch.vmap(torch.func.jacrev(lambda x, of=network: of(x[None])[0]))(inputs)
        block = METRES * slopes.detach().numpy()
        jacobian[:, group.muscle_index[:, None], group.joint_index] = block
    return lengths, jacobian


@pytest.mark.parametrize("sizes", [SIZES[:1], SIZES[1:3], SIZES], ids=len)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_control_step_evaluates_what_torch_does(
    sizes: list[tuple[int, int, int]], seed: int
) -> None:
    jmm = random_map(sizes, seed)
    q = np.random.default_rng(seed).normal(size=(5, len(jmm.joints)))
    lengths, jacobian = lengths_by_torch(jmm, q)
    alone = [jmm.lengths_and_jacobian(posture) for posture in q]
    for found in (jmm.lengths(q), [one for one, _ in alone]):  # in a batch, and as a step does
        np.testing.assert_allclose(found, lengths, rtol=1e-6, atol=1e-12 * abs(lengths).max())
    for found in (jmm.jacobian(q), [two for _, two in alone]):
        np.testing.assert_allclose(found, jacobian, rtol=1e-6, atol=1e-12 * abs(jacobian).max())


@pytest.mark.parametrize("size", SIZES)
def test_a_group_is_the_same_to_the_bit_after_torch_held_it(size: tuple[int, int, int]) -> None:
    from jmm_agent.networks.network import Network

    [group] = random_map([size], 3).groups
    again = Network.of(group).group(group)
    for name, layer in group.layers._asdict().items():
        np.testing.assert_array_equal(getattr(again, name), layer)
        assert getattr(again, name).dtype == np.float64


def test_layers_that_were_read_do_not_change_with_the_network() -> None:
    import torch

    from jmm_agent.networks.network import Network

    layers = random_map([(2, 3, 7)], 0).groups[0].layers
    network = Network(layers)
    read = network.layers()
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.zero_()
    for before, after in zip(layers, read, strict=True):
        np.testing.assert_array_equal(after, before)


def test_settling_finds_the_output_layer_that_made_the_data() -> None:
    from jmm_agent.networks.fit import settle

    rng = np.random.default_rng(0)
    true = Layers(rng.normal(size=(8, 2)), rng.normal(size=8), rng.normal(size=(3, 8)), np.ones(3))
    x = rng.uniform(-1, 1, (500, 2))
    hidden = 1.0 / (1.0 + np.exp(-(x @ true.W1.T + true.b1)))
    y = hidden @ true.W2.T + true.b2
    start = true._replace(W2=np.zeros((3, 8)), b2=np.zeros(3))
    settled = settle(x, y, start, 1e-12)
    np.testing.assert_allclose(hidden @ settled.W2.T + settled.b2, y, atol=1e-4)
    np.testing.assert_array_equal(settled.W1, true.W1)
    held = settle(x, y, start, 1e9)
    np.testing.assert_allclose(held.W2, 0.0, atol=1e-6)

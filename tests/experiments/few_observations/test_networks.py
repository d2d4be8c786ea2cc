"""Networks in torch give the lengths that maps evaluate without it, and the torques of tensions."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.few_observations.successor_data import Learning
from experiments.few_observations.successors import drawing_of
from experiments.few_observations.tension_maps import (
    AutoencoderMap,
    NetworkMap,
    PhysicsMap,
    RouteChangeMap,
)
from jmm_agent.types import Floats
from tests.experiments.few_observations.small_drawing import rests, small_world

pytestmark = pytest.mark.torch
SEEN = rests(6, 0.005, 1e-5)


def no_progress(share: float) -> None:
    """Nothing follows how far it is."""


def missed_by(jmm: NetworkMap) -> Floats:
    return np.asarray(jmm.lengths(SEEN.angles, SEEN.tensions) - SEEN.lengths)


def test_torch_and_numpy_agree() -> None:
    import torch

    from experiments.few_observations.networks.common import Groups, batch
    from experiments.few_observations.networks.route_change import RouteChange

    world, drawing = small_world(), drawing_of(small_world())
    torch.manual_seed(0)
    groups, model, seen = Groups(drawing, tensions=True), RouteChange(drawing), batch(SEEN, drawing)
    with torch.no_grad():
        for parameter in (*groups.parameters(), *model.parameters()):
            parameter += 0.05 * torch.randn_like(parameter)
        lengths, torques = groups(seen.angles, seen.scaled, seen.tensions)
        changed = model(seen.angles, seen.scaled, seen.tensions)
    jmm = PhysicsMap(world.map, drawing.scales, groups.arrays())
    expected = jmm.lengths(SEEN.angles, SEEN.tensions)
    np.testing.assert_allclose(lengths.numpy() * drawing.scales.length, expected, atol=1e-12)
    slopes = [jmm.jacobian(*rest) for rest in zip(SEEN.angles, SEEN.tensions, strict=True)]
    pulled = np.einsum("kmn,km->kn", np.array(slopes), SEEN.tensions)
    np.testing.assert_allclose(torques.numpy(), pulled, atol=1e-10)

    from experiments.few_observations.networks.common import arrays_of

    route = RouteChangeMap(
        world.map, drawing.scales, (model.ideal.arrays(), arrays_of(model.change))
    )
    expected = route.lengths(SEEN.angles, SEEN.tensions)
    np.testing.assert_allclose(changed.numpy() * drawing.scales.length, expected, atol=1e-12)


def test_an_autoencoder_knows_the_third_of_two() -> None:
    import torch

    from experiments.few_observations.networks import autoencoder
    from experiments.few_observations.successor_data import Initial

    drawing = drawing_of(small_world())
    layers = autoencoder.train(drawing, Initial(steps=1500), no_progress)
    nominal = rests(40, 0.0)
    network, state = autoencoder._network(layers), autoencoder._state(nominal, drawing)
    widths = torch.tensor([4, 5, 5])
    for masks, asked in (((1.0, 1.0, 0.0), slice(9, 14)), ((0.0, 1.0, 1.0), slice(0, 4))):
        given = torch.tensor([masks], dtype=torch.float64).repeat(len(state), 1)
        found = network(autoencoder._masked(state, given, widths)).detach()
        error = (found - state)[:, asked].square().mean().sqrt()
        assert error < 0.35 * state[:, asked].std()
    jmm = AutoencoderMap(drawing.scales, layers)
    learned = autoencoder.learn(drawing, layers, SEEN, Learning(1e-3, (100,), 0.0), no_progress)
    after = missed_by(AutoencoderMap(drawing.scales, learned[-1]))
    assert np.abs(after).mean() < 0.5 * np.abs(missed_by(jmm)).mean()


@pytest.mark.parametrize("steps", [(1,), (2, 5, 9)])
def test_networks_are_kept_after_each_number_of_steps(steps: tuple[int, ...]) -> None:
    from experiments.few_observations.networks import physics_informed, route_change

    drawing = drawing_of(small_world())
    for module in (physics_informed, route_change):
        learning = Learning(1e-3, steps, 0.1, 0.1)
        kept = module.learn(drawing, SEEN, learning, no_progress)
        alone = module.learn(drawing, SEEN, Learning(1e-3, steps[:1], 0.1, 0.1), no_progress)
        assert len(kept) == len(steps)
        first, same = (found[0][0] for found in (kept, alone))
        first, same = (one[0] if isinstance(one, list) else one for one in (first, same))
        np.testing.assert_array_equal(first["W2"], same["W2"])

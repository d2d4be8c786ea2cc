"""What other methods get of our looks."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.few_observations.given import observed_rests, with_offsets
from experiments.robots.world import World, known_world
from jmm_agent.agent import Agent
from jmm_agent.mapping.learner import Pairs
from jmm_agent.types import Floats
from jmm_agent.updaters import VisionOptions
from kengoro.agents import make_agent
from tests.jmm_agent.small_map import make_map, postures


@pytest.fixture(scope="module")
def world(request: pytest.FixtureRequest) -> World:
    """With a map that is trained once and kept between test runs."""
    return known_world(request.config.cache.mkdir("maps"))


def observe(agent: Agent, world: World, q: Floats, tension: float) -> None:
    """Let the Vision Updater see the hand of the drawing at joint angles (n,) [rad]."""
    lengths = world.map.lengths(q) + 0.004
    tensions = np.full(len(lengths), tension)
    agent.vision.seen(world.marker(q), q, lengths, lengths, tensions)


def test_a_rest_with_a_saturated_muscle_is_given_though_it_makes_no_pair(world: World) -> None:
    agent = make_agent(1, jmm=world.map)
    saturation = VisionOptions().saturation
    observe(agent, world, world.postures[7], saturation)
    assert len(agent.vision.pairs.noise) == 0
    observe(agent, world, world.postures[3], 50.0)
    assert len(agent.vision.pairs.noise) == 1
    seen = observed_rests(agent.vision, world)
    np.testing.assert_array_equal(seen.angles, agent.vision.memory.angles)
    np.testing.assert_array_equal(seen.tensions[:, 0], [saturation, 50.0])
    np.testing.assert_allclose(seen.lengths[1], world.map.lengths(world.postures[3]) + 0.004)
    np.testing.assert_allclose(seen.torques[1], world.arm.gravity(seen.angles[1]))


def test_before_the_first_observation_there_is_nothing(world: World) -> None:
    seen = observed_rests(make_agent(1, jmm=world.map).vision, world)
    assert [part.shape for part in seen] == [(0, 14), (0, 36), (0, 36), (0, 14)]


def test_one_constant_is_the_mean_of_what_pairs_miss() -> None:
    nominal, asked = make_map(0), postures(6, 2)
    offsets = np.random.default_rng(0).normal(0.0, 0.01, (6, 5))
    pairs = Pairs(asked, nominal.lengths(asked) + offsets, np.full(6, 0.001))
    found = with_offsets(nominal, pairs).lengths(asked) - nominal.lengths(asked)
    np.testing.assert_allclose(found, np.tile(offsets.mean(axis=0), (6, 1)), atol=1e-12)
    assert with_offsets(nominal, Pairs.none(4, 5)) is nominal

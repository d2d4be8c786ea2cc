"""Evaluation of a map: errors are measured, nothing is learned, all start equally."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.robots.conditions import ACTUAL, NOMINAL
from experiments.robots.evaluation import Evaluator, PostureMap, map_error_mm
from experiments.robots.world import World, known_world
from jmm_agent.mapping.group_map import METRES
from jmm_agent.types import Floats
from jmm_agent.updaters import VisionUpdater
from kengoro.agents import make_agent
from kengoro.robots import shuffled_postures
from kengoro.visits import errors, rmse_deg

SEED = 1
POSTURES = shuffled_postures(SEED)[:3]
OTHERS = shuffled_postures(SEED)[100:150]


@pytest.fixture(scope="module")
def world(request: pytest.FixtureRequest) -> World:
    """With a map that is trained once and kept between test runs."""
    return known_world(request.config.cache.mkdir("maps"))


@pytest.fixture(scope="module")
def detector(world: World) -> VisionUpdater:
    """Of an agent that has learned nothing."""
    return make_agent(SEED, jmm=world.map).vision


def evaluator(world: World, condition: str) -> Evaluator:
    return Evaluator(world, condition, SEED, 1.0, 1.0)


def test_the_drawings_map_errs_on_an_actual_robot_and_sags_on_the_drawing(
    world: World, detector: VisionUpdater
) -> None:
    actual = errors(evaluator(world, ACTUAL).evaluate(world.map, POSTURES, detector))
    nominal = errors(evaluator(world, NOMINAL).evaluate(world.map, POSTURES, detector))
    assert actual["target_true_deg"] > 7.0
    assert 0.1 < nominal["target_true_deg"] < 4.0
    assert actual["estimate_seen_deg"] > 2.0 * nominal["estimate_seen_deg"]
    assert actual["max_tension_N"] > 50.0


def test_what_is_seen_on_the_drawing_is_true_and_so_is_the_estimate(
    world: World, detector: VisionUpdater
) -> None:
    visits = evaluator(world, NOMINAL).evaluate(world.map, POSTURES, detector)
    assert np.max(rmse_deg(visits, "estimate_true")) < 1.0
    assert np.max(rmse_deg(visits, "estimate_seen")) < 1.0
    np.testing.assert_allclose(visits["target"], POSTURES[1:], atol=1e-6)


def test_every_evaluation_starts_equally_and_learns_nothing(world: World) -> None:
    subject, agent = evaluator(world, ACTUAL), make_agent(SEED, jmm=world.map)
    first = subject.evaluate(world.map, POSTURES, agent.vision)
    subject.own_lengths(OTHERS)
    assert subject.evaluate(world.map, POSTURES, agent.vision) == first
    assert agent.vision.fired == 0
    assert len(agent.vision.pairs.noise) == 0
    assert agent.map is world.map


def test_own_lengths_are_the_drawings_where_nothing_departs_from_it(world: World) -> None:
    nominal = evaluator(world, NOMINAL).own_lengths(OTHERS)
    assert map_error_mm(world.map, OTHERS, nominal) < 0.5
    assert map_error_mm(world.map, OTHERS, nominal + 0.010) == pytest.approx(10.0, abs=0.5)
    own = evaluator(world, ACTUAL).own_lengths(OTHERS)
    assert map_error_mm(world.map, OTHERS, own) > 5.0


def test_commands_that_pull_with_balancing_tensions_do_not_sag(
    world: World, detector: VisionUpdater
) -> None:
    sagging, holding = (
        errors(
            Evaluator(world, NOMINAL, SEED, 1.0, 1.0, pulls).evaluate(world.map, POSTURES, detector)
        )
        for pulls in (False, True)
    )
    assert holding["target_true_deg"] < 0.3 * sagging["target_true_deg"]
    assert holding["target_true_mm"] < 0.3 * sagging["target_true_mm"]


class Stretching:
    """The drawing with tendons that stretch [m/N], as a map of angles and tensions."""

    def __init__(self, world: World, stretch: float) -> None:
        self._map, self._stretch = world.map, stretch

    def lengths(self, q: Floats, tensions: Floats) -> Floats:
        return np.asarray(self._map.lengths(q) - self._stretch * tensions)

    def at(self, tensions: Floats) -> PostureMap:
        offsets = -self._stretch * tensions / METRES
        groups = self._map.groups
        return self._map.with_output_layers(
            {group.name: (group.W2, group.b2 + offsets[group.muscle_index]) for group in groups}
        )


@pytest.mark.parametrize("pulls", [False, True])
def test_a_map_of_tensions_without_effect_moves_as_one_of_angles(
    world: World, detector: VisionUpdater, pulls: bool
) -> None:
    subject = Evaluator(world, ACTUAL, SEED, 0.6, 0.6, pulls)
    expected = subject.evaluate(world.map, POSTURES, detector)
    assert subject.evaluate(Stretching(world, 0.0), POSTURES, detector) == expected


def test_a_map_whose_tendons_stretch_commands_and_estimates_with_it(
    world: World, detector: VisionUpdater
) -> None:
    subject = Evaluator(world, NOMINAL, SEED, 0.6, 0.6, feed_forward=True)
    stiff, soft = (Stretching(world, stretch) for stretch in (0.0, 1e-5))
    tensions, more = (
        np.array([tension for _, _, tension in subject.rests(jmm, POSTURES)])
        for jmm in (stiff, soft)
    )
    # Commands are shorter by the stretch, so muscles pull by up to K times that more.
    assert 1.1 * tensions.mean() < more.mean() < 1.5 * tensions.mean()
    lengths = world.map.lengths(POSTURES[1])
    estimate = world.estimate(soft.at(np.full(36, 100.0)), lengths - 1e-3, POSTURES[1])
    np.testing.assert_allclose(estimate, POSTURES[1], atol=1e-3)

"""Learners of the later papers start at the drawing, learn few rests, and need no torch here."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from experiments.few_observations import tune
from experiments.few_observations.methods import AUTOENCODER, PHYSICS, ROUTE_CHANGE
from experiments.few_observations.successor_data import Initial, Learning, Observed
from experiments.few_observations.successors import (
    SETTINGS,
    Successors,
    autoencoder_of,
    drawing_of,
    motors,
)
from experiments.harness.errors import ExperimentError
from experiments.robots.evaluation import TensionMap
from jmm_agent.types import Floats
from tests.experiments.few_observations.small_drawing import rests, small_world
from tests.jmm_agent.small_map import postures

INITIAL = Initial(steps=1500)
TAUGHT = Learning(3e-3, (600,), 0.0)
"""The networks of the small map have few units, which need larger steps than the arm's."""
ASKED, PULLS = postures(30, 50), np.full((30, 5), 60.0)
NOMINAL = small_world().map.lengths(ASKED)


@pytest.fixture(scope="module")
def successors(tmp_path_factory: pytest.TempPathFactory) -> Successors:
    return Successors(small_world(), INITIAL, tmp_path_factory.mktemp("maps"))


def rms_mm(missed: Floats) -> float:
    return float(1e3 * np.sqrt(np.mean(missed**2)))


@pytest.mark.parametrize("name", [ROUTE_CHANGE, PHYSICS])
def test_without_a_rest_the_map_is_the_drawing(successors: Successors, name: str) -> None:
    found = successors.map(name, rests(0, 0.0))
    np.testing.assert_allclose(found.lengths(ASKED, PULLS), NOMINAL, atol=1e-12)


def test_the_autoencoder_knows_the_drawing_nearly(successors: Successors) -> None:
    found = successors.map(AUTOENCODER, rests(0, 0.0))
    spread = rms_mm(NOMINAL - NOMINAL.mean(axis=0))
    assert rms_mm(found.lengths(ASKED, PULLS) - NOMINAL) < 0.15 * spread


@pytest.mark.parametrize("name", SETTINGS)
def test_few_rests_teach_what_all_of_them_miss(successors: Successors, name: str) -> None:
    before = successors.map(name, rests(0, 0.0)).lengths(ASKED, PULLS)
    gently = Learning(1e-3, (100,), 0.0) if name == AUTOENCODER else TAUGHT  # or it overfits
    found = successors.learn(name, rests(4, 0.010), gently)[-1]
    assert isinstance(found, TensionMap)
    assert rms_mm(found.lengths(ASKED, PULLS) - NOMINAL - 0.010) < 0.6 * rms_mm(
        before - NOMINAL - 0.010
    )


@pytest.mark.parametrize("name", SETTINGS)
def test_stretch_by_tensions_is_learned(successors: Successors, name: str) -> None:
    seen = rests(60, 0.0, stretch=1e-4)
    learned = successors.learn(name, seen, TAUGHT)[-1]
    more = learned.lengths(ASKED, PULLS + 30.0) - learned.lengths(ASKED, PULLS - 30.0)
    assert np.median(more) == pytest.approx(-60.0 * 1e-4, rel=0.3)
    fixed = learned.at(PULLS[0])
    np.testing.assert_allclose(fixed.lengths(ASKED), learned.lengths(ASKED, PULLS))
    np.testing.assert_allclose(fixed.lengths(ASKED[0]), fixed.lengths(ASKED)[0])


@pytest.mark.parametrize("name", SETTINGS)
def test_the_jacobian_is_the_slope_of_the_lengths(successors: Successors, name: str) -> None:
    learned = successors.learn(name, rests(9, 0.004, 1e-5), Learning(1e-3, (50,), 0.1))[-1]
    own, q, step = learned.at(PULLS[0]), ASKED[0], 1e-5
    lengths, slope = own.lengths_and_jacobian(q)
    moved = np.array([own.lengths(q + move) - own.lengths(q - move) for move in step * np.eye(4)])
    np.testing.assert_allclose(slope, moved.T / (2.0 * step), atol=1e-7)
    np.testing.assert_allclose(lengths, own.lengths(q))


def test_the_balance_changes_the_moment_arms_where_lengths_do_not(successors: Successors) -> None:
    world, seen = small_world(), rests(5, 0.0)
    arms = 1.3 * world.map.jacobian(seen.angles)  # all moment arms are longer than drawn
    torques = np.einsum("kmn,km->kn", arms, seen.tensions)
    seen = seen._replace(torques=torques)

    def unbalanced(own: float) -> float:
        jmm = successors.learn(PHYSICS, seen, Learning(3e-3, (400,), own))[-1]
        slopes = [jmm.jacobian(*rest) for rest in zip(seen.angles, seen.tensions, strict=True)]
        found = np.einsum("kmn,km->kn", np.array(slopes), seen.tensions)
        return float(np.sqrt(np.mean((found - torques) ** 2)))

    assert unbalanced(1.0) < 0.5 * unbalanced(0.0)


def test_the_boundary_holds_the_lengths_at_zero(successors: Successors) -> None:
    at_zero, zero = small_world().map.lengths(np.zeros(4)), successors.drawing.zero
    assert np.abs(at_zero).max() > 1e-3  # so there is something to hold

    def off(boundary: float) -> float:
        learning = Learning(1e-3, (400,), 0.0, boundary)
        jmm = successors.learn(PHYSICS, rests(3, 0.0), learning)[-1]
        return rms_mm(jmm.lengths(zero.angles, zero.tensions))

    assert off(1.0) < 0.5 * off(0.0)


def test_rehearsal_keeps_the_drawing(successors: Successors) -> None:
    def moved(name: str, own: float) -> float:
        jmm = successors.learn(name, rests(3, 0.010), Learning(3e-4, (200,), own))[-1]
        return rms_mm(jmm.lengths(ASKED, PULLS) - NOMINAL)

    for name in (ROUTE_CHANGE, AUTOENCODER):
        assert moved(name, 10.0) < 0.5 * moved(name, 0.0)


def test_samples_have_tensions_from_the_bias_to_what_postures_need() -> None:
    drawing = drawing_of(small_world())
    assert drawing.samples.tensions.min() >= motors().bias
    assert drawing.samples.tensions.max() <= motors().limit
    np.testing.assert_array_equal(
        drawing.samples.lengths[:9], small_world().map.lengths(drawing.samples.angles[:9])
    )


def test_the_autoencoder_is_trained_once_for_the_same_drawing(tmp_path: Path) -> None:
    drawing = drawing_of(small_world())
    first = autoencoder_of(drawing, Initial(steps=20), tmp_path)
    (path,) = tmp_path.glob("autoencoder-*.npz")
    written = path.stat().st_mtime_ns
    again = autoencoder_of(drawing, Initial(steps=20), tmp_path)
    assert path.stat().st_mtime_ns == written
    for (weights, offsets), (same, alike) in zip(first, again, strict=True):
        np.testing.assert_array_equal(weights, same)
        np.testing.assert_array_equal(offsets, alike)
    other = autoencoder_of(drawing, Initial(steps=21), tmp_path)
    assert not np.array_equal(other[0][0], first[0][0])
    path.write_bytes(b"damaged")
    np.testing.assert_array_equal(
        autoencoder_of(drawing, Initial(steps=20), tmp_path)[0][0], first[0][0]
    )


def test_the_same_rests_give_the_same_bits(successors: Successors) -> None:
    seen: Observed = rests(4, 0.006, 2e-5)
    for name in SETTINGS:
        one, other = (successors.map(name, seen).lengths(ASKED, PULLS) for _ in range(2))
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (tune.Args(seeds="100"), "tuning robots have seeds below 100"),
        (tune.Args(seeds="x"), "Seeds are 'x'"),
        (tune.Args(counts=()), r"Counts are \[\]"),
        (tune.Args(counts=(10, 3)), r"Counts are \[10, 3\]; give numbers of looks from 1 on"),
        (tune.Args(counts=(0, 3)), r"Counts are \[0, 3\]"),
    ],
)
def test_settings_are_not_tuned_by_options_that_are_wrong(
    options: tune.Args, sentence: str
) -> None:
    with pytest.raises(ExperimentError, match=sentence):
        tune.main(options)


def test_torch_stays_out_of_the_process_of_the_experiment(tmp_path: Path) -> None:
    program = """
import sys
from pathlib import Path
from experiments.few_observations import run, tune
from experiments.few_observations.successor_data import Initial
from experiments.few_observations.successors import autoencoder_of, drawing_of
from tests.experiments.few_observations.small_drawing import small_world
autoencoder_of(drawing_of(small_world()), Initial(steps=2), Path(sys.argv[1]))
print("torch" in sys.modules)
"""
    done = subprocess.run(
        [sys.executable, "-c", program, tmp_path], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["False"]

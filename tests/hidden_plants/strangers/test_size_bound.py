"""The bound of an estimated size follows from the oracle, and realisations differ."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from hidden_plants.secret import Effect
from hidden_plants.strangers import Oracle, make_stranger
from hidden_plants.strangers.mechanisms import MECHANISMS
from hidden_plants.strangers.mismatch import sample_mismatch
from hidden_plants.strangers.oracle import SPREAD
from hidden_plants.strangers.readings import noisy, reading_times
from hidden_plants.strangers.size_bound import scaled, size_bound
from hidden_plants.strangers.truth import true_size


@cache
def oracle() -> Oracle:
    return Oracle(make_stranger(2, 2.0))


def effect(id: str, amplitude: float) -> Effect:
    structures = MECHANISMS[id].structures(oracle().stranger, np.random.default_rng(0))
    return structures[0].at(amplitude)


def test_the_bound_is_the_amplitude_over_its_detectability() -> None:
    found = effect("reading_scale", 0.01)
    expected = 0.01 / oracle().distance(found)
    assert size_bound(oracle(), found).oracle == pytest.approx(expected, rel=1e-3)


def test_the_mismatch_of_the_same_number_is_part_of_the_size() -> None:
    nominal = float(oracle().stranger.model.dof_armature[0])
    found = effect("armature", nominal)
    own = 0.05 * nominal * SPREAD
    whole = nominal / oracle().distance(scaled(found, 0.01)) * 0.01
    assert size_bound(oracle(), found).oracle ** 2 == pytest.approx(whole**2 - own**2, rel=0.1)


def test_the_error_of_the_nominal_model_raises_the_bound() -> None:
    found = size_bound(oracle(), effect("reading_scale", 0.01))
    assert found.readings < found.oracle


def test_an_effect_without_a_size_is_refused() -> None:
    with pytest.raises(ValueError, match="more than one definition"):
        size_bound(oracle(), effect("actuator_lag", 0.01))


def test_realisations_have_their_own_mismatches_and_noise_and_the_same_times() -> None:
    first = make_stranger(2, 2.0)
    other = replace(first, realisation=1)
    assert sample_mismatch(first).mass != pytest.approx(sample_mismatch(other).mass)
    clean = {sensor.name: np.zeros(50) for sensor in first.sensors}
    one, two = (noisy(each, 0, clean)["at_j1"] for each in (first, other))
    assert abs(np.corrcoef(one, two)[0, 1]) < 0.5
    assert (reading_times(first, 0, 0.2) == reading_times(other, 0, 0.2)).all()


def test_the_first_realisation_is_the_one_of_the_seed_alone() -> None:
    rng = np.random.default_rng([7, 4, 1])
    assert make_stranger(7, 2.0).generator(4, 1).random() == rng.random()


def test_a_true_size_is_that_of_the_given_mismatch() -> None:
    first = oracle().stranger
    other, found = replace(first, realisation=1), effect("armature", 0.1)
    assert true_size(first, found, sample_mismatch(other)) == true_size(other, found)
    assert true_size(first, found) != true_size(other, found)

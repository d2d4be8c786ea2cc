"""Sampled effects have the requested kind, and detectable and physical amplitudes."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from hidden_plants import CATALOGUE, OUTSIDE, Secret, sample_secret
from hidden_plants.detection_limits import rows
from hidden_plants.mechanisms import MECHANISMS
from hidden_plants.sampling import HIGHEST, KINDS, LOWEST, ONLY_ON_ARM


def sampled(
    kind: str, count: int, machine: str = "elbow", family: str | None = None
) -> list[Secret]:
    return [
        sample_secret(np.random.default_rng([7, k]), kind, machine, family) for k in range(count)
    ]


@pytest.mark.parametrize("machine", ["elbow", "arm"])
@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_has_its_number_of_effects_from_its_catalogue(kind: str, machine: str) -> None:
    count = {"null": 0, "pair": 2}.get(kind, 1)
    for secret in sampled(kind, 40, machine):
        assert secret.kind == kind
        assert len({effect.id for effect in secret.effects}) == len(secret.effects) == count
        allowed = OUTSIDE if kind == "outside" else CATALOGUE
        assert {effect.id for effect in secret.effects} <= set(allowed)


@pytest.mark.parametrize("machine", ["elbow", "arm"])
def test_amplitudes_lie_between_multiples_of_the_detection_limit(machine: str) -> None:
    table = rows(machine)
    for secret in [*sampled("single", 150, machine), *sampled("outside", 50, machine)]:
        (effect,) = secret.effects
        limits = [
            row.detection_limits[secret.motion]
            for row in table
            if row.structure.id == effect.id
            and row.structure.elements == effect.elements
            and row.structure.shape.items() <= effect.parameters.items()
        ]
        assert len(limits) == 1
        assert effect.amplitude >= LOWEST * limits[0]
        if "least" not in effect.parameters:
            assert effect.amplitude <= HIGHEST * limits[0]
        assert effect.amplitude <= MECHANISMS[effect.id].bound


def test_the_elbow_has_effects_of_the_arm_only_if_they_are_named() -> None:
    ids = Counter(secret.effects[0].id for secret in sampled("single", 400))
    assert not set(ids) & set(ONLY_ON_ARM)
    assert set(ids) == set(CATALOGUE) - set(ONLY_ON_ARM)
    assert {s.effects[0].id for s in sampled("single", 3, family="payload")} == {"payload"}


def test_a_family_restricts_the_first_effect() -> None:
    found = {secret.effects[0].id for secret in sampled("single", 60, family="friction")}
    assert found == {id for id in CATALOGUE if id.endswith("friction")}


def test_the_same_random_numbers_give_the_same_effects() -> None:
    assert sampled("pair", 5) == sampled("pair", 5)


def test_an_unknown_kind_or_family_is_an_error_that_lists_the_valid_ones() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match=r"unknown kind 'triple'; valid are: single, pair"):
        sample_secret(rng, "triple")
    with pytest.raises(ValueError, match=r"unknown family 'weather'; valid are: friction"):
        sample_secret(rng, "single", family="weather")

"""Secrets are drawn as asked, within their floors and what is physical."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from hidden_plants import CATALOGUE, OUTSIDE, Secret, draw
from hidden_plants.detection_limits import rows
from hidden_plants.draw import HIGHEST, KINDS, LOWEST, ONLY_ON_ARM
from hidden_plants.mechanisms import MECHANISMS


def drawn(kind: str, count: int, machine: str = "elbow", family: str | None = None) -> list[Secret]:
    return [draw(np.random.default_rng([7, k]), kind, machine, family) for k in range(count)]


@pytest.mark.parametrize("machine", ["elbow", "arm"])
@pytest.mark.parametrize("kind", KINDS)
def test_as_many_effects_as_asked_each_of_its_catalogue(kind: str, machine: str) -> None:
    count = {"null": 0, "pair": 2}.get(kind, 1)
    for secret in drawn(kind, 40, machine):
        assert secret.kind == kind
        assert len({effect.id for effect in secret.effects}) == len(secret.effects) == count
        allowed = OUTSIDE if kind == "outside" else CATALOGUE
        assert {effect.id for effect in secret.effects} <= set(allowed)


@pytest.mark.parametrize("machine", ["elbow", "arm"])
def test_amplitudes_lie_between_multiples_of_the_floor(machine: str) -> None:
    table = rows(machine)
    for secret in [*drawn("single", 150, machine), *drawn("outside", 50, machine)]:
        (effect,) = secret.effects
        detection_limits = [
            row.detection_limits[secret.motion]
            for row in table
            if row.structure.id == effect.id
            and row.structure.elements == effect.elements
            and row.structure.shape.items() <= effect.parameters.items()
        ]
        assert len(detection_limits) == 1
        assert effect.amplitude >= LOWEST * detection_limits[0]
        if "least" not in effect.parameters:
            assert effect.amplitude <= HIGHEST * detection_limits[0]
        assert effect.amplitude <= MECHANISMS[effect.id].bound


def test_an_elbow_hides_no_twins_unless_asked_by_name() -> None:
    ids = Counter(secret.effects[0].id for secret in drawn("single", 400))
    assert not set(ids) & set(ONLY_ON_ARM)
    assert set(ids) == set(CATALOGUE) - set(ONLY_ON_ARM)
    assert {s.effects[0].id for s in drawn("single", 3, family="payload")} == {"payload"}


def test_a_family_narrows_the_first_effect() -> None:
    found = {secret.effects[0].id for secret in drawn("single", 60, family="friction")}
    assert found == {id for id in CATALOGUE if id.endswith("friction")}


def test_same_numbers_same_secret() -> None:
    assert drawn("pair", 5) == drawn("pair", 5)


def test_unknown_words_are_answered_with_the_known_ones() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match=r"no kind 'triple'; there are: single, pair"):
        draw(rng, "triple")
    with pytest.raises(ValueError, match=r"no family 'weather'; there are: friction"):
        draw(rng, "single", family="weather")

"""Updates that make a map worse are told from those that do not."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.held_back import HeldBackOptions, error, made_worse
from jmm_agent.learner import Pairs
from jmm_agent.mapping import METRES, JointMuscleMap
from tests.jmm_agent.small_map import make_map, postures

OPTIONS = HeldBackOptions()


def shifted(jmm: JointMuscleMap, offset: float) -> JointMuscleMap:
    """The map with all lengths longer by an offset [m]."""
    return jmm.with_output_layers(
        {group.name: (group.W2, group.b2 + offset / METRES) for group in jmm.groups}
    )


@pytest.fixture
def jmm() -> JointMuscleMap:
    return make_map()


@pytest.fixture
def pair(jmm: JointMuscleMap) -> Pairs:
    """One pair of a robot whose wires are 5 mm longer than the map says."""
    q = postures(1)
    return Pairs(q, jmm.lengths(q) + 0.005, np.array([0.001]))


def test_the_error_is_that_of_all_wires(jmm: JointMuscleMap, pair: Pairs) -> None:
    assert error(jmm, pair) == pytest.approx(0.005)
    assert error(shifted(jmm, 0.005), pair) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("offset", "worse"), [(0.005, False), (-0.003, False), (-0.006, True), (0.015, False)]
)
def test_only_a_much_larger_error_is_harm(
    offset: float, worse: bool, jmm: JointMuscleMap, pair: Pairs
) -> None:
    """Errors: 5 mm before; after 0, 8, 11 and 10 mm. Harm begins above 1.5 x 5 + 3 mm."""
    assert made_worse(jmm, shifted(jmm, offset), pair, OPTIONS) == worse


def test_without_a_pair_nothing_is_known(jmm: JointMuscleMap, pair: Pairs) -> None:
    assert not made_worse(jmm, shifted(jmm, 1.0), pair.last(0), OPTIONS)

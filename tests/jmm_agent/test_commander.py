"""Targets beyond joint limits, of hinges and of slides."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.commander import Commander
from tests.jmm_agent.small_map import JOINTS, make_map

LIMITS = np.array([[-1.0, 0.5], [0.0, 0.05], [-0.6, 0.6], [0.1, 1.5]])
"""The second joint is a slide with a range of 50 mm."""


@pytest.mark.parametrize(("joint", "target", "named"), [
    (0, 0.59, ""),
    (0, 0.7, "'a' goes to its limit: 0.7 was asked for, and its range is -1 to 0.5; "),
    (1, 0.054, ""),
    (1, 0.08, "'b' goes to its limit: 0.08 was asked for, and its range is 0 to 0.05; "),
    (1, -0.02, "'b' goes to its limit: -0.02 was asked for, and its range is 0 to 0.05; "),
])  # fmt: skip
def test_a_target_far_beyond_the_range_of_its_joint_is_named_in_its_unit(
    joint: int, target: float, named: str
) -> None:
    middle = LIMITS.mean(axis=1)
    commander = Commander(make_map(), middle, LIMITS, 0.03)
    middle[joint] = target
    sentence = f"Joint {named}postures are in rad or m." if named else ""
    assert commander.beyond(middle, JOINTS) == sentence

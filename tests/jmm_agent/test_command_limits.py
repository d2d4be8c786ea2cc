"""Limits of rate and tension without a guard."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.command_limits import FASTEST, CommandLimits
from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import MotorControl
from tests.jmm_agent.small_map import LIMITS, make_map

ZERO = np.zeros(2)


def test_a_target_changes_by_its_rate_at_most() -> None:
    limits = CommandLimits(np.array([0.1, 1.0]))
    wanted = np.array([1.0, -0.015])
    np.testing.assert_allclose(limits.applied(wanted, ZERO, ZERO, 0.02), [0.002, -0.015])


def test_the_limit_of_the_tension_comes_last() -> None:
    limits = CommandLimits(0.1, MotorControl(1000.0, 3.0, 60.0))
    lengths = np.array([0.10, 0.0])
    command = limits.applied(np.array([0.0, -1.0]), ZERO, lengths, 0.02)
    np.testing.assert_allclose(command, [0.10 - 0.057, -0.002])


def test_commands_within_the_limits_keep_their_bits() -> None:
    wanted = np.random.default_rng(0).normal(size=36) * 1e-4
    limited = CommandLimits(1.0, MotorControl()).applied(wanted, np.zeros(36), np.zeros(36), 0.02)
    np.testing.assert_array_equal(limited, wanted)


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan, np.array([1.0, 0.0])])
def test_a_rate_that_is_not_positive_is_refused(rate: float) -> None:
    with pytest.raises(AgentError, match="rate"):
        CommandLimits(rate)


def test_the_rate_derives_from_the_ranges_of_the_muscles() -> None:
    jmm = make_map()
    rate = CommandLimits.of(jmm, LIMITS).rate
    corners = np.array(np.meshgrid(*LIMITS)).reshape(4, -1).T
    most = np.ptp(np.vstack([jmm.lengths(corners), jmm.lengths(LIMITS.mean(1))[None]]), axis=0)
    assert np.all(rate <= 1.5 * most.max() / FASTEST)
    assert np.all(rate > 0.0)
    doubled = CommandLimits.of(
        jmm.with_output_layers({g.name: (2.0 * g.W2, 2.0 * g.b2) for g in jmm.groups}), LIMITS
    )
    np.testing.assert_allclose(doubled.rate, 2.0 * np.asarray(rate))


def test_a_muscle_that_hardly_moves_is_not_held() -> None:
    jmm = make_map()
    near = jmm.groups[0]
    layers = {group.name: (group.W2, group.b2) for group in jmm.groups}
    held = jmm.with_output_layers(layers | {near.name: (0.0 * near.W2, near.b2)})
    rate = np.asarray(CommandLimits.of(held, LIMITS).rate)
    np.testing.assert_allclose(rate[near.muscle_index], 0.1 * rate.max())

"""The guard that watches nothing: readings and commands pass through."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.guard.null_guard import NullGuard
from jmm_agent.observation import SensorReadings

LENGTHS, TENSIONS = np.array([0.01, -0.02]), np.array([30.0, 600.0])
COMMAND = np.array([0.0, -0.5])  # demands more than any motor can pull


def test_readings_pass_as_copies_without_doubt() -> None:
    readings = SensorReadings(1.0, LENGTHS.copy(), TENSIONS.copy())
    filtered = NullGuard().filter(readings, 0.98, COMMAND, COMMAND)
    readings.lengths[:] = readings.tensions[:] = 0.0
    np.testing.assert_array_equal(filtered.lengths, LENGTHS)
    np.testing.assert_array_equal(filtered.tensions, TENSIONS)
    for mask in (filtered.doubted, filtered.numb, filtered.unsafe):
        np.testing.assert_array_equal(mask, [False, False])


def test_a_command_passes_without_a_limit() -> None:
    guard = NullGuard()
    assert guard.limit(COMMAND) is COMMAND
    assert guard.faults == []


@pytest.mark.parametrize(
    "readings",
    [
        SensorReadings(1.0, np.array([np.nan, 0.0]), TENSIONS),
        SensorReadings(1.0, LENGTHS, np.array([np.inf, 0.0])),
        SensorReadings(1.0, LENGTHS[:1], TENSIONS),
        SensorReadings(0.98, LENGTHS, TENSIONS),
    ],
)
def test_readings_that_cannot_be_used_are_refused(readings: SensorReadings) -> None:
    with pytest.raises(AgentError, match=r"Agent: (lengths|tensions|time) must be finite"):
        NullGuard().filter(readings, 0.98, COMMAND, COMMAND)

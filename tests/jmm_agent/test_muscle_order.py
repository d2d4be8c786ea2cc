"""Order and signs of a robot's channels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.mapping.group_map import MappingError
from jmm_agent.mapping.tendon_stretch import TendonStretch
from jmm_agent.muscle_order import MuscleOrder
from jmm_agent.observation import SensorReadings
from tests.jmm_agent.small_map import MUSCLES, make_map, postures


def order(**changes: object) -> MuscleOrder:
    fields = {
        "muscles": ("a", "b", "c"),
        "channels": 4,
        "commands": [2, 0, 1],
        "lengths": [2, 1, 0],
        "tensions": [0, 1, 3],
        "command_signs": [1.0, -1.0, 1.0],
        "length_signs": [1.0, 1.0, -1.0],
        "tension_signs": [1.0, -1.0, 1.0],
    }
    return MuscleOrder(**(fields | changes))  # type: ignore[arg-type]


READINGS = SensorReadings(3.0, np.array([1.0, 2.0, 3.0, 4.0]), np.array([5.0, 6.0, 7.0, 8.0]))


def test_readings_and_commands_are_converted() -> None:
    mine = order()
    readings = mine.readings(READINGS)
    assert readings.lengths.tolist() == [3.0, 2.0, -1.0]
    assert readings.tensions.tolist() == [5.0, -6.0, 8.0]
    assert readings.time == 3.0
    assert mine.command(np.array([10.0, 20.0, 30.0]), READINGS).tolist() == [-20, 30, 10, 4]
    assert mine.idle.tolist() == [False, False, False, True]
    assert mine.changes


def test_stiffness_and_temperatures_belong_to_the_motors() -> None:
    mine = order()
    assert mine.stiffness(np.array([1.0, 2.0, 3.0]), 9.0).tolist() == [2.0, 3.0, 1.0, 9.0]
    warm = READINGS._replace(temperatures=np.array([20.0, 30.0, 40.0, 50.0]))
    temperatures = mine.readings(warm).temperatures
    assert temperatures is not None
    assert temperatures.tolist() == [40.0, 20.0, 30.0]
    assert mine.readings(READINGS).temperatures is None
    with pytest.raises(AgentError, match=r"temperatures have shape \(3,\).*4 channels"):
        mine.readings(READINGS._replace(temperatures=np.zeros(3)))


def test_an_idle_channel_that_reads_no_number_gets_a_finite_command() -> None:
    lengths = READINGS.lengths.copy()
    lengths[3] = np.nan
    command = order().command(np.zeros(3), READINGS._replace(lengths=lengths))
    assert np.isfinite(command).all()


def test_the_order_of_the_model_changes_nothing() -> None:
    same, ones = [0, 1, 2], np.ones(3)
    mine = order(
        channels=3, commands=same, lengths=same, tensions=same, command_signs=ones,
        length_signs=ones, tension_signs=ones,
    )  # fmt: skip
    assert not mine.changes


@pytest.mark.parametrize(
    ("field", "value", "reason"),
    [
        ("commands", [0, 0, 1], "commands is"),
        ("lengths", [0, 1, 4], "from 0 to 3"),
        ("tensions", [0, 1], "3 different"),
        ("length_signs", [1.0, 0.5, 1.0], "each 1 or -1"),
        ("tension_signs", [1.0], "each 1 or -1"),
    ],
)
def test_fields_that_do_not_fit_are_refused(field: str, value: object, reason: str) -> None:
    with pytest.raises(AgentError, match=reason):
        order(**{field: value})


def test_readings_of_another_number_of_channels_are_refused() -> None:
    with pytest.raises(AgentError, match="has 4 channels"):
        order().readings(SensorReadings(0.0, np.zeros(3), np.zeros(3)))


def test_a_map_without_muscles_has_the_lengths_of_the_others() -> None:
    whole = make_map()
    rest = whole.without(["m4", "m0"])
    kept = [MUSCLES.index(name) for name in rest.muscles]
    assert rest.muscles == ("m1", "m2", "m3")
    assert np.allclose(rest.lengths(postures(5)), whole.lengths(postures(5))[:, kept])
    assert np.allclose(rest.jacobian(postures(5)), whole.jacobian(postures(5))[:, kept])
    with pytest.raises(MappingError, match="unknown muscle 'm9'"):
        whole.without(["m9"])
    with pytest.raises(MappingError, match="no muscle is left"):
        whole.without(MUSCLES)


def test_a_map_without_a_muscle_has_the_tendons_of_the_others() -> None:
    compliance = 1e-6 * np.arange(1.0, 1.0 + len(MUSCLES))
    tendons = TendonStretch(compliance, 0.0 * compliance, 30.0 + 0.0 * compliance)
    jmm, q = replace(make_map(0), tendons=tendons), postures(3, 1)
    tensions = np.full((3, len(MUSCLES)), 80.0)
    kept = [0, 2, 3, 4]
    other = jmm.without([MUSCLES[1]])
    expected = jmm.lengths(q, tensions)[:, kept]
    np.testing.assert_allclose(other.lengths(q, tensions[:, kept]), expected, rtol=1e-12)

"""The monitor on motors of three sizes: temperatures, limits, faults, gaps and other units."""

from __future__ import annotations

import logging
from functools import cache

import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import MotorControl
from jmm_agent.heat.heat_monitor import HeatMonitor
from jmm_agent.heat.parameters import HeatOptions, ThermalParameters
from jmm_agent.observation import SensorReadings
from tests.jmm_agent.heat.plant import Plant, drive, monitor_of, sampled

MOTORS = 6
SIZES = {
    "medium": (HeatOptions(), MotorControl(), 4.0),
    "small": (
        HeatOptions(nominal=ThermalParameters(0.03, 2.6, 12.9, 1.93, 4.65)),
        MotorControl(3000.0, 3.0, 60.0),
        0.5,
    ),
    "big": (
        HeatOptions(nominal=ThermalParameters(2e-5, 600.0, 9000.0, 0.25, 0.8), limit=110.0),
        MotorControl(1e6, 200.0, 5000.0),
        30.0,
    ),
}
"""Options, motors and period of readings [s]: winding and housing have time constants of 41 s and
13 min, of 5 s and 60 s, and of 150 s and 2 h."""
NOISES = ((0.2, 0.5), (0.05, 0.0), (0.5, 0.1), (0.02, 1.0))
"""Noise and smallest step of a reading [K]."""


def trial(size: str, seed: int, noise: float = 0.2, quantum: float = 0.5, **more):  # type: ignore[no-untyped-def]
    """A plant and a monitor that were driven for six housing time constants."""
    options, motors, period = SIZES[size]
    plant = Plant(sampled(options, MOTORS, seed), noise=noise, quantum=quantum, seed=seed)
    monitor = monitor_of(MOTORS, options, motors)
    seconds = more.pop("housing_times", 6.0) * options.nominal.housing_time
    found = drive(plant, monitor, seconds, period, peak=motors.limit, **more)
    return plant, monitor, found


@cache
def usual(size: str, seed: int):  # type: ignore[no-untyped-def]
    """A trial without faults, to be left as it is."""
    return trial(size, seed)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("seed", [0, 1])
def test_no_core_exceeds_the_limit_and_its_interval_and_nothing_is_named(
    size: str, seed: int
) -> None:
    _, monitor, found = usual(size, seed)
    limit = monitor.options.limit
    assert found.hottest <= limit
    assert found.hottest > limit - 0.35 * (limit - 25.0)  # motors may be used
    inside = found.true <= found.high
    assert inside.mean() > 0.999
    assert not [fault for fault in found.named if fault[0] != "heat_limited"]


@pytest.mark.parametrize(("noise", "quantum"), NOISES)
def test_other_noise_and_resolution(noise: float, quantum: float) -> None:
    _, monitor, found = trial("medium", 2, noise, quantum)
    assert found.hottest <= monitor.options.limit
    assert (found.true <= found.high).mean() > 0.999
    assert not [fault for fault in found.named if fault[0] != "heat_limited"]


def test_learning_halves_the_error_of_the_data_sheet() -> None:
    options, motors, period = SIZES["medium"]
    errors = []
    for seed in range(2):
        _, _, learned = usual("medium", seed)
        plant = Plant(sampled(options, MOTORS, seed), seed=seed)
        monitor = monitor_of(MOTORS, options, motors)
        nothing = drive(
            plant, monitor, 6.0 * options.nominal.housing_time, period,
            masked=lambda readings, _: np.full_like(readings, np.nan),
        )  # fmt: skip
        half = len(learned.true) // 2
        errors.append([np.sqrt(np.mean((t.mean - t.true)[half:] ** 2)) for t in (learned, nothing)])
    learned_error, by_data_sheet = np.mean(errors, axis=0)
    assert learned_error < 0.5 * by_data_sheet


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize(("parameter", "factor"), [(4, 1.25), (0, 1.25), (4, 0.8)])
def test_a_change_of_a_warm_motor_is_named_by_its_parameter(
    size: str, parameter: int, factor: float
) -> None:
    options, motors, period = SIZES[size]
    plant = Plant(sampled(options, MOTORS, 3), seed=3)
    monitor = monitor_of(MOTORS, options, motors)
    lasting = options.nominal.housing_time
    fault = 4.0 * lasting

    def fails(time: float) -> None:
        if fault <= time < fault + period:
            plant.parameters[-2, parameter] *= factor

    found = drive(plant, monitor, fault + 0.9 * lasting, period, fails, peak=motors.limit)
    named = {where: time for (kind, where), time in found.named.items() if kind == "heat_changed"}
    assert list(named) == ["m4"]
    assert fault < named["m4"] < fault + 0.75 * lasting  # 10 minutes for the medium one
    detail = next(f.detail for f in monitor.faults if f.kind == "heat_changed")
    assert ("heat_per_tension", "", "", "", "housing_to_ambient")[parameter] in detail
    assert found.hottest <= options.limit


def test_warmer_surroundings_of_all_motors_are_no_fault() -> None:
    options, motors, period = SIZES["medium"]
    plant = Plant(sampled(options, MOTORS, 4), seed=4)

    def opens(time: float) -> None:
        if abs(time - 4.0 * options.nominal.housing_time) < 0.5 * period:
            plant.ambient += 4.0

    monitor = monitor_of(MOTORS, options, motors)
    found = drive(plant, monitor, 5.5 * options.nominal.housing_time, period, opens)
    assert not [fault for fault in found.named if fault[0] == "heat_changed"]


def test_a_sensor_that_is_missing_is_named_and_its_interval_is_wide() -> None:
    def without(readings: np.ndarray, _: float) -> np.ndarray:
        readings[2] = np.nan
        return readings

    _, monitor, found = trial("medium", 5, masked=without, housing_times=3.0)
    assert ("temperature_missing", "m2") in found.named
    assert {fault[1] for fault in found.named if fault[0] == "temperature_missing"} == {"m2"}
    core = monitor.core
    wide = core.high - core.mean
    assert wide[2] > 2.0 * np.delete(wide, 2)[1:3].max()
    assert (found.true <= found.high).mean() > 0.999
    assert found.hottest <= monitor.options.limit


def test_a_sensor_that_breaks_is_named_and_not_believed() -> None:
    options, _, _ = SIZES["medium"]
    breaks = 3.0 * options.nominal.housing_time

    def broken(readings: np.ndarray, time: float) -> np.ndarray:
        if time > breaks:
            readings[3] = 0.0
        return readings

    _, _, found = trial("medium", 6, masked=broken, housing_times=3.5)
    assert ("temperature_wrong", "m3") in found.named
    assert ("heat_changed", "m3") not in found.named
    assert found.hottest <= options.limit


def test_readings_by_a_clock_with_jitter_and_a_gap() -> None:
    options, _, period = SIZES["medium"]
    plant, monitor, before = trial("medium", 7, jitter=0.8, housing_times=3.0)
    assert before.hottest <= options.limit
    plant.advance(np.full(MOTORS, 150.0), 240.0)  # what motors do in a pause is not known
    begin = 3.0 * options.nominal.housing_time + 240.0
    zeros = np.zeros(MOTORS)
    monitor.update(SensorReadings(begin, zeros, zeros, temperatures=plant.read()), pause=240.0)
    core = monitor.core
    assert np.all(plant.core[:4] <= core.high[:4] + 1.0)
    assert np.all(core.high - core.mean > 3.0)
    again = drive(plant, monitor, 600.0, period, begin=begin + period)
    late = slice(len(again.true) // 2, None)
    assert (again.true[late] <= again.high[late]).all()
    assert not [fault for fault in again.named if fault[0] == "heat_changed"]


def test_after_a_power_cycle_the_housing_shows_the_state_and_parameters_are_kept() -> None:
    plant, monitor, _ = trial("medium", 8)
    learned = monitor.parameters
    monitor.reset()
    np.testing.assert_array_equal(monitor.parameters, learned)
    plant.advance(np.zeros(MOTORS), 30.0)  # switched off for half a minute
    zeros = np.zeros(MOTORS)
    monitor.update(SensorReadings(0.0, zeros, zeros, temperatures=plant.read()))
    core = monitor.core
    assert np.all(plant.core <= core.high)
    assert np.abs(monitor.housing - plant.housing).max() < 1.5


@pytest.mark.parametrize(
    ("convert", "unit"),
    [
        (lambda t: t + 273.15, "kelvin"),
        (lambda t: 1.8 * t + 32.0, "Fahrenheit"),
        (lambda t: 1000.0 * t, "no temperatures"),
    ],
)
def test_another_unit_at_the_start_is_refused_in_one_sentence(convert, unit: str) -> None:  # type: ignore[no-untyped-def]
    monitor = monitor_of(MOTORS, HeatOptions())
    housings = np.array([22.0, 24.0, 21.0, 40.0, 55.0, 23.0])
    zeros = np.zeros(MOTORS)
    with pytest.raises(AgentError, match=unit):
        monitor.update(SensorReadings(0.0, zeros, zeros, temperatures=convert(housings)))
    monitor.update(SensorReadings(0.0, zeros, zeros, temperatures=housings))


def test_readings_of_the_wrong_shape_or_time_are_refused() -> None:
    monitor, zeros = monitor_of(3, HeatOptions()), np.zeros(3)
    with pytest.raises(AgentError, match=r"\(3,\)"):
        monitor.update(SensorReadings(0.0, zeros, zeros, temperatures=np.zeros(4)))
    monitor.update(SensorReadings(5.0, zeros, zeros, temperatures=np.full(3, 25.0)))
    with pytest.raises(AgentError, match=r"4\.0 s come after"):
        monitor.update(SensorReadings(4.0, zeros, zeros, temperatures=np.full(3, 25.0)))
    with pytest.raises(AgentError, match="horizon"):
        monitor.tension_limits(horizon=0.0)
    with pytest.raises(AgentError, match="before the newest"):
        monitor.tension_limits(now=1.0)


def hot_monitor() -> HeatMonitor:
    monitor = monitor_of(3, HeatOptions())
    for second in range(600):
        tensions = np.array([30.0, 100.0, 140.0])
        temperatures = np.array([26.0, 45.0, 62.0])
        monitor.update(
            SensorReadings(float(second), np.zeros(3), tensions, temperatures=temperatures)
        )
    return monitor


def test_a_longer_horizon_and_a_hotter_motor_allow_less() -> None:
    monitor = hot_monitor()
    short, long = (monitor.tension_limits(horizon=h) for h in (5.0, 2000.0))
    assert np.all(long < short + 1e-9)
    assert long[0] < short[0]
    limits = monitor.tension_limits()
    assert np.all(np.diff(limits) < 0.0)
    assert np.all((limits >= 30.0) & (limits <= 500.0))


def test_a_command_is_cut_to_the_limit_and_named(caplog: pytest.LogCaptureFixture) -> None:
    monitor, motors = hot_monitor(), MotorControl()
    limits, lengths = monitor.tension_limits(), np.full(3, 0.1)
    wanted = lengths - (np.array([50.0, limits[1] + 60.0, limits[2] + 60.0]) - 30.0) / 30e3
    with caplog.at_level(logging.WARNING):
        command = monitor.limit(wanted, lengths)
    demanded = motors.demanded(lengths, command)
    np.testing.assert_allclose(demanded[1:], limits[1:])
    assert command[0] == wanted[0]
    assert {f.where for f in monitor.faults if f.kind == "heat_limited"} == {"m1", "m2"}
    assert "m2" in caplog.text
    assert "degC" in caplog.text
    assert monitor.too_hot().startswith("Too hot: muscle 'm1'")
    assert monitor.too_hot(limits - 1.0) == ""

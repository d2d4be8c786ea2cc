"""Motors that heat, integrated by small steps, and an agent's monitor beside them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from jmm_agent.guard.faults import MotorControl
from jmm_agent.heat.heat_monitor import HeatMonitor
from jmm_agent.heat.parameters import HeatOptions
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats

SMALLEST = 12
"""Steps of the integration in a core time constant."""
SAMPLED = 4
"""Periods between two comparisons of core temperatures."""


@dataclass
class Plant:
    """Motors by the same equations, but integrated by Heun's method.

    Attributes:
        parameters: h, C1, C2, R1 and R2 of each motor (m, 5).
        ambient: temperature of the surroundings [degC].
        noise: standard deviation of a reading [K].
        quantum: smallest step of a reading [K].
        growth: of the windings' resistance [1/K].
    """

    parameters: Floats
    ambient: float = 24.0
    noise: float = 0.2
    quantum: float = 0.5
    growth: float = 0.0039
    seed: int = 0
    core: Floats = field(init=False)
    housing: Floats = field(init=False)

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng([self.seed, 1])
        self.core = np.full(len(self.parameters), self.ambient)
        self.housing = self.core.copy()

    def _slopes(self, core: Floats, housing: Floats, heat: Floats) -> tuple[Floats, Floats]:
        h, c1, c2, r1, r2 = self.parameters.T
        flow = (core - housing) / r1
        warming = h * heat * (1.0 + self.growth * (core - 25.0))
        return (warming - flow) / c1, (flow - (housing - self.ambient) / r2) / c2

    def advance(self, tensions: Floats, seconds: float) -> None:
        _, c1, _, r1, _ = self.parameters.T
        count = int(np.ceil(seconds * SMALLEST / (r1 * c1).min()))
        dt, heat = seconds / count, tensions**2
        for _ in range(count):
            a, b = self._slopes(self.core, self.housing, heat)
            c, d = self._slopes(self.core + dt * a, self.housing + dt * b, heat)
            self.core = self.core + 0.5 * dt * (a + c)
            self.housing = self.housing + 0.5 * dt * (b + d)

    def read(self) -> Floats:
        reading = self.housing + self.noise * self.rng.standard_normal(len(self.housing))
        return np.round(reading / self.quantum) * self.quantum if self.quantum else reading


@dataclass
class Trial:
    """Result of `drive`.

    Attributes:
        true, mean, high: core temperatures at each step (K, m) [degC].
        hottest: of all cores at any time [degC].
        named: kind and muscle of each fault, with the time at which it was noticed first [s].
    """

    true: Floats
    mean: Floats
    high: Floats
    hottest: float
    named: dict[tuple[str, str], float]


def sampled(options: HeatOptions, count: int, seed: int, spread: float = 0.2) -> Floats:
    """Parameters of motors about the nominal ones (count, 5)."""
    rng = np.random.default_rng([seed, 2])
    departure = np.clip(rng.standard_normal((count, 5)), -2.0, 2.0)
    return np.asarray(options.nominal.array * np.exp(spread * departure))


def monitor_of(count: int, options: HeatOptions, motors: MotorControl | None = None) -> HeatMonitor:
    names = tuple(f"m{number}" for number in range(count))
    return HeatMonitor(names, motors or MotorControl(), options)


def drive(
    plant: Plant,
    monitor: HeatMonitor,
    seconds: float,
    period: float,
    events: Callable[[float], None] = lambda _: None,
    begin: float = 0.0,
    jitter: float = 0.0,
    masked: Callable[[Floats, float], Floats] = lambda readings, _: readings,
    peak: float = 500.0,
) -> Trial:
    """Pull with random tensions, some motors more than others, within the monitor's limits."""
    rng = np.random.default_rng([plant.seed, 3])
    count = len(plant.parameters)
    level = np.geomspace(0.1, 0.5, count) * peak
    rows, named, hottest, time = [], dict[tuple[str, str], float](), -np.inf, begin
    pulled, wanted, until = np.zeros(count), level, begin
    core_time = float(np.prod(plant.parameters[0][[1, 3]]))
    while time < begin + seconds:
        events(time)
        if time >= until:
            wanted = np.minimum(level * np.exp(0.5 * rng.standard_normal(count)), peak)
            until = time + core_time * rng.uniform(0.2, 1.0)
        read = np.maximum(0.0, pulled + 0.002 * peak * rng.standard_normal(count))
        stamp = time + jitter * period * rng.uniform(-0.5, 0.5)
        temperatures = masked(plant.read(), time)
        monitor.update(SensorReadings(stamp, np.zeros(count), read, temperatures=temperatures))
        if len(rows) * SAMPLED * period <= time - begin:
            core = monitor.core
            rows.append((plant.core, core.mean, core.high))
        pulled = np.minimum(wanted, monitor.tension_limits())
        plant.advance(pulled, period)
        time += period
        hottest = max(hottest, float(plant.core.max()))
        for fault in monitor.faults:
            named.setdefault((fault.kind, fault.where), time)
    true, mean, high = (np.array(column) for column in zip(*rows, strict=True))
    return Trial(true, mean, high, hottest, named)

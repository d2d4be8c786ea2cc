"""Readings of a real machine: sampled, with noise, and rounded to the steps of its sensors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hidden_plants.secret import Effect
from hidden_plants.strangers.loop import simulate
from hidden_plants.strangers.mechanisms import build
from hidden_plants.strangers.mismatch import Mismatch
from hidden_plants.strangers.plant import Readings, real_step
from hidden_plants.strangers.stranger import Stranger
from hidden_plants.types import Floats

MOST_TRAVEL = 1.6
"""Largest distance from zero of a joint of a sound run, over the end of its range."""


@dataclass(frozen=True)
class Run:
    """Readings without noise of all episodes.

    Attributes:
        times: of the readings of each episode (k,) [s].
        readings: of each episode, by sensor (k,).
        peak: largest force of each drive (drives,).
        sound: whether the machine stayed within its ranges and finite.
    """

    times: tuple[Floats, ...]
    readings: tuple[Readings, ...]
    peak: Floats
    sound: bool


def run(
    stranger: Stranger,
    mismatch: Mismatch,
    effects: tuple[Effect, ...],
    step: float,
    jitter: float = 0.0,
) -> Run:
    """Simulate all episodes of a real machine.

    Args:
        stranger: nominal machine.
        mismatch: of the real machine.
        effects: hidden effects.
        step: physics step [s].
        jitter: half width of the instants of commands and readings, over the sampling interval [1].
    """
    plant = build(stranger, mismatch, effects, step)
    times, readings = [], []
    peak, sound, start = np.zeros(len(stranger.moved)), True, 0.0
    ends = np.array([link.range[1] for link in stranger.skeleton.links])
    for k, (_, command) in enumerate(stranger.commands):
        sampled = reading_times(stranger, k, jitter)
        trace = simulate(plant, k, command_times(stranger, k, jitter), command, start)
        sound = sound and trace.sound and bool(np.all(np.abs(trace.position) < MOST_TRAVEL * ends))
        if not sound:
            break
        signals = {"effort": trace.force, "force": trace.force, "length": trace.encoder}
        signals |= {"position": trace.encoder, "velocity": trace.velocity}
        found = {}
        for sensor in stranger.sensors:
            when = sampled / (1.0 + plant.drift) - plant.reading_delay.get(sensor.name, 0.0)
            values = np.interp(when, trace.time, signals[sensor.kind][:, sensor.index])
            values = values * plant.reading_scale.get(sensor.name, 1.0)
            found[sensor.name] = values + plant.reading_offset.get(sensor.name, 0.0)
        for change in plant.reading_effects:
            change(found, start + sampled)
        times.append(sampled)
        readings.append(found)
        peak = np.maximum(peak, np.abs(trace.force).max(axis=0))
        start += stranger.paths[k].duration
    return Run(tuple(times), tuple(readings), peak, sound)


def real_run(
    stranger: Stranger, mismatch: Mismatch, effects: tuple[Effect, ...], jitter: float = 0.0
) -> Run:
    """Simulate all episodes of a real machine, which has no physics step.

    Readings are extrapolated to a step of zero from two small ones (Richardson): a stiff servo
    multiplies what even a small step does to a position.

    Args:
        stranger, mismatch, effects, jitter: see `run`.
    """
    step = real_step(stranger)
    rough = run(stranger, mismatch, effects, step, jitter)
    if not rough.sound:
        return rough
    fine = run(stranger, mismatch, effects, 0.5 * step, jitter)
    if not fine.sound:
        return fine
    pairs = zip(rough.readings, fine.readings, strict=True)
    readings = tuple({name: 2.0 * b[name] - a[name] for name in a} for a, b in pairs)
    return replace(fine, readings=readings)


def command_times(stranger: Stranger, episode: int, jitter: float) -> Floats:
    """True instants of the commands of an episode (n,) [s], increasing from 0."""
    time = stranger.commands[episode][0]
    rng = np.random.default_rng([stranger.seed, 2, episode])
    shift = jitter / stranger.traits.rate * rng.uniform(-1.0, 1.0, len(time))
    shift[0] = 0.0
    return time + shift


def reading_times(stranger: Stranger, episode: int, jitter: float) -> Floats:
    """True instants of the readings of an episode (n,) [s], half an interval after the commands."""
    time = stranger.commands[episode][0]
    rng = np.random.default_rng([stranger.seed, 3, episode])
    shift = jitter * rng.uniform(-1.0, 1.0, len(time))
    return time + (0.5 + shift) / stranger.traits.rate


def noisy(stranger: Stranger, episode: int, clean: Readings) -> Readings:
    """Add noise to the readings of an episode and round them to the steps of their sensors."""
    rng, found = stranger.generator(4, episode), {}
    for sensor in stranger.sensors:
        values = clean[sensor.name]
        values = values + sensor.noise * rng.standard_normal(len(values))
        found[sensor.name] = sensor.quantum * np.round(values / sensor.quantum)
    return found


def whitened(stranger: Stranger, found: Run) -> Floats:
    """All readings over their standard deviations (k,)."""
    rows = [
        readings[sensor.name] / sensor.deviation
        for readings in found.readings
        for sensor in stranger.sensors
    ]
    return np.concatenate(rows)

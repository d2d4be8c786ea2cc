"""Synthetic studies: the replay of a known hypothesis, plus noise, in place of measurements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reality_gap.simulation.hypothesis import Hypothesis, build
from reality_gap.simulation.replay import replay
from reality_gap.study.data import Reading, Study
from reality_gap.study.measurements import measured
from reality_gap.study.system import compile_system, with_step


def simulate_study(
    study: Study, hypothesis: Hypothesis, rng: np.random.Generator, step: float = 1.0
) -> Study:
    """Simulate the readings of a study under a known hypothesis.

    Args:
        study: commands, times of the readings and noise; its readings are replaced.
        hypothesis: candidates with their true values.
        rng: random generator of the noise.
        step: physics step of the simulation, relative to the model's.

    Returns:
        The study with simulated readings and the standard deviation of their noise.
    """
    readings = measured(study)
    plant = build(with_step(compile_system(study), step), hypothesis)
    truth = replay(plant, study, readings).prediction
    noisy = truth + readings.noise * rng.standard_normal(len(truth))
    episodes = []
    for e, episode in enumerate(study.episodes):
        signals = []
        for c, reading in enumerate(episode.readings):
            at = (readings.episode == e) & (readings.channel == c)
            signals.append(Reading(reading.time, noisy[at]))
        episodes.append(replace(episode, readings=tuple(signals)))
    channels = tuple(
        replace(channel, noise=float(readings.noise[readings.channel == c].min()))
        for c, channel in enumerate(study.channels)
    )
    return replace(study, channels=channels, episodes=tuple(episodes))

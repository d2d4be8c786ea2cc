"""Studies whose truth is known: a machine's own replay, with noise, in place of a measurement."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reality_gap.simulation.hypothesis import build
from reality_gap.simulation.replay import replay
from reality_gap.simulation.replayer import Hypothesis
from reality_gap.study.data import Reading, Study
from reality_gap.study.measurements import measured
from reality_gap.study.system import look_at


def simulate(
    study: Study, hypothesis: Hypothesis, rng: np.random.Generator, step: float = 1.0
) -> Study:
    """The study as it would be if ``hypothesis`` were the truth: same commands, other readings.

    Args:
        study: whose readings are replaced.
        hypothesis: the truth.
        rng: of the noise.
        step: physics step of the truth over the model's.
    """
    readings = measured(study)
    system = look_at(study)
    plant = build(system, list(hypothesis))
    plant.spec.option.timestep *= step
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
        replace(channel, noise=float(readings.noise[readings.channel == c][0]))
        for c, channel in enumerate(study.channels)
    )
    return replace(study, channels=channels, episodes=tuple(episodes))

"""Traces: measured and replayed signals by channel and episode, for figures and tables."""

from __future__ import annotations

from reality_gap.diagnosis import Trace
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.splits import split
from reality_gap.types import Floats


def traces(replayer: Replayer, before: Floats, after: Floats) -> tuple[Trace, ...]:
    """Return the traces of all channels that were measured in an episode.

    Args:
        replayer: replays of the study.
        before, after: residuals of the nominal and of the extended model in units of noise,
            shape (n,).
    """
    study, readings = replayer.system.study, replayer.measured
    role = split(readings)
    found = []
    for e, episode in enumerate(study.episodes):
        for c, channel in enumerate(study.channels):
            at = (readings.episode == e) & (readings.channel == c)
            value, noise = readings.value[at], readings.noise[at]
            if len(value):
                found.append(
                    Trace(
                        channel=channel.name,
                        episode=episode.name,
                        unit=channel.unit,
                        noise=float(noise[0]),
                        time=readings.time[at],
                        split=role[at],
                        measured=value,
                        before=value - before[at] * noise,
                        after=value - after[at] * noise,
                    )
                )
    return tuple(found)

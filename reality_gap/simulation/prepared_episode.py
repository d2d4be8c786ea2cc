"""Prepared episodes: weighted efforts, with the motion along which they were measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from reality_gap.errors import StudyError
from reality_gap.simulation.effort_filter import Weights, weights
from reality_gap.simulation.measured_motion import Motion, low_pass
from reality_gap.study.data import Episode, Reading, Study
from reality_gap.types import Floats


@dataclass(frozen=True, kw_only=True)
class PreparedEpisode(Episode):
    """An episode of a prepared study.

    Attributes:
        motion: the motion along which its efforts were measured.
        weights: of the samples of each effort (c,).
    """

    motion: Motion
    weights: tuple[Weights, ...]

    def samples(self, channel: int, effort: Floats) -> Floats:
        """Return the samples (n,) of a computed effort that are compared with a channel's.

        Args:
            channel: index of the effort.
            effort: at the times of the motion, shape (k,).
        """
        low = low_pass(effort, self.motion.cutoff, self.motion.step)
        time = self.readings[channel].time
        return self.weights[channel](np.interp(time, self.motion.time, low))


def prepared_episodes(study: Study) -> list[PreparedEpisode]:
    """Return the episodes of a prepared study.

    Raises:
        StudyError: the study is not prepared.
    """
    found = [episode for episode in study.episodes if isinstance(episode, PreparedEpisode)]
    if len(found) < len(study.episodes):
        raise StudyError(f"the study {study.name} compares efforts and was not prepared")
    return found


def weighted_episodes(
    episodes: Sequence[Episode],
    motions: Sequence[Motion],
    readings: Sequence[Sequence[Reading]],
    shapes: Floats,
    period: float,
) -> list[PreparedEpisode]:
    """Weight the independent samples of efforts.

    Args:
        episodes: the episodes.
        motions: the motion of each.
        readings: the independent samples of each effort (c,) in each.
        shapes: coefficients of the noise of each effort, shape (c, 2); see `roll_off`.
        period: of the readings [s].
    """
    each = [
        [weights(motion, r.time, shape, period) for r, shape in zip(some, shapes, strict=True)]
        for motion, some in zip(motions, readings, strict=True)
    ]
    factors = [
        _same_size([w[c] for w in each], [r[c] for r in readings]) for c in range(len(shapes))
    ]
    found = []
    for episode, motion, some, own in zip(episodes, motions, readings, each, strict=True):
        scaled = tuple(w.times(factor) for w, factor in zip(own, factors, strict=True))
        weighted = tuple(replace(r, value=w(r.value)) for r, w in zip(some, scaled, strict=True))
        kept = {f.name: getattr(episode, f.name) for f in fields(Episode)}
        kept |= {"readings": weighted}
        found.append(PreparedEpisode(**kept, motion=motion, weights=scaled))
    return found


def _same_size(each: Sequence[Weights], readings: Sequence[Reading]) -> float:
    """Return the factor with which weighted samples have the size of those before."""
    before = np.concatenate([reading.value for reading in readings])
    after = np.concatenate([w(r.value) for w, r in zip(each, readings, strict=True)])
    size = float(np.linalg.norm(after))
    return float(np.linalg.norm(before)) / size if size else 1.0

"""Real machines with hidden effects, for whoever looks for the reality gap.

It shares no code with whoever looks: neither imports the other. A secret is drawn, a machine with
it in is run, and its logs are written as a study; the truth comes back and is never written there::

    secret = draw(np.random.default_rng(7), "single")
    truth = write_study(Path("out/study"), secret, seed=7)
    run(Path("out/study"), secret, 7, time, command)  # one more motion on the same machine

Lengths are in m, tensions and forces in N, angles in rad, times in s. An effect "at a time" counts
log time: the episodes end to end, in the order of the study, without the time to settle.
"""

from __future__ import annotations

from hidden_plants.draw import draw
from hidden_plants.nuisance import Nuisance
from hidden_plants.oracle import detection_limit
from hidden_plants.secret import CATALOGUE, OUTSIDE, Effect, Secret
from hidden_plants.study import EpisodeTruth, Truth, run, write_study

__all__ = [
    "CATALOGUE",
    "OUTSIDE",
    "Effect",
    "EpisodeTruth",
    "Nuisance",
    "Secret",
    "Truth",
    "detection_limit",
    "draw",
    "run",
    "write_study",
]

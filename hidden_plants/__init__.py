"""Simulated real machines with hidden effects, to test a diagnosis of the reality gap.

The package shares no code with the diagnosis: neither imports the other. `sample_secret` chooses
the effects, `write_study` simulates the machine that has them and writes its logs as a study. The
truth is returned and never written to the study::

    secret = sample_secret(np.random.default_rng(7), "single")
    truth = write_study(Path("out/study"), secret, seed=7)
    run(Path("out/study"), secret, 7, time, command)  # one more motion on the same machine

Units: lengths [m], tensions and forces [N], angles [rad], times [s]. A start time of an effect
counts log time: the episodes end to end, in the order of the study, without the settling time.
"""

from __future__ import annotations

from hidden_plants.nuisance import Nuisance
from hidden_plants.oracle import detection_limit
from hidden_plants.sampling import sample_secret
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
    "run",
    "sample_secret",
    "write_study",
]

"""Machines of all kinds and sizes, made from a seed, with hidden effects.

`make_stranger` makes a nominal machine, `sample_secret` hides effects in it in multiples of the
smallest ones that its readings show, and `write_study` simulates the real machine and writes its
logs. The package shares no code with the diagnosis::

    stranger = make_stranger(7)
    oracle = Oracle(stranger)
    secret = sample_secret(np.random.default_rng(7), stranger, oracle, "single")
    write_study(Path("out/study"), stranger, secret.effects)

Seeds 0 to 999 are for tuning; reported runs use seeds from 10000 on.
"""

from __future__ import annotations

from hidden_plants.strangers.oracle import Oracle
from hidden_plants.strangers.sampling import KINDS, Secret, sample_secret
from hidden_plants.strangers.stranger import Stranger, make_stranger
from hidden_plants.strangers.study import write_study

__all__ = [
    "KINDS",
    "Oracle",
    "Secret",
    "Stranger",
    "make_stranger",
    "sample_secret",
    "write_study",
]

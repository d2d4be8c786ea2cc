"""Random choice of the hidden effects of a machine and of their amplitudes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hidden_plants.secret import Effect
from hidden_plants.strangers.mechanisms import ADDED, MECHANISMS, OUTSIDE
from hidden_plants.strangers.mechanisms.mechanism import Structure
from hidden_plants.strangers.mismatch import sample_mismatch
from hidden_plants.strangers.oracle import Oracle
from hidden_plants.strangers.plant import real_step
from hidden_plants.strangers.readings import run
from hidden_plants.strangers.stranger import Stranger

KINDS = ("single", "pair", "null", "outside")
LOWEST, HIGHEST = 2.0, 50.0
"""Bounds of the sampled amplitudes, as multiples of the oracle's floor."""
FIXED = ("mirrored_reading",)
"""Effects that have one amplitude only."""
TRIALS = 60
"""Largest number of structures that are tried."""


@dataclass(frozen=True)
class Secret:
    """Effects hidden in one machine.

    Attributes:
        kind: "single", "pair", "null" or "outside".
        effects: none, one or two.
        multiples: amplitude of each effect over its floor.
    """

    kind: str
    effects: tuple[Effect, ...] = ()
    multiples: tuple[float, ...] = ()


def sample_secret(
    rng: np.random.Generator,
    stranger: Stranger,
    oracle: Oracle,
    kind: str,
    family: str | None = None,
) -> Secret:
    """Sample hidden effects.

    The id is uniform, then the elements and shape are, then the amplitude is log-uniform between 2
    and 50 floors and at most the largest physical one. An effect is sampled again if twice its
    floor is not physical or if the machine then leaves its ranges.

    Args:
        rng: random numbers.
        stranger: nominal machine.
        oracle: of the machine.
        kind: "single", "pair" (two different ids), "null" or "outside".
        family: id of the first effect; any by default.

    Raises:
        ValueError: the kind or id is unknown, the machine shows no such effect, or it leaves its
            ranges without any.
    """
    if kind not in KINDS:
        raise ValueError(f"unknown kind {kind!r}; valid are: {', '.join(KINDS)}")
    if family is not None and family not in MECHANISMS:
        raise ValueError(f"unknown effect {family!r}; valid are: {', '.join(MECHANISMS)}")
    effects: tuple[Effect, ...] = ()
    multiples: tuple[float, ...] = ()
    wanted = {"single": 1, "pair": 2, "null": 0, "outside": 1}[kind]
    if not wanted and not _is_sound(stranger, ()):
        raise ValueError(f"machine {stranger.seed} leaves its ranges with no effect")
    for _ in range(TRIALS):
        if len(effects) == wanted:
            return Secret(kind, effects, multiples)
        first = family if not effects else None
        found = _effect(rng, stranger, oracle, _ids(kind, first, effects), effects)
        if found is not None:
            effects, multiples = (*effects, found[0]), (*multiples, found[1])
    raise ValueError(f"machine {stranger.seed} shows no effect for a trial of kind {kind!r}")


def _ids(kind: str, family: str | None, effects: tuple[Effect, ...]) -> list[str]:
    if family is not None:
        return [family]
    used = {effect.id for effect in effects}
    outside = kind == "outside"
    return [id for id in MECHANISMS if (id in OUTSIDE) == outside and id not in used]


def _effect(
    rng: np.random.Generator,
    stranger: Stranger,
    oracle: Oracle,
    ids: list[str],
    before: tuple[Effect, ...],
) -> tuple[Effect, float] | None:
    """An effect of one of the ids and its multiple of the floor; None if it cannot be shown."""
    rng, structures = _structures(rng, stranger, ids)
    if not structures:
        return None
    structure = structures[int(rng.integers(len(structures)))]
    if structure.id in FIXED:
        effect = structure.at(structure.most)
        return (effect, float("inf")) if _is_sound(stranger, (*before, effect)) else None
    floor = max(oracle.floor(structure), structure.least / LOWEST)
    high = min(HIGHEST * floor, structure.most)
    if not LOWEST * floor <= high:
        return None
    amplitude = float(np.exp(rng.uniform(np.log(LOWEST * floor), np.log(high))))
    while amplitude >= LOWEST * floor:
        effect = structure.at(amplitude)
        if _is_sound(stranger, (*before, effect)):
            return effect, amplitude / floor
        amplitude *= 0.5
    return None


def _structures(
    rng: np.random.Generator, stranger: Stranger, ids: list[str]
) -> tuple[np.random.Generator, list[Structure]]:
    """Structures of one of the ids that a machine has, and the generator of all that follows.

    Whether it is one of `ADDED` is sampled with a generator of its own, which leaves ``rng`` as it
    is, and so is all that follows for such an id.
    """
    [own] = rng.spawn(1)
    added, known = (
        {id: MECHANISMS[id].structures(stranger, one) for id in ids if (id in ADDED) == is_added}
        for is_added, one in ((True, own), (False, rng))
    )
    added, known = ({k: v for k, v in table.items() if v} for table in (added, known))
    if added and own.random() * (len(added) + len(known)) < len(added):
        return own, added[str(own.choice(list(added)))]
    return rng, known[str(rng.choice(list(known)))] if known else []


def _is_sound(stranger: Stranger, effects: tuple[Effect, ...]) -> bool:
    """Whether the real machine stays within its ranges with these effects."""
    return run(stranger, sample_mismatch(stranger), effects, real_step(stranger)).sound

"""Machine with one hidden effect whose size can be compared with one number of a diagnosis."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from experiments.harness.errors import ExperimentError
from experiments.strangers_bench.scores import (
    PARAMETERS,
    same_location,
    sized_parameter,
    true_names,
)
from experiments.strangers_bench.trial import Hidden, machine, truth
from hidden_plants.strangers import Oracle, Secret, Stranger, make_stranger, sample_secret
from hidden_plants.strangers.study import write_study
from hidden_plants.strangers.truth import PLAIN
from reality_gap import CATALOGUE, Candidate, Study, load_study
from reality_gap.inference.screening import list_candidates
from reality_gap.study.system import System

SAMPLES = 12
"""Largest number of effects that are sampled on a machine."""
READING_ONLY = ("reading_zero", "reading_scale")
"""Effects that change a reading and not the drive that the same encoder feeds."""


@dataclass(frozen=True)
class Known:
    """A machine with an effect whose structure is known.

    Attributes:
        hidden: the machine and its effect.
        oracle: of the machine.
    """

    hidden: Hidden
    oracle: Oracle

    def realisation(self, number: int) -> Stranger:
        """The machine with the mismatches and noise of a number."""
        return replace(self.hidden.stranger, realisation=number)

    def size(self, number: int) -> float:
        """True size of the effect in a realisation."""
        [effect] = self.hidden.secret.effects
        return float(truth(self.realisation(number), effect, 1.0)["size"])

    def study(self, folder: Path, number: int) -> Study:
        """Write the study of a realisation and load it."""
        try:
            write_study(folder, self.realisation(number), self.hidden.secret.effects)
        except ValueError as error:
            raise ExperimentError(f"estimator-variance, realisation {number}: {error}.") from error
        return load_study(folder / "STUDY.yaml")


def hide_known(seed: int, seconds: float) -> Iterator[Known]:
    """Yield the machine of a seed with one effect after another that has a true size.

    The study states the noise of its sensors, which the bound knows, too. A machine that shows no
    effect yields none.

    Args:
        seed: of the machine.
        seconds: length of its log [s].
    """
    made = make_stranger(seed, seconds)
    stranger = replace(made, traits=replace(made.traits, noise_stated=True))
    rng, oracle = np.random.default_rng([seed, 13]), Oracle(stranger)
    for _ in range(SAMPLES):
        try:
            secret = sample_secret(rng, stranger, oracle, "single")
        except ValueError:  # it shows no effect
            return
        if _has_size(stranger, secret):
            yield Known(Hidden(stranger, secret), oracle)


def _has_size(stranger: Stranger, secret: Secret) -> bool:
    """Return whether an effect has one size, which a cause of the catalogue may have, too."""
    [effect] = secret.effects
    names = true_names(_trial(stranger), {"effect": effect.id})
    return effect.id in PLAIN and any(name in PARAMETERS for name in names)


def _trial(stranger: Stranger) -> dict[str, Any]:
    """Return the entries of a trial of the strangers' bench by which names are compared."""
    return {"case": {"kind": "single"}, "machine": machine(stranger)}


def right_candidate(system: System, known: Known) -> tuple[Candidate, str] | None:
    """Find the candidate that is the hidden effect, and its only parameter.

    Args:
        system: of the study.
        known: the machine and its effect.

    Returns:
        None if no cause expresses the effect by one parameter, or if several locations are alike.
    """
    [effect] = known.hidden.secret.effects
    trial, hidden = _trial(known.hidden.stranger), truth(known.hidden.stranger, effect, 1.0)
    found = []
    for one in list_candidates(system, list(CATALOGUE.values())):
        elements, values = list(one.location.elements), one.null_values()
        cause = {"cause": one.cause.id, "elements": elements, "parameters": values}
        name = sized_parameter(trial, hidden, cause)
        if name and not one.location.log and same_location(trial, hidden["elements"], elements):
            found.append((one, name))
    note = "reading only" if effect.id in READING_ONLY else ""
    for test in (
        lambda one: list(one.location.elements) == hidden["elements"],
        lambda one: one.location.note == note,
    ):
        found = [pair for pair in found if test(pair[0])] or found
    if len(found) != 1 or len(found[0][0].parameters) != 1:
        return None
    return found[0]

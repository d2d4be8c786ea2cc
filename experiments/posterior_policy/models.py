"""What a policy is trained on: the drawing, guesses, the extended model, samples, or the robot."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import mujoco

from experiments.harness.errors import ExperimentError
from experiments.robots.guessed_models import guessed_models
from kengoro.study_model import study_model
from kengoro_env.assets import asset_path
from kengoro_env.env import TASKS, own_model
from kengoro_env.errors import KengoroError
from reality_gap.extended import Extended
from reality_gap.posterior import Posterior
from reality_gap.report.extended_model import load_extended
from reality_gap.report.posterior_file import JSON, load_posterior
from reality_gap.simulation.hypothesis import Part

DRAWING, GUESSED, EXTENDED, POSTERIOR, TRUE = CONDITIONS = (
    "drawing", "guessed", "extended", "posterior", "true",
)  # fmt: skip
"""What policies are trained on."""
DIAGNOSED = (EXTENDED, POSTERIOR)
"""Conditions that need the diagnosis of a robot."""
NAMES = {
    DRAWING: "(a) drawing",
    GUESSED: "(b) drawing, +-20 %",
    EXTENDED: "(c) extended model",
    POSTERIOR: "(d) posterior",
    TRUE: "(e) the robot itself",
}
MOST = 4
"""Samples are drawn until there are enough that fit, at most this multiple of them."""


class Models(NamedTuple):
    """Models to train on.

    Attributes:
        specs: one for each environment; empty if none fits.
        refused: a sentence for each model that the environments refuse.
        beside: effects that the models have beside their MJCF, which are not simulated.
    """

    specs: list[mujoco.MjSpec]
    refused: list[str]
    beside: list[str]


def guessed(count: int, seed: int) -> Models:
    """Guesses of `guessed_models`."""
    nominal = study_model(asset_path("mjcf/kengoro_arm/posture.xml"))
    return Models(guessed_models(nominal, count, seed), [], [])


def extended(folder: Path, count: int) -> Models:
    """The extended model of a diagnosis, once for each environment."""
    found = load_extended(folder)
    reason = refusal(found.spec, "the extended model")
    specs = [] if reason else [found.spec] * count
    return Models(specs, [reason] if reason else [], sorted(_beside([found])))


def samples(folder: Path, count: int, seed: int) -> Models:
    """Samples of the posterior of a diagnosis that the environments take.

    Args:
        folder: of the diagnosis.
        count: number of environments.
        seed: of the samples.

    Returns:
        As many models as environments; fewer samples that fit repeat.
    """
    if not (folder / JSON).exists():
        return Models([], ["the gap is unexplained: the diagnosis has no samples"], [])
    return usable(load_posterior(folder), count, seed)


def usable(posterior: Posterior, count: int, seed: int) -> Models:
    """Samples that the environments take; see `samples`."""
    taken: list[Extended] = []
    refused: list[str] = []
    for i, parts in enumerate(posterior.hypotheses(MOST * count, seed)):
        sample = posterior.extended(parts)
        reason = refusal(sample.spec, f"sample {i}")
        if reason is None:
            taken.append(sample)
        else:
            refused.append(f"{reason} (by {', '.join(_guilty(posterior, parts))})")
        if len(taken) == count:
            break
    repeated = [taken[i % len(taken)].spec for i in range(count)] if taken else []
    return Models(repeated, refused, sorted(_beside(taken)))


def refusal(spec: mujoco.MjSpec, name: str) -> str | None:
    """Why the environments refuse a model, one sentence; None if they take it."""
    try:
        own_model(spec, TASKS["posture"](), name=name)
    except KengoroError as error:
        return str(error)
    return None


def _guilty(posterior: Posterior, parts: Sequence[Part]) -> list[str]:
    """Causes for which alone a model would be refused; all of them if it is their combination."""
    alone = [part for part in parts if refusal(posterior.extended([part]).spec, "it")]
    return sorted({candidate.cause.id for candidate, _ in alone or parts})


def _beside(found: Iterable[Extended]) -> set[str]:
    return {effect.cause.id for one in found for effect in one.effects}


def models_of(condition: str, folder: Path | None, count: int, seed: int) -> Models | None:
    """Models of a condition; None if it has none but a robot, actual or nominal.

    Args:
        condition: one of `CONDITIONS`.
        folder: of the diagnosis; needed by those of `DIAGNOSED`.
        count: number of environments.
        seed: of guesses and samples.

    Raises:
        ExperimentError: the condition needs a diagnosis and there is none.
    """
    if condition == GUESSED:
        return guessed(count, seed)
    if condition not in DIAGNOSED:
        return None
    if folder is None:
        raise ExperimentError(f"Training on the condition {condition!r} needs a diagnosis.")
    return extended(folder, count) if condition == EXTENDED else samples(folder, count, seed)

"""Strange robots: eight families that the preset's departures do not describe.

An agent with default options learns on each, as a user's would; after some looks at its hand it
moves to other postures without learning. The robot of the preset with the same seed, which learns
from the same postures, is beside it. Robots with swapped motors or without a wire are learned a
second time after a commissioning run.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from experiments.harness import common
from experiments.harness.common import Summary
from experiments.harness.errors import ExperimentError
from experiments.harness.experiment import Experiment, Findings, Results, run_experiment
from experiments.strange_robots.families import FAMILIES, PRESET
from experiments.strange_robots.tables import (
    COMMISSIONED,
    CONDITIONS,
    metrics,
    per_seed,
    tables,
)
from experiments.strange_robots.trial import Sizes, learn

QUICK = Sizes(
    counts=(1, 2), long=3, tested=1, loads=(0.0, 1.0), known=1, move=0.8, patience=1.2,
    test_move=0.6, test_hold=0.6,
)  # fmt: skip


def run(condition: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """Learn on a robot of a family, perhaps after a commissioning run."""
    family = COMMISSIONED.get(condition, condition)
    return learn(family, seed, sizes, cache, run=condition in COMMISSIONED)


def conclude(results: Results, sizes: Sizes) -> Findings:
    """Errors by family beside what they must be, and what was named."""
    from experiments.strange_robots.figures import pictures

    return Findings(
        metrics(results, sizes),
        per_seed(results),
        tables(results, sizes),
        pictures(results, sizes),
        {"families": {name: family.title for name, family in FAMILIES.items()}},
    )


EXPERIMENT = Experiment(
    name="strange-robots",
    title="Strange robots",
    introduction=(
        "Robots that the preset's departures do not describe, made by editing model, lens or "
        "sensors. An agent with default options learns on each; after some looks at its hand it "
        "moves to other postures, without learning. The hand's error counts from where the hand "
        "is by the drawing at the target. Ratios are to the robot of the preset with the same "
        "seed, which learns from the same postures."
    ),
    figure="beyond the paper",
    conditions=CONDITIONS,
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
    others=("experiments/stiffness_and_load", "experiments/posture_accuracy"),
)


def with_long(sizes: Sizes, long: int) -> Sizes:
    """Sizes with another number of looks of the robots that drift.

    Raises:
        ExperimentError: it is not above that of the others.
    """
    if long <= max(sizes.counts):
        raise ExperimentError(
            f"Long is {long} looks, but must be more than the {max(sizes.counts)} of other robots."
        )
    return replace(sizes, long=long)


def chosen(only: tuple[str, ...]) -> tuple[str, ...]:
    """Conditions of these names, and the preset, which the others are compared with; () means all.

    Raises:
        ExperimentError: a name is not one of a condition.
    """
    unknown = [name for name in only if name not in CONDITIONS]
    if unknown:
        raise ExperimentError(f"Unknown robots {unknown}; robots are {', '.join(CONDITIONS)}.")
    return tuple(one for one in CONDITIONS if not only or one in (PRESET, *only))


@dataclass(frozen=True)
class Args(common.Args):
    """Robots that the preset's departures do not describe.

    Attributes:
        long: number of looks of the robots that drift, and of the preset's.
        only: names of some robots, as `drift`; the preset's robot is always one. All by default.
    """

    seeds: str = "0-4"
    out: Path = Path("out/strange-robots")
    long: int = Sizes().long
    only: tuple[str, ...] = ()


def main(args: Args) -> Summary:
    """Run the experiment; returns its summary."""
    sizes, conditions = with_long(EXPERIMENT.sizes, args.long), chosen(args.only)
    return run_experiment(replace(EXPERIMENT, sizes=sizes, conditions=conditions), args)

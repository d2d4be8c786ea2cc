"""Initial training (paper, sec. II-A, IV-A): the map of every group from the nominal model.

Our training and the recipe of the paper learn the same nominal model. No robot moves: a seed is
that of the training. Both maps are evaluated on the same new postures in the whole joint ranges.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from experiments.harness import common
from experiments.harness.common import Summary
from experiments.harness.experiment import Experiment, Findings, Results, run_experiment
from experiments.harness.report import Table
from experiments.harness.statistics import interval, metric, paired
from experiments.initial_training.flexion import Flexion
from experiments.initial_training.paper_recipe import EPOCHS, PaperReport, Share, train_as_paper
from jmm_agent.mapping.group_map import METRES
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.recipe import Recipe
from jmm_agent.mapping.training import GroupReport, train
from jmm_agent.nominal_model import NominalModel
from kengoro.trained_maps import nominal_model
from kengoro_env.names import GROUP_JOINTS

OURS, PAPER = "ours", "paper"
MUST = 0.1
"""Threshold of the RMSE of our training in every group [mm]."""
PAPERS = 1.0
"""Upper bound of the RMSE of the paper's training [mm]."""
EVALUATED = 5000
"""Number of postures on which a map is evaluated."""


@dataclass(frozen=True)
class Sizes:
    """Amount of training.

    Attributes:
        steps: Adam steps of ours, see `Recipe`.
        samples, least_steps: of the paper's, see `Share`.
    """

    steps: int = Recipe().steps
    samples: int = 35_280
    least_steps: int = 30_000


QUICK = Sizes(steps=20, samples=1_000, least_steps=1_000)


@dataclass(frozen=True)
class Args(common.Args):
    """Training of the map of the nominal model by two recipes (Fig. 6).

    Attributes:
        seeds: seeds of the training, as A-B or A; seeds below 100 are for tuning.
        out: folder of the results.
        samples: number of postures of the grid for the paper's recipe; 2646000 is the whole grid,
            whose time is in the report.
    """

    seeds: str = "0-9"
    out: Path = Path("out/initial-training")
    samples: int | None = None


def run(condition: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """Train all groups by one of the two recipes and evaluate the map."""
    nominal = nominal_model()
    begin = _processor_time()
    groups: dict[str, dict[str, Any]]
    if condition == OURS:
        recipe = Recipe(steps=sizes.steps)
        jmm, report = train(nominal, seed, recipe)
        seconds = _processor_time() - begin
        groups = {name: _ours(of, recipe) for name, of in report.groups.items()}
    else:
        jmm, of_paper = train_as_paper(nominal, seed, Share(sizes.samples, sizes.least_steps))
        seconds = _processor_time() - begin
        groups = {name: _papers(of) for name, of in of_paper.items()}
    for name, error in evaluate(jmm, nominal, seed).items():
        groups[name]["rmse"] = error
    flexion = Flexion(nominal)
    lengths = flexion.lengths(jmm.lengths)
    return {
        "groups": groups,
        "seconds": round(seconds, 1),
        "flexion": np.round(lengths, 4).tolist(),
        "flexion_error": float(np.abs(lengths - flexion.lengths(nominal.lengths)).max()),
    }


def _processor_time() -> float:
    """Processor time of this process, and of those that it has started and that have ended [s]."""
    return sum(os.times()[:4])


def _ours(report: GroupReport, recipe: Recipe) -> dict[str, Any]:
    """Errors over each part of the training [mm], and the epoch at the end of the part."""
    loss = np.array(report.history) / METRES
    epochs = 250 * np.arange(1, len(loss) + 1) * recipe.batch / recipe.samples
    return {
        "loss": np.round(loss, 4).tolist(),
        "epochs": np.round(epochs, 4).tolist(),
        "samples": recipe.samples,
        "epoch_steps": recipe.samples / recipe.batch,
    }


def _papers(report: PaperReport) -> dict[str, Any]:
    """Errors before the first epoch and after each [mm], and numbers of postures and steps."""
    loss = np.array(report.history) / METRES
    return {
        "loss": np.round(loss, 4).tolist(),
        "epochs": list(range(len(loss))),
        "after_20": round(report.validation_rmse / METRES, 4),
        "grid": report.grid,
        "samples": report.samples,
        "epoch_steps": report.epoch_steps,
        "steps": report.epoch_steps * (len(loss) - 1),
        "full_steps": report.full_steps,
        "full_minutes": round(report.full_seconds / 60.0, 2),
    }


def evaluate(jmm: JointMuscleMap, nominal: NominalModel, seed: int) -> dict[str, float]:
    """RMSE by group on new postures, uniform in the joint ranges [mm]."""
    rng = np.random.default_rng([seed, 4])
    postures = rng.uniform(nominal.lower, nominal.upper, (EVALUATED, len(nominal.joints)))
    square = np.square((jmm.lengths(postures) - nominal.lengths(postures)) / METRES)
    return {
        group.name: float(np.sqrt(np.mean(square[:, group.muscle_index]))) for group in jmm.groups
    }


def over_seeds(results: Results, condition: str, group: str, key: str) -> dict[int, float]:
    """A number of a group's training, by seed."""
    return {seed: result[condition]["groups"][group][key] for seed, result in results.items()}


def conclude(results: Results, sizes: Sizes) -> Findings:
    """Errors and times of both recipes, by group."""
    from experiments.initial_training.figures import pictures

    ours = {group: over_seeds(results, OURS, group, "rmse") for group in GROUP_JOINTS}
    largest = {seed: max(by[seed] for by in ours.values()) for seed in results}
    flexed = {seed: result[OURS]["flexion_error"] for seed, result in results.items()}
    minutes = over_seeds(results, PAPER, "shoulder", "full_minutes")
    metrics = {
        "ours_largest_group": metric(largest, "mm", MUST, f"< {PAPERS:g}"),
        **{f"ours_{group}": metric(found, "mm", MUST) for group, found in ours.items()},
        "ours_flexion": metric(flexed, "mm"),
        **{
            f"paper_recipe_{group}": metric(
                over_seeds(results, PAPER, group, "after_20"),
                "mm",
                paper=f"< {PAPERS:g}" if group == "shoulder" else None,
            )
            for group in GROUP_JOINTS
        },
        "ours_time": metric(_seconds(results, OURS), "s"),
        "paper_recipe_time": metric(_seconds(results, PAPER), "s"),
        "paper_recipe_whole_grid_shoulder": metric(minutes, "min"),
    }
    per_seed = {
        seed: {
            "ours_mm": {g: round(of["rmse"], 4) for g, of in result[OURS]["groups"].items()},
            "paper_mm": {g: round(of["rmse"], 4) for g, of in result[PAPER]["groups"].items()},
            "ours_s": result[OURS]["seconds"],
            "paper_s": result[PAPER]["seconds"],
        }
        for seed, result in results.items()
    }
    tables = [error_table(results), count_table(results)]
    return Findings(
        metrics, per_seed, tables, pictures(results), {"statements": statements(results)}
    )


def _seconds(results: Results, condition: str) -> dict[int, float]:
    return {seed: result[condition]["seconds"] for seed, result in results.items()}


def error_table(results: Results) -> Table:
    """Table of the RMSE of each group by both recipes."""
    rows = []
    for group in GROUP_JOINTS:
        after = over_seeds(results, PAPER, group, "after_20")
        ours = over_seeds(results, OURS, group, "rmse")
        papers = over_seeds(results, PAPER, group, "rmse")
        gap = paired(list(ours.values()), list(papers.values()))
        columns = [interval(list(found.values())) for found in (after, papers, ours)]
        rows.append((group, *columns, gap))
    return Table(
        "RMSE [mm] of muscle lengths: median over seeds of the training with its 95 % interval",
        (
            "",
            f"paper's recipe after {EPOCHS} epochs, held-out grid postures",
            "paper's recipe after all steps, random postures",
            "ours, random postures",
            "ours - paper's, paired",
        ),
        rows,
        " ".join(statements(results)),
    )


def count_table(results: Results) -> Table:
    """Table of the postures and steps of both recipes in each group."""
    _, result = next(iter(results.items()))
    rows = []
    for group in GROUP_JOINTS:
        papers, ours = result[PAPER]["groups"][group], result[OURS]["groups"][group]
        minutes = over_seeds(results, PAPER, group, "full_minutes")
        cells = (papers["grid"], papers["samples"], papers["steps"], papers["full_steps"])
        rows.append(
            (
                group,
                *(f"{count:,}" for count in cells),
                f"{np.median(list(minutes.values())):.1f}",
                f"{ours['samples']:,}",
            )
        )
    return Table(
        "Amount of training",
        (
            "",
            "paper's grid",
            "used postures",
            "steps of five",
            f"steps of {EPOCHS} epochs over the whole grid",
            "time of these [min]",
            "our random postures",
        ),
        rows,
        "The time of the whole grid is extrapolated from the time of a step. Grids that are used "
        f"as a whole are so small that training continues beyond {EPOCHS} epochs, up to the steps "
        "shown. All times are processor time of one core.",
    )


def statements(results: Results) -> list[str]:
    """Conclusions from the numbers, in sentences."""
    after = {g: _median(results, PAPER, g, "after_20") for g in GROUP_JOINTS}
    end = {g: _median(results, PAPER, g, "rmse") for g in GROUP_JOINTS}
    ours = {g: _median(results, OURS, g, "rmse") for g in GROUP_JOINTS}
    _, result = next(iter(results.items()))
    shoulder = result[PAPER]["groups"]["shoulder"]
    share = shoulder["samples"] / shoulder["grid"]
    samples = result[OURS]["groups"]["shoulder"]["samples"]
    best = "sufficient" if max(ours.values()) < PAPERS else "not sufficient"
    return [
        f"After {EPOCHS} epochs the paper's recipe on {share:.1%} of the shoulder's grid is "
        f"{_side(after['shoulder'])} the paper's {PAPERS:g} mm for the shoulder.",
        _missed(f"After {EPOCHS} epochs", after),
        _missed("After all steps, on random postures,", end),
        f"The paper states that 100,000 random postures are sufficient; with our recipe "
        f"{samples:,} are {best} for {PAPERS:g} mm in every group.",
    ]


def _median(results: Results, condition: str, group: str, key: str) -> float:
    return float(np.median(list(over_seeds(results, condition, group, key).values())))


def _side(error: float) -> str:
    return "below" if error < PAPERS else "above"


def _missed(when: str, errors: Mapping[str, float]) -> str:
    """Sentence on the groups that exceed the error of the paper."""
    missed = [f"{group} ({error:.2g} mm)" for group, error in errors.items() if error >= PAPERS]
    where = f"in: {', '.join(missed)}" if missed else "in no group"
    return f"{when} the paper's recipe exceeds {PAPERS:g} mm {where}."


EXPERIMENT = Experiment(
    name="initial-training",
    title="Initial training",
    introduction=(
        "The map of every group is trained on the nominal model, by our training and by the recipe "
        "of the paper on a random share of its data. No robot moves: a seed is that of the "
        "training, and each robot below is one training."
    ),
    figure="Fig. 6",
    conditions=(OURS, PAPER),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
)


def main(args: Args) -> Summary:
    """Run the experiment; returns its summary."""
    experiment = EXPERIMENT
    if args.samples is not None:
        experiment = replace(EXPERIMENT, sizes=replace(Sizes(), samples=args.samples))
    return run_experiment(experiment, args)

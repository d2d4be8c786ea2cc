"""Heat: three hours of moving and holding with motors that may not become hotter than 80 degC.

Each motor of a robot heats and cools in its own manner. The agent knows the data sheet, and learns
the motors from the temperatures of their housings. The tensions of a short log of the robot in
closed loop are repeated for hours; postures with warm motors, and one run of three hours, are
simulated in full.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from experiments.harness import common
from experiments.harness.common import Summary
from experiments.harness.experiment import Experiment, Findings, Results, run_experiment
from experiments.heat.plan import faulty, healthy
from experiments.heat.robot import QUICK, Sizes, TensionLog, WarmRobot, compared, whole_loop
from experiments.heat.tables import FAULTS, HEALTHY, POSTURES, WHOLE, metrics, tables

ONE_OF = 10
"""The run of hours in full is done on robots whose seed is a multiple of this."""


@lru_cache(maxsize=1)
def log_of(seed: int, sizes: Sizes, cache: Path | None) -> TensionLog:
    """Log of the tensions of a robot with cold motors and without limit."""
    robot = WarmRobot(seed, sizes, cache, limited=False)
    log = robot.log()
    robot.session.env.close()
    return log


def run(condition: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """Run a plan on healthy motors, one with faults, postures with warm motors, or all in full."""
    if condition == WHOLE:
        return whole_loop(seed, sizes, cache) if seed % ONE_OF == 0 else {}
    log = log_of(seed, sizes, cache)
    if condition == HEALTHY:
        return healthy(log, seed, sizes)
    if condition == FAULTS:
        return {"changes": faulty(log, seed, sizes)}
    return {
        name: compared(seed, sizes, cache, log, limited)
        for name, limited in (("limited", True), ("free", False))
    }


def conclude(results: Results, sizes: Sizes) -> Findings:
    """Temperatures, errors, faults and the price of the limit."""
    from experiments.heat.figures import pictures

    per_seed = {
        seed: {key: value for key, value in result[HEALTHY].items() if key != "curves"}
        for seed, result in results.items()
    }
    return Findings(metrics(results), per_seed, tables(results), pictures(results), {})


EXPERIMENT = Experiment(
    name="heat",
    title="Heat of the motors",
    introduction=(
        "Each motor heats by its tension and cools in its own manner, 20 % about its data sheet. "
        "The agent learns it from the temperature of the housing, and limits tensions so that no "
        "core becomes hotter than 80 degC. Plans of three hours repeat the tensions of a log of "
        "the robot and integrate the heat; postures with warm motors are simulated in full."
    ),
    figure="beyond the paper: arXiv 2407.08055 of the same authors",
    conditions=(HEALTHY, FAULTS, POSTURES, WHOLE),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
)


@dataclass(frozen=True)
class Args(common.Args):
    """Motors that heat: core temperatures, their limit, and faults of the cooling."""

    seeds: str = "0-9"
    out: Path = Path("out/heat")


def main(args: Args) -> Summary:
    """Run the experiment; returns its summary."""
    return run_experiment(EXPERIMENT, args)

"""Muscle Jacobian (paper, sec. II-B, IV-A): roughness of the analytic and the quadratic one.

Both are compared with the true moment arms, along sweeps of every joint through its whole range
from random postures, before and after online learning, on maps of our training and the paper's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.harness import common
from experiments.harness.common import Summary
from experiments.harness.experiment import Experiment, Findings, Results, run_experiment
from experiments.initial_training.flexion import Flexion
from experiments.initial_training.paper_recipe import Share, train_as_paper
from experiments.muscle_jacobian.moment_arms import (
    ANALYTIC,
    DIFFERENCE,
    KINDS,
    TRUE,
    Arms,
    Sweep,
    by_map,
    curves,
    inner,
    slope,
    sweeps,
)
from experiments.muscle_jacobian.robot import estimator_errors, learn, record
from experiments.muscle_jacobian.roughness import measures, numbers
from experiments.muscle_jacobian.tables import (
    OURS,
    PAPER,
    PARTS,
    RULE,
    STAGES,
    claim_table,
    estimator_table,
    group_table,
    metrics,
    stage_table,
    statements,
)
from experiments.robots.robot_arms import RobotArms
from jmm_agent.mapping.group_map import METRES
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.nominal_model import NominalModel
from kengoro.robots import shuffled_postures
from kengoro.trained_maps import ARM, nominal_model, trained_map
from kengoro_env.assets import asset_path
from kengoro_env.robot.nominal_model import NominalArm


@dataclass(frozen=True)
class Sizes:
    """Amount of work on each robot.

    Attributes:
        sweeps: number of sweeps of each joint.
        postures: number of postures that the robot learns from.
        tests: number of movements on which the joint estimators are compared.
        move: duration of a movement [s].
        patience: longest wait for rest [s].
        samples, least_steps: of the paper's training, see `Share`.
    """

    sweeps: int = 8
    postures: int = 27
    tests: int = 2
    move: float = 1.5
    patience: float = 2.0
    samples: int = 17_640
    least_steps: int = 24_000


QUICK = Sizes(3, 2, 1, 1.0, 1.0, 1_000, 1_000)


def run(condition: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """Evaluate a map on the nominal model, or let a robot learn and evaluate the map on it."""
    nominal = nominal_model()
    true = NominalArm(asset_path(ARM)).moment_arms
    swept = sweeps(nominal, sizes.sweeps, np.random.default_rng([seed, 6]))
    if condition == PAPER:
        papers, _ = train_as_paper(nominal, seed, Share(sizes.samples, sizes.least_steps))
        return {"nominal": evaluate(papers, true, nominal, swept)}
    ours = trained_map(cache)
    postures = shuffled_postures(seed)
    learned_from = postures[: 1 + sizes.postures]
    session = learn(ours, seed, learned_from, condition == RULE, sizes.move, sizes.patience)
    actual, learned = RobotArms(session.world.robot).jacobian, session.agent.map
    readings = record(session, postures[-sizes.tests :], sizes.move)
    session.env.close()
    result = {
        "after": evaluate(learned, actual, nominal, swept),
        "estimator": estimator_errors(readings, learned, session.agent.kinematics.limits),
    }
    if condition == OURS:
        result["nominal"] = evaluate(ours, true, nominal, swept)
        result["before"] = evaluate(ours, actual, nominal, swept)
    return result


def evaluate(
    jmm: JointMuscleMap, true: Arms, nominal: NominalModel, swept: Sequence[Sweep]
) -> dict[str, Any]:
    """Errors and roughness of a map, and its moment arms during shoulder flexion."""
    found = list(curves(jmm, true, swept))
    return {
        "whole": measures(found),
        "inner": measures(inner(found)),
        "flexion": flexion_arms(jmm, true, Flexion(nominal)),
        "difference": difference_gap(jmm, Flexion(nominal)),
    }


def flexion_arms(jmm: JointMuscleMap, true: Arms, flexion: Flexion) -> dict[str, Any]:
    """Moment arms of the shoulder's muscles during flexion, shape (K, k) [mm/rad]."""
    arms = {
        kind: by_map(jmm, flexion.postures, flexion.joint, kind)[:, flexion.muscles]
        for kind in KINDS
    }
    at = [true(posture)[flexion.muscles, flexion.joint] for posture in flexion.postures]
    arms[TRUE] = np.array(at)
    return {kind: np.round(found / METRES, 3).tolist() for kind, found in arms.items()}


def difference_gap(jmm: JointMuscleMap, flexion: Flexion) -> float:
    """Largest deviation of a difference over 0.1 deg from the analytic derivative [mm/rad]."""
    analytic = by_map(jmm, flexion.postures, flexion.joint, ANALYTIC)
    difference = slope(jmm, flexion.postures, flexion.joint, DIFFERENCE)
    return float(np.abs(difference - analytic).max() / METRES)


def conclude(results: Results, sizes: Sizes) -> Findings:
    """Errors and roughness of both Jacobians on all maps, and the verdict on the claim."""
    from experiments.muscle_jacobian.figures import pictures

    per_seed = {
        seed: {
            stage.key: {
                kind: {
                    name: round(value, 3)
                    for name, value in numbers(
                        result[stage.condition][stage.evaluated]["whole"], kind
                    ).items()
                }
                for kind in KINDS
            }
            for stage in STAGES
        }
        for seed, result in results.items()
    }
    tables = [
        *(claim_table(results, part) for part in PARTS),
        *(stage_table(results, part) for part in PARTS),
        group_table(results),
        estimator_table(results),
    ]
    return Findings(
        metrics(results), per_seed, tables, pictures(results), {"statements": statements(results)}
    )


EXPERIMENT = Experiment(
    name="muscle-jacobian",
    title="Muscle Jacobian",
    introduction=(
        "The analytic Jacobian of the network and the paper's, from a parabola through five points "
        "at distances of 10 deg, are compared with the true moment arms, along sweeps of every "
        "joint through its range from random postures. The paper's map is trained by its recipe on "
        "a share of its data. Then actual robots learn, by our rule and by the paper's."
    ),
    figure="Fig. 7",
    others=("experiments/initial_training",),
    conditions=(OURS, RULE, PAPER),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
)


@dataclass(frozen=True)
class Args(common.Args):
    """Muscle Jacobians of the map, compared with the true moment arms (Fig. 7)."""

    seeds: str = "0-9"
    out: Path = Path("out/muscle-jacobian")


def main(args: Args) -> Summary:
    """Run the experiment; returns its summary."""
    return run_experiment(EXPERIMENT, args)

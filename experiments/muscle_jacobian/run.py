"""Muscle Jacobian (paper, sec. II-B, IV-A): is the analytic one wavy, the quadratic one smooth?

Both are compared with the true moment arms, along sweeps of every joint through its whole range
from random postures, before and after online learning, on maps of our training and the paper's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.harness.experiment import Findings, Results, Study
from experiments.initial_training.flexion import Flexion
from experiments.initial_training.paper_recipe import Share, train_as_paper
from experiments.muscle_jacobian.moment_arms import (
    ANALYTIC,
    DIFFERENCE,
    KINDS,
    TRUE,
    Arms,
    RobotArms,
    Sweep,
    by_map,
    curves,
    inner,
    slope,
    sweeps,
)
from experiments.muscle_jacobian.robot import estimator_errors, feel, learn
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
    told,
)
from jmm_agent.mapping.joint_muscle_map import METRES, JointMuscleMap
from jmm_agent.nominal_model import NominalModel
from kengoro.arm import shuffled_postures
from kengoro.trained_maps import ARM, nominal_model, trained_map
from kengoro_env.assets import asset_path
from kengoro_env.robot.nominal_model import NominalArm


@dataclass(frozen=True)
class Sizes:
    """How much is done.

    Attributes:
        sweeps: of each joint.
        postures: that the robot learns from.
        tests: movements on which the joint estimators are compared.
        move, patience: time for each movement and longest wait for rest [s].
        samples, least_steps: of the paper's training, as in `Share`.
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
    """Examine a map against the drawing; or let a robot learn with ours and examine it then."""
    drawing = nominal_model()
    drawn = NominalArm(asset_path(ARM)).moment_arms
    swept = sweeps(drawing, sizes.sweeps, np.random.default_rng([seed, 6]))
    if condition == PAPER:
        papers, _ = train_as_paper(drawing, seed, Share(sizes.samples, sizes.least_steps))
        return {"nominal": examine(papers, drawn, drawing, swept)}
    ours = trained_map(cache)
    postures = shuffled_postures(seed)
    learned_from = postures[: 1 + sizes.postures]
    session = learn(ours, seed, learned_from, condition == RULE, sizes.move, sizes.patience)
    actual, learned = RobotArms(session.world.robot), session.agent.map
    felt = feel(session, postures[-sizes.tests :], sizes.move)
    session.env.close()
    result = {
        "after": examine(learned, actual, drawing, swept),
        "estimator": estimator_errors(felt, learned, session.agent.kinematics.limits),
    }
    if condition == OURS:
        result["nominal"] = examine(ours, drawn, drawing, swept)
        result["before"] = examine(ours, actual, drawing, swept)
    return result


def examine(
    jmm: JointMuscleMap, true: Arms, drawing: NominalModel, swept: Sequence[Sweep]
) -> dict[str, Any]:
    """Errors and waviness of a map, and its moment arms during shoulder flexion."""
    found = list(curves(jmm, true, swept))
    return {
        "whole": measures(found),
        "inner": measures(inner(found)),
        "flexion": flexion_arms(jmm, true, Flexion(drawing)),
        "difference": difference_gap(jmm, Flexion(drawing)),
    }


def flexion_arms(jmm: JointMuscleMap, true: Arms, flexion: Flexion) -> dict[str, Any]:
    """Moment arms (K, k) [mm/rad] of the shoulder's muscles about its pitch during flexion."""
    arms = {
        kind: by_map(jmm, flexion.postures, flexion.joint, kind)[:, flexion.muscles]
        for kind in KINDS
    }
    at = [true(posture)[flexion.muscles, flexion.joint] for posture in flexion.postures]
    arms[TRUE] = np.array(at)
    return {kind: np.round(found / METRES, 3).tolist() for kind, found in arms.items()}


def difference_gap(jmm: JointMuscleMap, flexion: Flexion) -> float:
    """Largest gap [mm/rad] between the analytic derivative and a difference over 0.1 deg."""
    analytic = by_map(jmm, flexion.postures, flexion.joint, ANALYTIC)
    difference = slope(jmm, flexion.postures, flexion.joint, DIFFERENCE)
    return float(np.abs(difference - analytic).max() / METRES)


def conclude(results: Results, sizes: Sizes) -> Findings:
    """Errors and waviness of both Jacobians on all maps, and whether the claim holds."""
    from experiments.muscle_jacobian.figures import pictures

    per_seed = {
        seed: {
            stage.key: {
                kind: {
                    name: round(value, 3)
                    for name, value in numbers(
                        result[stage.condition][stage.examined]["whole"], kind
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
    return Findings(metrics(results), per_seed, tables, pictures(results), {"told": told(results)})


STUDY = Study(
    name="muscle-jacobian",
    title="Muscle Jacobian",
    introduction=(
        "The analytic Jacobian of the network and the paper's, through a parabola at five points "
        "10 deg apart, against the true moment arms, along sweeps of every joint through its range "
        "from random postures. The paper's map comes from its own recipe on a share of its data. "
        "Actual robots then learn, by our rule and by the paper's."
    ),
    figure="Fig. 7",
    others=("experiments/initial_training",),
    conditions=(OURS, RULE, PAPER),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
)

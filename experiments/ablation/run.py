"""Ablation: effect of each part of the method, and a test of the paper's claims (sec. II, III).

Variants of the agent learn from the same postures of the same robots. Then their maps move the
robots to other postures, and are compared with the robots' muscle lengths over the joint ranges.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from experiments.ablation.tables import Numbers, claims_table, judge_claims, metrics, variant_tables
from experiments.harness import common
from experiments.harness.common import Summary
from experiments.harness.experiment import Experiment, Findings, Results, run_experiment
from experiments.robots.conditions import ACTUAL
from experiments.robots.evaluation import Evaluator, map_error_mm
from experiments.robots.variants import NONE, VARIANTS
from experiments.robots.world import known_world
from jmm_agent.agent import Agent
from jmm_agent.types import Floats
from kengoro.agents import make_agent
from kengoro.robots import NO_END, make_env, shuffled_postures
from kengoro.session import Session
from kengoro.visits import errors, visit


@dataclass(frozen=True)
class Sizes:
    """Amount of work on each robot.

    Attributes:
        learned: number of postures that the agent learns from.
        tested: number of other postures that the map is tested on.
        compared: number of further postures at which the map is compared with the robot's lengths.
        move: duration of a movement while learning [s].
        patience: longest wait for rest and an observation while learning [s].
        test_move: duration of a movement in the test [s].
        test_hold: time to come to rest in the test [s].
    """

    learned: int = 27
    tested: int = 12
    compared: int = 100
    move: float = 1.0
    patience: float = 2.0
    test_move: float = 1.2
    test_hold: float = 1.0


QUICK = Sizes(learned=1, tested=1, compared=5, move=0.3, patience=0.8, test_move=0.3, test_hold=0.2)


def run(condition: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """Let one variant learn on one robot and evaluate its map."""
    world, postures = known_world(cache), shuffled_postures(seed)
    learned, rest = np.split(postures, [1 + sizes.learned])
    rest, tested = np.split(rest, [-1 - sizes.tested])
    variant = VARIANTS.get(condition)
    options, rule = (variant.options, variant.rule) if variant else (None, None)
    agent = make_agent(seed, jmm=world.map, options=options, rule=rule)
    if condition != NONE:
        learn(agent, seed, learned, sizes)
    evaluator = Evaluator(world, ACTUAL, seed, sizes.test_move, sizes.test_hold)
    inside = rest[: sizes.compared]
    low, high = world.limits.T
    box = np.random.default_rng([seed, 6]).uniform(low, high, (sizes.compared, len(low)))
    return {
        "visits": evaluator.evaluate(agent.map, tested, agent.vision),
        "set_mm": map_error_mm(agent.map, inside, evaluator.own_lengths(inside)),
        "box_mm": map_error_mm(agent.map, box, evaluator.own_lengths(box)),
        "antagonism_updates": agent.antagonism.fired,
        "vision_updates": agent.vision.fired,
        "dropped": agent.vision.dropped,
    }


def learn(agent: Agent, seed: int, postures: Floats, sizes: Sizes) -> None:
    """Start at the first posture of (K, n) [rad], visit all others and learn there."""
    start = postures[0]
    session = Session(_env(seed), agent, seed, None, {"posture": start, "target": start})
    for posture in postures[1:]:  # without vision there is no need to search for the hand
        visit(session, posture, None, sizes.move, sizes.patience, search=agent.options.learn_vision)


@lru_cache(maxsize=1)
def _env(seed: int) -> gym.Env[Any, Any]:
    """The robot on which all variants learn, one after the other."""
    return make_env("Posture", seed, max_episode_steps=NO_END)


def numbers(results: Results) -> Numbers:
    """Outcomes of each variant, with one number a robot in the order of the seeds."""
    found: Numbers = {}
    for name in CONDITIONS:
        outcomes = [
            errors(result[name]["visits"])
            | {key: round(result[name][key], 3) for key in ("set_mm", "box_mm")}
            for result in results.values()
        ]
        found[name] = {key: [o[key] for o in outcomes] for key in outcomes[0]}
    return found


def conclude(results: Results, sizes: Sizes) -> Findings:
    """Outcomes of all variants and verdicts on the claims."""
    from experiments.ablation.figures import pictures

    found = numbers(results)
    kept = ("target_true_deg", "estimate_seen_deg", "target_true_mm", "max_tension_N", "box_mm")
    per_seed = {
        seed: {name: {key: outcomes[key][rank] for key in kept} for name, outcomes in found.items()}
        for rank, seed in enumerate(results)
    }
    tables = [claims_table(found), *variant_tables(found)]
    more = {"claims": judge_claims(found)}
    return Findings(metrics(found), per_seed, tables, pictures(found), more)


CONDITIONS = (*VARIANTS, NONE)

EXPERIMENT = Experiment(
    name="ablation",
    title="Ablation",
    introduction=(
        "Variants of the agent learn from the same postures of the same actual robots, with the "
        "camera. Then learning stops, and their maps move the robot from the same start to the "
        "same new postures. This test uses no camera: each variant computes joint angles from the "
        "exact pose of the marker and from the observations in its memory. Each claim is judged "
        "by the difference between two variants on the same robot."
    ),
    figure="claims of sec. II-C, III-B, III-C and IV-D",
    conditions=CONDITIONS,
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
)


@dataclass(frozen=True)
class Args(common.Args):
    """Effect of each part of the method, and a test of the paper's claims."""

    seeds: str = "0-9"
    out: Path = Path("out/ablation")


def main(args: Args) -> Summary:
    """Run the experiment; returns its summary."""
    return run_experiment(EXPERIMENT, args)

"""Learnability: errors that the map reaches from different data, and their lower bound.

Three stages on each robot `actual(seed)`, always with both updaters:

1. true joint angles with 0.5 deg of noise in place of vision: pairs that hold l_target, l or
   min(l, l_target), learned by the ridge rule or by the paper's minibatch rule;
2. exact pose of the marker: inverse kinematics of each observation alone, as in the paper, and the
   joint fit of all observations and lengths; an observation has 6 numbers, the arm 14 joints;
3. lower bound: the best command for each test posture on the same robot.

They are compared with a robot that does not learn and with one without departures. Tests are on
postures of the set that are never learned from.
"""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from experiments.harness.common import (
    Args as CommonArgs,
)
from experiments.harness.common import (
    Summary,
    check_jobs,
    make_summary,
    median_and_worst,
    parse_seeds,
    source_digest,
)
from experiments.harness.reported import log_reported
from experiments.harness.runner import run_tasks
from experiments.learnability.observers import Variant
from experiments.learnability.trial import evaluate, learn, lower_bound
from experiments.robots.world import Body, Rest, Sizes, World, known_world
from jmm_agent.types import Floats, Ints
from kengoro.trained_maps import trained_map
from kengoro_env.departures import actual, drawing
from mjcf_sandbox.files import write_json

NAME = "learnability"
OFF, NOMINAL, FLOOR = "off", "nominal", "floor"
STAGE_1 = {
    "1-ridge-min": Variant("true angles", "min", "ridge"),
    "1-ridge-l_target": Variant("true angles", "l_target", "ridge"),
    "1-ridge-l": Variant("true angles", "l", "ridge"),
    "1-minibatch-min": Variant("true angles", "min", "minibatch"),
    "1-minibatch-l_target": Variant("true angles", "l_target", "minibatch"),
    "1-minibatch-output-min": Variant("true angles", "min", "minibatch, output layer"),
}
STAGE_2 = {
    "2-together": Variant("observations together", "min", "ridge"),
    "2-one-observation": Variant("one observation", "min", "ridge"),
    "2-paper": Variant("one observation", "l_target", "minibatch"),
}
VARIANTS = {OFF: Variant(learns=False), **STAGE_1, **STAGE_2}
TRIALS = (*VARIANTS, FLOOR, NOMINAL)


@dataclass(frozen=True)
class Args(CommonArgs):
    """Errors that the map reaches from different data, and their lower bound.

    Attributes:
        seeds: robots, as A-B or A; seeds below 100 are for tuning.
        out: folder of the results; finished trials are not run again.
        sizes: amount of work on each robot.
    """

    seeds: str = "0-9"
    out: Path = Path("out/learnability")
    sizes: Sizes = field(default_factory=Sizes)


def run_trial(trial: str, seed: int, sizes: Sizes, maps: Path | None) -> dict[str, Any]:
    """Run a trial on one robot; returns angles at the postures of learning and test [rad]."""
    world = known_world(maps)
    body = Body(world, drawing() if trial == NOMINAL else actual(seed), sizes)
    learned_from, tested_on = world.split(seed, sizes)
    if trial == FLOOR:
        found = lower_bound(body, tested_on, seed)
        return {"tested": _listed(target=[t for t, _ in found], true=[q for _, q in found])}
    result: dict[str, Any] = {}
    jmm = world.map
    if trial != NOMINAL:
        lesson = learn(body, learned_from, VARIANTS[trial], seed)
        jmm, result["learned"] = lesson.map, _rests(lesson.rests)
        result["learned"] |= _listed(seen=lesson.seen) | {"pairs": lesson.pairs}
    return result | {"tested": _rests(evaluate(body, tested_on, jmm, seed))}


def _rests(rests: list[Rest]) -> dict[str, Any]:
    angles = {key: [getattr(rest, key) for rest in rests] for key in ("target", "true", "estimate")}
    return _listed(**angles) | {"max_tension_N": [round(float(r.tensions.max()), 1) for r in rests]}


def _listed(**arrays: list[Floats]) -> dict[str, Any]:
    return {key: np.round(np.array(array), 6).tolist() for key, array in arrays.items()}


def error_deg(rests: dict[str, Any], one: str, other: str, joints: Ints | None = None) -> Floats:
    """RMS over (some) joints of the difference of two angles by posture, shape (K,) [deg]."""
    gap = np.degrees(np.subtract(rests[one], rests[other]))
    return np.sqrt(np.mean(np.square(gap if joints is None else gap[:, joints]), axis=1))


def joints_deg(rests: dict[str, Any], one: str, other: str, first: int = 0) -> Floats:
    """RMS over postures from ``first`` on of the difference by joint, shape (n,) [deg]."""
    gap = np.degrees(np.subtract(rests[one][first:], rests[other][first:]))
    return np.sqrt(np.mean(np.square(gap), axis=0))


PAIRS = (("target", "true"), ("estimate", "true"), ("estimate", "target"))


def tested_errors(world: World, rests: dict[str, Any]) -> dict[str, Any]:
    """Medians over the test postures of the errors of joints, groups [deg] and hand [mm]."""
    groups = {"all": np.arange(len(world.limits))}
    groups |= world.owned()
    result: dict[str, Any] = {}
    for one, other in PAIRS:
        if one not in rests:
            continue
        name = f"{one}_{other}"
        by_group = {
            group: round(float(np.median(error_deg(rests, one, other, joints))), 3)
            for group, joints in groups.items()
        }
        by_group["worst"] = round(float(error_deg(rests, one, other).max()), 3)
        hands = [
            1e3 * float(np.linalg.norm(world.hand(np.array(a)) - world.hand(np.array(b))))
            for a, b in zip(rests[one], rests[other], strict=True)
        ]
        result[f"{name}_deg"] = by_group
        result[f"{name}_hand_mm"] = round(float(np.median(hands)), 2)
        result[f"{name}_joints_deg"] = np.round(joints_deg(rests, one, other), 3).tolist()
    if "max_tension_N" in rests:
        result["max_tension_N"] = max(rests["max_tension_N"])
    return result


def trial_summary(world: World, result: dict[str, Any]) -> dict[str, Any]:
    """Summary of a trial: errors on the test postures and during learning."""
    summary = tested_errors(world, result["tested"])
    learned = result.get("learned")
    if learned:
        online = {"target_true_deg": error_deg(learned, "target", "true")}
        if learned["seen"]:
            half = len(learned["seen"]) // 2
            online["seen_true_deg"] = error_deg(learned, "seen", "true")
            online["seen_estimate_deg"] = error_deg(learned, "seen", "estimate")
            summary["seen_true_joints_deg"] = np.round(
                joints_deg(learned, "seen", "true", half), 3
            ).tolist()
            summary["seen_true_deg"] = round(float(np.median(online["seen_true_deg"][half:])), 3)
        summary["pairs"] = learned["pairs"]
        summary["online"] = {key: np.round(value, 3).tolist() for key, value in online.items()}
    return summary


def over_seeds(per_seed: dict[int, Any]) -> dict[str, Any]:
    """Median and worst robot of each trial's medians over postures."""
    table: dict[str, Any] = {}
    for trial in TRIALS:
        rows = [result[trial] for result in per_seed.values()]
        table[trial] = {}
        for one, other in PAIRS:
            key = f"{one}_{other}"
            if f"{key}_deg" in rows[0]:
                table[trial][f"{key}_deg"] = {
                    group: median_and_worst(row[f"{key}_deg"][group] for row in rows)
                    for group in rows[0][f"{key}_deg"]
                }
                table[trial][f"{key}_hand_mm"] = median_and_worst(
                    row[f"{key}_hand_mm"] for row in rows
                )
        for key in ("seen_true_deg", "max_tension_N", "pairs"):
            if key in rows[0]:
                table[trial][key] = median_and_worst(row[key] for row in rows)
    return table


def main(args: Args) -> Summary:
    """Run the missing trials and write summary.json and report.html."""
    begin = time.perf_counter()
    seeds = parse_seeds(args.seeds)
    check_jobs(args.jobs)
    log_reported("learnability", seeds)
    trained_map(args.cache)  # once, before several processes would train it
    tasks = {
        f"{seed:03d}-{trial}": (trial, seed, args.sizes, args.cache)
        for seed in seeds
        for trial in TRIALS
    }
    key = f"{source_digest('experiments/learnability')} {asdict(args.sizes)}"
    results = run_tasks(run_trial, tasks, args.jobs, args.out / "trials", key, args.cluster)
    return conclude(args, seeds, results, begin)


def conclude(args: Args, seeds: list[int], results: dict[str, Any], begin: float) -> Summary:
    """Write summary and report of the trials, which began at ``begin`` (`time.perf_counter`)."""
    from experiments.learnability.observability import observability
    from experiments.learnability.report import report  # matplotlib takes a second to load

    world = known_world(args.cache)
    per_seed = {
        seed: {trial: trial_summary(world, results[f"{seed:03d}-{trial}"]) for trial in TRIALS}
        for seed in seeds
    }
    summary = make_summary(
        NAME,
        per_seed,
        time.perf_counter() - begin,
        sizes=asdict(args.sizes),
        joints=list(world.arm.joints),
        over_seeds=over_seeds(per_seed),
        observability=observability(world),
    )
    write_json(args.out / "summary.json", summary)
    report(summary, args.out)
    return summary

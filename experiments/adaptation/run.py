"""Adaptation: muscles elongate permanently, and online learning compensates for it.

The paper argues that only maps which are learned online can follow the elongation of muscles
(sec. I), without an experiment. Here a robot learns, then three muscles elongate, then the robot
continues to learn. For comparison the same robot visits the same postures without learning.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.adaptation.critical_muscles import critical_muscles, effect_deg
from experiments.adaptation.sizes import BEFORE, EVENT, OFF, Sizes
from experiments.harness import common
from experiments.harness.common import Summary
from experiments.harness.experiment import Experiment, Findings, Results, run_experiment
from experiments.harness.report import Table
from experiments.harness.statistics import metric
from experiments.robots.conditions import ACTUAL, NOMINAL, make_session
from jmm_agent.types import Floats
from kengoro.agents import make_agent
from kengoro.robots import shuffled_postures
from kengoro.session import Session
from kengoro.visits import Visits, error_rows, errors, no_visits, visit

ELONGATED, ELONGATION = 3, 0.010
"""Number of muscles that elongate, and the elongation of each [m]."""

HIGH_RATIO, GOOD_RATIO = 1.5, 1.25
"""Thresholds of the error relative to that before the elongation: after it, and after learning."""


QUICK = Sizes(learned=4, more=2, every=2, tested=1, move=0.8, patience=1.2)


def run(condition: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """Learn on one robot, elongate muscles, and continue first without and then with learning."""
    postures = shuffled_postures(seed)
    start, learned, more, tested = np.split(
        postures[: 1 + sizes.learned + sizes.more + sizes.tested],
        np.cumsum([1, sizes.learned, sizes.more]),
    )
    agent = make_agent(seed, cache=cache)
    session = make_session(condition, seed, agent, start[0])
    visits = {"learned": visit_all(session, learned, sizes, learning=True)}

    def test() -> Visits:
        return visit_all(session, tested, sizes, learning=False)

    tests = {BEFORE: test()}
    for muscle in critical_muscles(ELONGATED, ELONGATION):
        session.world.robot.elongate(muscle, ELONGATION)
    tests[EVENT] = test()
    visits["off"] = visit_all(session, more, sizes, learning=False)
    tests[OFF] = test()
    visits["on"] = no_visits()
    for last in sizes.checks:
        part = more[last - sizes.every : last]
        visit_all(session, part, sizes, learning=True, visits=visits["on"])
        tests[str(last)] = test()
    session.env.close()
    identified = np.array(agent.map.muscles)[agent.vision.elongated.any(axis=0)].tolist()
    return {
        "visits": visits,
        "tests": tests,
        "identified": identified,
        "dropped": agent.vision.dropped,
    }


def visit_all(
    session: Session,
    postures: Floats,
    sizes: Sizes,
    learning: bool,
    visits: Visits | None = None,
) -> Visits:
    """Visit postures with or without learning.

    Args:
        session: of the robot.
        postures: joint angles, shape (K, n) [rad].
        sizes: durations.
        learning: whether the agent learns.
        visits: earlier visits that the new ones are appended to.
    """
    session.agent.learning = learning
    visits = no_visits() if visits is None else visits
    for posture in postures:
        visit(session, posture, visits, sizes.move, sizes.patience)
    return visits


def conclude(results: Results, sizes: Sizes) -> Findings:
    """Errors before and after the elongation, and after more postures with and without learning."""
    from experiments.adaptation.figures import pictures

    per_seed = {
        seed: {
            condition: {
                **{name: errors(test) for name, test in found["tests"].items()},
                "identified": found["identified"],
                "dropped": found["dropped"],
            }
            for condition, found in result.items()
        }
        for seed, result in results.items()
    }
    muscles = critical_muscles(ELONGATED, ELONGATION)
    identified = [set(entry[ACTUAL]["identified"]) for entry in per_seed.values()]
    true = [len(found & set(muscles)) for found in identified]
    metrics = {
        **ratio_metrics([entry[ACTUAL] for entry in per_seed.values()], sizes),
        **{
            f"nominal_{name}": {**found, "must": None, "reached": None}
            for name, found in ratio_metrics(
                [entry[NOMINAL] for entry in per_seed.values()], sizes
            ).items()
            if name in ("event_ratio", "adapted_ratio")
        },
        "muscles_found": metric(true, "", good="high"),
        "muscles_false_positive": metric([len(found - set(muscles)) for found in identified], ""),
    }
    tables = [*error_tables(per_seed, sizes), muscle_table(muscles, identified)]
    return Findings(metrics, per_seed, tables, pictures(results, sizes), {"muscles": list(muscles)})


def ratio_metrics(tests: Sequence[Mapping[str, Any]], sizes: Sizes) -> dict[str, Any]:
    """Metrics of the errors, and of their ratios to those before the elongation.

    Args:
        tests: errors by test, for each robot.
        sizes: of the run.
    """
    last = str(sizes.checks[-1])

    def ratios(test: str, key: str) -> list[float]:
        whole = [robot for robot in tests if key in robot[test] and key in robot[BEFORE]]
        return [robot[test][key] / robot[BEFORE][key] for robot in whole]

    joints, hand, seen = "target_true_deg", "target_true_mm", "estimate_seen_deg"
    metrics = {
        "event_ratio": metric(ratios(EVENT, joints), "", HIGH_RATIO, good="high"),
        "adapted_ratio": metric(ratios(last, joints), "", GOOD_RATIO),
        "off_ratio": metric(ratios(OFF, joints), "", HIGH_RATIO, good="high"),
        **{f"adapted_ratio_{n}": metric(ratios(str(n), joints), "") for n in sizes.checks[:-1]},
    }
    for name, key in (("hand", hand), ("seen", seen)):
        if raised := ratios(EVENT, key):
            metrics[f"{name}_event_ratio"] = metric(raised, "", good="high")
        if lowered := ratios(last, key):
            metrics[f"{name}_adapted_ratio"] = metric(lowered, "")
    for key, unit in ((joints, "deg"), (hand, "mm")):
        for when, test in ((BEFORE, BEFORE), (EVENT, EVENT), ("adapted", last)):
            metrics[f"target_true_{when}_{unit}"] = metric([r[test][key] for r in tests], unit)
    return metrics


def error_tables(per_seed: Mapping[int, Mapping[str, Any]], sizes: Sizes) -> list[Table]:
    """Tables of all errors by test, one for each condition."""
    names = {
        BEFORE: "before",
        EVENT: "elongated",
        OFF: f"{sizes.more} more, learning off",
        **{str(n): f"{n} more, learning on" for n in sizes.checks},
    }
    tables = []
    for condition, group in ((ACTUAL, "Actual robots"), (NOMINAL, "Robots without departures")):
        robots = [entry[condition] for entry in per_seed.values()]
        columns = {name: [robot[test] for robot in robots] for test, name in names.items()}
        title = f"{group}: median over robots (worst robot)"
        note = f"Each test has the same {sizes.tested} postures, which are never learned from. "
        tables.append(
            Table(title, ("", *columns), error_rows(columns), note + _disagreement(robots, sizes))
        )
    return tables


def _disagreement(robots: Sequence[Mapping[str, Any]], sizes: Sizes) -> str:
    """Sentence on the ratios of the errors by both definitions."""
    metrics = ratio_metrics(robots, sizes)
    if not {"seen_event_ratio", "seen_adapted_ratio"} <= metrics.keys():
        return "The hand was not seen in all tests."
    parts = [
        f"{metrics[true]['median']} (target - true) and {metrics[seen]['median']} "
        f"(estimate - seen) {when}"
        for when, true, seen in (
            ("after the elongation", "event_ratio", "seen_event_ratio"),
            ("after learning", "adapted_ratio", "seen_adapted_ratio"),
        )
    ]
    return f"Ratio of the joint error to that before: {'; '.join(parts)}."


def muscle_table(muscles: Sequence[str], identified: Sequence[set[str]]) -> Table:
    """Table of the elongated muscles: their effect, and on how many robots they were identified."""
    rows = []
    for number, muscle in enumerate(muscles, start=1):
        found = sum(muscle in robot for robot in identified)
        effect = effect_deg(tuple(muscles[:number]), ELONGATION)
        rows.append((muscle, f"{effect:.1f}", f"{found} of {len(identified)}"))
    wrong = sorted({muscle for robot in identified for muscle in robot - set(muscles)})
    return Table(
        f"Muscles that elongate by {1e3 * ELONGATION:g} mm",
        ("muscle", "effect with those above [deg]", "identified on robots"),
        rows,
        "Effect: movement of the nominal arm, RMS over joints and postures. Each muscle is the one "
        "with the largest effect together with those above. Identified: the agent concludes that "
        "the muscle is elongated. Muscles identified on some actual robot without being "
        f"elongated: {', '.join(wrong) or 'none'}.",
    )


EXPERIMENT = Experiment(
    name="adaptation",
    title="Adaptation to elongated muscles",
    introduction=(
        f"A robot learns; then {ELONGATED} muscles elongate permanently by {1e3 * ELONGATION:g} mm "
        "each, and the robot continues to learn. For comparison it also visits the same postures "
        "without learning. The same is done on robots without departures. The paper argues that "
        "only maps which are learned online can follow elongation, without an experiment."
    ),
    figure="claim of sec. I",
    conditions=(ACTUAL, NOMINAL),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
)


@dataclass(frozen=True)
class Args(common.Args):
    """Muscles elongate permanently, and online learning compensates for it."""

    seeds: str = "0-9"
    out: Path = Path("out/adaptation")


def main(args: Args) -> Summary:
    """Run the experiment; returns its summary."""
    return run_experiment(EXPERIMENT, args)

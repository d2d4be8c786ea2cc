"""Adaptation: wires give for good, and the arm finds its postures again.

The paper holds against maps that are not learned online that they cannot follow the elongation of
wires (sec. I), and shows no experiment. Here a robot learns, then three wires give, then it goes on
learning. Beside it the same robot goes on to the same postures without learning.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from experiments.adaptation.critical_muscles import critical_muscles, effect_deg
from experiments.adaptation.sizes import BEFORE, EVENT, OFF, Sizes
from experiments.harness.experiment import Findings, Results, Study
from experiments.harness.report import Table
from experiments.harness.statistics import metric
from jmm_agent.types import Floats
from kengoro.arm import ACTUAL, NOMINAL, make_session, new_agent, shuffled_postures
from kengoro.session import Session
from kengoro.visits import Visits, error_rows, errors, no_visits, visit

GIVING, LENGTH = 3, 0.010
"""How many wires give, and by how much each [m]."""

HIGH_RATIO, GOOD_RATIO = 1.5, 1.25
"""What the event must raise the error to, and learning bring it back to."""


QUICK = Sizes(learned=4, more=2, every=2, tested=1, move=0.8, patience=1.2)


def run(condition: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """One robot learns, wires give, it goes on: first without learning, then with it."""
    postures = shuffled_postures(seed)
    start, learned, more, tested = np.split(
        postures[: 1 + sizes.learned + sizes.more + sizes.tested],
        np.cumsum([1, sizes.learned, sizes.more]),
    )
    agent = new_agent(cache, seed)
    session = make_session(condition, seed, agent, start[0])
    visits = {"learned": visit_all(session, learned, sizes, learning=True)}

    def test() -> Visits:
        return visit_all(session, tested, sizes, learning=False)

    tests = {BEFORE: test()}
    for muscle in critical_muscles(GIVING, LENGTH):
        session.world.robot.elongate(muscle, LENGTH)
    tests[EVENT] = test()
    visits["off"] = visit_all(session, more, sizes, learning=False)
    tests[OFF] = test()
    visits["on"] = no_visits()
    for last in sizes.checks:
        part = more[last - sizes.every : last]
        visit_all(session, part, sizes, learning=True, visits=visits["on"])
        tests[str(last)] = test()
    session.env.close()
    believed = np.array(agent.map.muscles)[agent.vision.gave.any(axis=0)].tolist()
    return {"visits": visits, "tests": tests, "believed": believed, "dropped": agent.vision.dropped}


def visit_all(
    session: Session,
    postures: Floats,
    sizes: Sizes,
    learning: bool,
    visits: Visits | None = None,
) -> Visits:
    """Visit postures (K, n) [rad] with or without learning; adds to ``visits``."""
    session.agent.learning = learning
    visits = no_visits() if visits is None else visits
    for posture in postures:
        visit(session, posture, visits, sizes.move, sizes.patience)
    return visits


def conclude(results: Results, sizes: Sizes) -> Findings:
    """Errors before the wires gave, after, and after further postures with and without learning."""
    from experiments.adaptation.figures import pictures

    per_seed = {
        seed: {
            condition: {
                **{name: errors(test) for name, test in found["tests"].items()},
                "believed": found["believed"],
                "dropped": found["dropped"],
            }
            for condition, found in result.items()
        }
        for seed, result in results.items()
    }
    muscles = critical_muscles(GIVING, LENGTH)
    believed = [set(entry[ACTUAL]["believed"]) for entry in per_seed.values()]
    metrics = {
        **ratio_metrics([entry[ACTUAL] for entry in per_seed.values()], sizes),
        **{
            f"nominal_{name}": {**found, "must": None, "reached": None}
            for name, found in ratio_metrics(
                [entry[NOMINAL] for entry in per_seed.values()], sizes
            ).items()
            if name in ("event_ratio", "adapted_ratio")
        },
        "muscles_found": metric([len(found & set(muscles)) for found in believed], "", good="high"),
        "muscles_wronged": metric([len(found - set(muscles)) for found in believed], ""),
    }
    tables = [*error_tables(per_seed, sizes), muscle_table(muscles, believed)]
    return Findings(metrics, per_seed, tables, pictures(results, sizes), {"muscles": list(muscles)})


def ratio_metrics(tests: Sequence[Mapping[str, Any]], sizes: Sizes) -> dict[str, Any]:
    """Errors and their ratios to those before the event, over robots.

    Args:
        tests: errors of a robot by test.
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
    """All errors by test, a table for each condition."""
    names = {
        BEFORE: "before",
        EVENT: "wires gave",
        OFF: f"{sizes.more} more, learning off",
        **{str(n): f"{n} more, learning on" for n in sizes.checks},
    }
    tables = []
    for condition, told in ((ACTUAL, "Actual robots"), (NOMINAL, "Robots without departures")):
        robots = [entry[condition] for entry in per_seed.values()]
        columns = {told: [robot[test] for robot in robots] for test, told in names.items()}
        title = f"{told}: median over robots (worst robot)"
        note = f"The same {sizes.tested} postures in each test; none is learned from. "
        tables.append(
            Table(title, ("", *columns), error_rows(columns), note + _disagreement(robots, sizes))
        )
    return tables


def _disagreement(robots: Sequence[Mapping[str, Any]], sizes: Sizes) -> str:
    """What the two definitions of error make of the event and of what was learned after it."""
    metrics = ratio_metrics(robots, sizes)
    if not {"seen_event_ratio", "seen_adapted_ratio"} <= metrics.keys():
        return "The hand was not seen in all tests."
    parts = [
        f"{told} from before by {metrics[true]['median']} in target - true and by "
        f"{metrics[seen]['median']} in estimate - seen"
        for told, true, seen in (
            ("after the event the error differs", "event_ratio", "seen_event_ratio"),
            ("after learning", "adapted_ratio", "seen_adapted_ratio"),
        )
    ]
    return f"As factors: {'; '.join(parts)}."


def muscle_table(muscles: Sequence[str], believed: Sequence[set[str]]) -> Table:
    """The wires that gave: why these, and on how many robots they were believed to have given."""
    rows = []
    for number, muscle in enumerate(muscles, start=1):
        found = sum(muscle in robot for robot in believed)
        effect = effect_deg(tuple(muscles[:number]), LENGTH)
        rows.append((muscle, f"{effect:.1f}", f"{found} of {len(believed)}"))
    wrong = sorted({muscle for robot in believed for muscle in robot - set(muscles)})
    return Table(
        f"The wires that give by {1e3 * LENGTH:g} mm",
        ("", "with those above, on the drawing [deg]", "believed to have given"),
        rows,
        "Chosen by the drawing alone: the first moves the drawn arm most, the next most together "
        "with those above (RMS over joints and postures). Wires that gave on no robot but were "
        f"believed to on some actual one: {', '.join(wrong) or 'none'}.",
    )


STUDY = Study(
    name="adaptation",
    title="Adaptation to wires that give",
    introduction=(
        f"A robot learns; then {GIVING} wires give by {1e3 * LENGTH:g} mm for good, and it goes on "
        "learning. The same robot goes to the same postures without learning as well. Beside the "
        "actual robots stand the same without departures. The paper holds against maps that are "
        "not learned online that they cannot follow elongation, and shows no experiment."
    ),
    figure="claim of sec. I",
    conditions=(ACTUAL, NOMINAL),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
)

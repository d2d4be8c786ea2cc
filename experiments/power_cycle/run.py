"""Power cycle: all muscle lengths are zeroed anew, and what was learned before is remembered.

A robot learns, is switched off and on again, and its lengths count from other zeros then. Three
agents visit the same postures: one to which the zeroing is announced, one that has to detect it,
and one that has learned nothing. Without a zeroing none may be detected, even if one muscle was
elongated meanwhile.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import gymnasium as gym
import numpy as np

from experiments.harness import common
from experiments.harness.common import Summary
from experiments.harness.experiment import Experiment, Findings, Results, run_experiment
from experiments.harness.report import Table
from experiments.harness.statistics import interval, median_cell, metric
from experiments.power_cycle.robot import EstimateError, departures
from experiments.robots.conditions import ACTUAL, make_session
from experiments.robots.world import known_world
from jmm_agent.agent import Agent
from jmm_agent.types import Floats
from kengoro.agents import make_agent
from kengoro.robots import NO_END, shuffled_postures
from kengoro.session import Session
from kengoro.visits import visit
from kengoro_env.robot.draft import Departure

MUSCLES, POSTURE, ONE, NONE = "muscles", "posture", "one", "none"
ZEROED = {
    MUSCLES: "each length shifted by N(0, 1) x 3.5 mm",
    POSTURE: "zeroed at another posture, 3.5 mm RMS",
}
"""Power cycles with a zeroing of all lengths, and their titles."""
OTHERS = {ONE: "one muscle elongated by 10 mm", NONE: "nothing changed"}
"""Power cycles without one."""

ANNOUNCED, UNANNOUNCED, FRESH = "announced", "unannounced", "fresh"
"""Agents after the power cycle."""

BACK, SOON = 1.2, 3
"""Largest ratio of the error to that before the power cycle, after how many postures it must be
reached; it must stay so after all."""


@dataclass(frozen=True)
class Sizes:
    """Amount of work on each robot.

    Attributes:
        learned: number of postures that the agent learns from before the power cycle.
        after: number of postures after it.
        compared: number of other postures at which the error is evaluated.
        move: duration of a movement [s].
        patience: longest wait for rest and an observation [s].
    """

    learned: int = 27
    after: int = 10
    compared: int = 30
    move: float = 1.5
    patience: float = 2.0


QUICK = Sizes(learned=6, after=2, compared=4, move=0.8, patience=1.2)


def run(condition: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """Learn on one robot, switch it off and on, and learn on by each agent."""
    world, postures = known_world(cache), shuffled_postures(seed)
    before, after, compared, _ = np.split(
        postures, np.cumsum([1 + sizes.learned, 1 + sizes.after, sizes.compared])
    )
    robot = departures(condition, seed, world)
    error = EstimateError(robot, seed, compared, world)
    agent = make_agent(seed, cache=cache)
    session = make_session(ACTUAL, seed, agent, before[0])
    for posture in before[1:]:
        visit(session, posture, None, sizes.move, sizes.patience)
    session.env.close()
    old = EstimateError(departures(NONE, seed, world), seed, compared, world).deg(agent.map)
    found: dict[str, Any] = {"before_deg": round(old, 3), "learned": agent.vision.fired}
    with TemporaryDirectory() as folder:
        agent.save(Path(folder) / "learned.npz")
        for name in (ANNOUNCED, UNANNOUNCED, FRESH) if condition in ZEROED else (UNANNOUNCED,):
            agent = make_agent(seed, cache=cache)
            if name != FRESH:
                agent.load(Path(folder) / "learned.npz")
            if name == ANNOUNCED:
                agent.zeroed()
            found[name] = switched_on(agent, robot, seed, after, sizes, error)
    return found


def switched_on(
    agent: Agent,
    robot: tuple[Departure, ...],
    seed: int,
    postures: Floats,
    sizes: Sizes,
    error: EstimateError,
) -> dict[str, Any]:
    """Visit postures after the power cycle; the error before the first and after each.

    Args:
        agent: drives the robot and learns.
        robot: departures of the robot.
        seed: of the robot.
        postures: joint angles (1 + K, n) [rad]; it starts at the first.
        sizes: durations.
        error: of the map.
    """
    env = gym.make("Kengoro/Posture-v0", departures=robot, camera=True, max_episode_steps=NO_END)
    start = {"posture": postures[0], "target": postures[0]}
    session = Session(env, agent, seed + 1000, None, start)
    errors, named = [error.deg(agent.map)], None
    for number, posture in enumerate(postures[1:], start=1):
        visit(session, posture, None, sizes.move, sizes.patience)
        errors.append(error.deg(agent.map))
        if named is None and any(fault.kind == "zeroed" for fault in agent.faults):
            named = number
    env.close()
    return {
        "error_deg": [round(value, 3) for value in errors],
        "named_after": named,
        "learned": agent.vision.fired,
        "elongated": np.array(agent.map.muscles)[agent.vision.elongated.any(axis=0)].tolist(),
        "dropped": agent.vision.dropped,
    }


def ratios(results: Results, cycle: str, name: str, other: str) -> Floats:
    """Error of an agent relative to another's, shape (robots, 1 + postures)."""
    both = [
        [result[cycle][who]["error_deg"] for who in (name, other)] for result in results.values()
    ]
    return np.array([np.divide(one, two) for one, two in both])


def ratios_to_before(results: Results, cycle: str, name: str) -> Floats:
    """Error of an agent over that before the power cycle, shape (robots, 1 + postures)."""
    found = [result[cycle] for result in results.values()]
    return np.array([np.divide(one[name]["error_deg"], one["before_deg"]) for one in found])


def conclude(results: Results, sizes: Sizes) -> Findings:
    """Errors relative to a fresh agent's and to those before, and false alarms."""
    metrics: dict[str, Any] = {}
    for cycle in ZEROED:
        for name in (ANNOUNCED, UNANNOUNCED):
            each = ratios(results, cycle, name, FRESH)
            worst = max(range(each.shape[1]), key=lambda n: interval(each[:, n]).high)
            found = metric(each[:, worst], "", 1.0, by="high")
            metrics[f"{cycle}_{name}_to_fresh"] = {**found, "postures": worst}
            back = ratios_to_before(results, cycle, name)
            metrics[f"{cycle}_{name}_to_before"] = metric(back[:, -1], "", BACK)
            if sizes.after > SOON:
                metrics[f"{cycle}_{name}_to_before_at_{SOON}"] = metric(back[:, SOON], "", BACK)
        noticed = [
            result[cycle][UNANNOUNCED]["named_after"] is not None for result in results.values()
        ]
        metrics[f"{cycle}_noticed"] = metric(np.array(noticed, float), "", good="high")
    for cycle in OTHERS:
        alarms = [
            result[cycle][UNANNOUNCED]["named_after"] is not None for result in results.values()
        ]
        metrics[f"{cycle}_false_alarms"] = metric(np.array(alarms, float), "", 0.0, by="worst")
    tables = [error_table(results, cycle, sizes) for cycle in ZEROED]
    tables += [before_table(results, sizes), alarm_table(results)]
    per_seed = {seed: dict(result) for seed, result in results.items()}
    return Findings(metrics, per_seed, tables, (), {})


def error_table(results: Results, cycle: str, sizes: Sizes) -> Table:
    """Table of the errors by the number of postures since the power cycle."""
    rows: list[Sequence[object]] = []
    for number in range(sizes.after + 1):
        cells: list[object] = [number]
        for name in (ANNOUNCED, UNANNOUNCED, FRESH):
            errors = [result[cycle][name]["error_deg"][number] for result in results.values()]
            cells.append(str(interval(errors)))
        for name in (ANNOUNCED, UNANNOUNCED):
            cells.append(str(interval(ratios(results, cycle, name, FRESH)[:, number])))
        rows.append(cells)
    before = interval([result[cycle]["before_deg"] for result in results.values()])
    named = [result[cycle][UNANNOUNCED]["named_after"] for result in results.values()]
    return Table(
        f"Error after a power cycle [deg]: {ZEROED[cycle]}",
        (
            "postures",
            "announced",
            "unannounced",
            "fresh",
            "announced / fresh",
            "unannounced / fresh",
        ),
        rows,
        f"Median over robots [95 % interval]; before the power cycle {before}. Error: RMS over "
        f"joints of the angles that the map estimates from the robot's lengths, median over "
        f"{sizes.compared} postures that were not learned from. Unannounced: noticed after so many "
        f"postures on each robot: {', '.join('never' if n is None else str(n) for n in named)}.",
    )


def before_table(results: Results, sizes: Sizes) -> Table:
    """Table of the errors over those before the power cycle, by the number of postures."""
    rows = [
        (title, name, *(median_cell(one, 2) for one in ratios_to_before(results, cycle, name).T))
        for cycle, title in ZEROED.items()
        for name in (ANNOUNCED, UNANNOUNCED)
    ]
    head = ("lengths", "agent", *map(str, range(sizes.after + 1)))
    note = "Median over robots (worst robot), by the number of postures since the power cycle."
    return Table("Error over that before the power cycle", head, rows, note)


def alarm_table(results: Results) -> Table:
    """Table of power cycles without a zeroing."""
    rows = []
    for cycle, title in OTHERS.items():
        found = [result[cycle] for result in results.values()]
        alarms = sum(entry[UNANNOUNCED]["named_after"] is not None for entry in found)
        last = ratios_to_before(results, cycle, UNANNOUNCED)[:, -1]
        rows.append((title, f"{alarms} of {len(found)}", str(interval(last))))
    head = ("power cycle", "zeroing named", "error / error before")
    return Table("Power cycles without a zeroing", head, rows)


EXPERIMENT = Experiment(
    name="power-cycle",
    title="Power cycle",
    introduction=(
        "A robot learns, is switched off and on again, and all muscle lengths count from other "
        "zeros then. Three agents visit the same postures: one to which the zeroing is announced, "
        "one that has to detect it, and one that has learned nothing."
    ),
    figure="beyond the paper",
    conditions=(*ZEROED, *OTHERS),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
)


@dataclass(frozen=True)
class Args(common.Args):
    """All muscle lengths are zeroed anew, and what was learned before is remembered."""

    seeds: str = "0-9"
    out: Path = Path("out/power-cycle")


def main(args: Args) -> Summary:
    """Run the experiment; returns its summary."""
    return run_experiment(EXPERIMENT, args)

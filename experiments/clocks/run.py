"""Clocks: learning with other control periods, and with time stamps that are not exact.

The simulation keeps its own time. A clock gives the agent stamps that deviate, repeat or go back,
and lets cycles be lost or late. What a robot has learned is compared with what it learns by exact
stamps at the same control period.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from experiments.harness import common
from experiments.harness.common import Summary
from experiments.harness.experiment import Experiment, Findings, Results, run_experiment
from experiments.harness.report import Table
from experiments.harness.statistics import interval, metric
from experiments.robots.accuracy import MapAccuracy
from experiments.robots.conditions import ACTUAL
from experiments.robots.evaluation import Evaluator
from experiments.robots.world import known_world
from jmm_agent.agent import AgentOptions
from jmm_agent.updaters import VisionOptions
from jmm_agent.vision.hold_out import HoldOutOptions
from kengoro.agents import make_agent
from kengoro.clock import Clock
from kengoro.robots import NO_END, make_env, shuffled_postures
from kengoro.session import Session
from kengoro.visits import errors, visit

MUST = 1.1
"""Largest ratio of the error to that of exact stamps, for the upper end of its interval."""

SINCE_1970 = 1.7e9
"""A time stamp in seconds since 1970 [s]."""


class Condition(NamedTuple):
    """A clock, and the control period that it runs at.

    Attributes:
        title: what is wrong with the clock.
        period: control period [s].
        clock: the clock.
        guarded: whether a guard watches the robot.
    """

    title: str
    period: float
    clock: Clock
    guarded: bool = False

    @property
    def exact(self) -> str:
        """Name of the condition with exact stamps that this one is compared with."""
        return f"exact_{round(1e3 * self.period)}" + ("_guarded" if self.guarded else "")


def all_at_once(period: float) -> Clock:
    """Clock with all deviations at once, at a control period [s]."""
    return Clock(
        jitter=0.3 * period,
        offset=SINCE_1970,
        lost=0.05,
        late=0.05,
        repeated=0.02,
        backward=0.02,
    )


CONDITIONS = {
    "exact_20": Condition("exact", 0.02, Clock()),
    "exact_5": Condition("exact", 0.005, Clock()),
    "exact_50": Condition("exact", 0.05, Clock()),
    "exact_20_guarded": Condition("exact, with a guard", 0.02, Clock(), guarded=True),
    "all_5": Condition("all at once", 0.005, all_at_once(0.005)),
    "all_20": Condition("all at once", 0.02, all_at_once(0.02)),
    "all_50": Condition("all at once", 0.05, all_at_once(0.05)),
    "all_20_guarded": Condition("all at once, with a guard", 0.02, all_at_once(0.02), guarded=True),
    "jitter_1us": Condition("jitter of 1 us", 0.02, Clock(jitter=1e-6)),
    "jitter_30": Condition("jitter of 30 % of the period", 0.02, Clock(jitter=0.006)),
    "epoch": Condition("seconds since 1970", 0.02, Clock(offset=SINCE_1970)),
    "lost_5": Condition("5 % of cycles lost", 0.02, Clock(lost=0.05)),
    "late_5": Condition("5 % of cycles late", 0.02, Clock(late=0.05)),
    "skipped": Condition(
        "5 % of stamps repeated, 5 % too early", 0.02, Clock(repeated=0.05, backward=0.05)
    ),
    "set_back": Condition(
        "set back by an hour after 20 s", 0.02, Clock(set_at=20.0, set_by=-3600.0)
    ),
}
"""Conditions by name. "All at once" are a jitter of 30 %, stamps since 1970, 5 % of cycles lost and
5 % late, 2 % of stamps repeated and 2 % too early."""


@dataclass(frozen=True)
class Sizes:
    """Amount of work on each robot.

    Attributes:
        learned: number of postures that the agent learns from.
        tested: number of other postures on which the map is tested.
        compared: number of postures at which the map is compared with the robot's own lengths.
        move: duration of a movement [s].
        patience: longest wait for rest and an observation [s].
    """

    learned: int = 27
    tested: int = 12
    compared: int = 50
    move: float = 1.5
    patience: float = 2.0


QUICK = Sizes(learned=3, tested=2, compared=5, move=0.8, patience=1.2)


def run(condition: str, seed: int, sizes: Sizes, cache: Path | None) -> dict[str, Any]:
    """Learn on one robot by one clock, then test what was learned by exact stamps."""
    chosen = CONDITIONS[condition]
    postures = shuffled_postures(seed)
    start, *learned = postures[: 1 + sizes.learned]
    hold_out = HoldOutOptions() if chosen.guarded else None
    # Without feed-forward: the map alone commands the robot that tests it.
    chosen_options = AgentOptions(vision=VisionOptions(hold_out=hold_out), feed_forward=False)
    agent = make_agent(seed, guard=chosen.guarded, options=chosen_options, cache=cache)
    named: dict[tuple[str, float], None] = {}

    def watch(session: Session) -> None:
        for fault in agent.faults:
            named[fault.kind, fault.since] = None

    env = make_env("Posture", seed, max_episode_steps=NO_END, control_period=chosen.period)
    options = {"posture": start, "target": start}
    session = Session(env, agent, seed, watch, options, chosen.clock)
    for posture in learned:
        visit(session, posture, None, sizes.move, sizes.patience)
    env.close()
    tested = postures[-1 - sizes.tested :]
    evaluator = Evaluator(known_world(cache), ACTUAL, seed, sizes.move, sizes.patience)
    found = errors(evaluator.evaluate(agent.map, tested, agent.vision))
    kinds = [kind for kind, _ in named]
    return {
        "error_deg": found["target_true_deg"],
        "hand_mm": found["target_true_mm"],
        "map_mm": round(MapAccuracy(seed, sizes.compared).error_mm(agent), 3),
        "learned": agent.vision.fired,
        "dropped": agent.vision.dropped,
        "skipped": agent.time_line.skipped,
        "named": {kind: kinds.count(kind) for kind in sorted(set(kinds))},
        "duration": round(session.time, 1),
    }


def ratios(results: Results, condition: str, key: str) -> dict[int, float]:
    """Error of each robot by a clock, relative to that by exact stamps at the same period."""
    exact = CONDITIONS[condition].exact
    return {
        seed: result[condition][key] / result[exact][key]
        for seed, result in results.items()
        if exact in result
    }


def ratio_metric(values: Mapping[int, float]) -> dict[str, Any]:
    """Metric of ratios, of which the upper end of the interval must not exceed `MUST`."""
    return metric(values, "", MUST, by="high")


def conclude(results: Results, sizes: Sizes) -> Findings:
    """Ratios of the errors by each clock to those by exact stamps."""
    compared = [name for name, condition in CONDITIONS.items() if condition.exact != name]
    metrics = {
        f"ratio_{name}": ratio_metric(ratios(results, name, "error_deg")) for name in compared
    }
    for name in compared:
        metrics[f"map_ratio_{name}"] = metric(ratios(results, name, "map_mm"), "")
    for name in CONDITIONS:
        metrics[f"error_{name}"] = metric([r[name]["error_deg"] for r in results.values()], "deg")
    table = Table(
        "Learning by each clock",
        ("clock", "period [ms]", "error [deg]", "ratio", "map's error [mm]", "ratio",
         "learned", "skipped", "named"),
        [row(results, name) for name in CONDITIONS],
        f"Error: target - true at {sizes.tested} postures that were not learned from, after "
        f"{sizes.learned} that were. Ratios: to exact stamps at the same period on the same robot. "
        "Median over robots [95 % interval]. Learned, skipped: median number of observations and "
        "of readings. Named: number of faults on all robots.",
    )  # fmt: skip
    per_seed = {seed: dict(result) for seed, result in results.items()}
    return Findings(metrics, per_seed, [table], (), {})


def row(results: Results, name: str) -> list[object]:
    """Row of the table for one condition."""
    condition = CONDITIONS[name]
    found = [result[name] for result in results.values()]
    cells: list[object] = [condition.title, f"{1e3 * condition.period:g}"]
    for key in ("error_deg", "map_mm"):
        cells.append(str(interval([entry[key] for entry in found])))
        own = condition.exact == name
        cells.append("1" if own else str(interval(list(ratios(results, name, key).values()))))
    for key in ("learned", "skipped"):
        cells.append(f"{interval([entry[key] for entry in found]).median:g}")
    named: dict[str, int] = {}
    for entry in found:
        for kind, count in entry["named"].items():
            named[kind] = named.get(kind, 0) + count
    cells.append(", ".join(f"{count} {kind}" for kind, count in named.items()) or "nothing")
    return cells


EXPERIMENT = Experiment(
    name="clocks",
    title="Clocks of the control loop",
    introduction=(
        "A robot learns while its time stamps deviate, repeat or go back, and cycles are lost or "
        "late, at several control periods. The error afterwards is compared with that by exact "
        "stamps at the same period."
    ),
    figure="beyond the paper",
    conditions=tuple(CONDITIONS),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
)


@dataclass(frozen=True)
class Args(common.Args):
    """Learning with time stamps that are not exact, and with other control periods."""

    seeds: str = "0-9"
    out: Path = Path("out/clocks")


def main(args: Args) -> Summary:
    """Run the experiment; returns its summary."""
    return run_experiment(EXPERIMENT, args)

"""Tables and metrics of the stiffness, and of loads in the hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.harness.experiment import Results
from experiments.harness.report import Table
from experiments.harness.statistics import median_cell, metric
from jmm_agent.types import Floats

SAG, OURS, TENDONS = "map's lengths", "tensions", "tensions and tendons"
AGENTS = {
    SAG: "commands are the map's lengths",
    OURS: "commands pull with distributed tensions",
    TENDONS: "the same, and the stretch of tendons is known",
}
"""Conditions, and their titles."""
SIDE, FEEDBACK = "from one side", "feedback"
FRICTION_TITLES = {
    "at": "a movement from the posture before",
    SIDE: "from one side, each joint from below",
    FEEDBACK: "with feedback of the estimated posture",
}
"""What is done against friction, by the key in the results of ours, with titles."""
MUST_RATIO = {10.0: 1.3, 3.0: 2.5}
"""Largest error at a stiffness [N/mm], over that at the stiffness of learning [1]."""
MUST_TENSION = 0.7
"""Largest tension over that of commands which are the map's lengths [1]."""
MUST_STIFFNESS = 0.25
"""Largest difference of measured and asked stiffness, as a share of what was asked [1]."""
MUST_MASS = 0.1
"""Largest error of an estimated mass, as a share of it [1]."""
MUST_LOADED = 1.3
"""Largest error with a load over that with an empty hand [1]."""
FRICTION = 5.0
"""Dry friction of a muscle at a high tension of an actual robot [N], 1 N and 2 % of the tension."""


def numbers(results: Results, agent: str, stiffness: float, key: str, kind: str = "at") -> Floats:
    """A result of an agent at a stiffness [N/mm], of each robot; ``kind`` of `FRICTION_TITLES`."""
    found = [result[agent][kind][f"{stiffness:g}"][key] for result in results.values()]
    return np.array(found, dtype=float)


def pushed(results: Results, agent: str, key: str) -> list[Floats]:
    """A result of the pushes of each robot."""
    return [
        np.array([one[key] for one in result[agent]["pushes"]], dtype=float)
        for result in results.values()
    ]


def away(results: Results, agent: str) -> list[float]:
    """Median over pushes of |measured - asked| / asked, of each robot [1]."""
    both = zip(pushed(results, agent, "measured"), pushed(results, agent, "asked"), strict=True)
    return [float(np.median(np.abs(measured / asked - 1.0))) for measured, asked in both]


def metrics(results: Results, stiffness: Sequence[float]) -> dict[str, Mapping[str, Any]]:
    """Ratios to the stiffness of learning and to commands that are the map's lengths."""
    usual, *others = stiffness
    found: dict[str, Mapping[str, Any]] = {}
    for unit in ("deg", "mm"):
        key = f"target_true_{unit}"
        before = numbers(results, OURS, usual, key)
        for other in others:
            ratio = numbers(results, OURS, other, key) / before
            must = MUST_RATIO.get(other) if unit == "deg" else None
            found[f"error_at_{other:g}_over_{usual:g}_{unit}"] = metric(ratio, "", must=must)
        gap = before - numbers(results, SAG, usual, key)
        must = 0.0 if unit == "deg" else None
        found[f"error_above_that_of_map_lengths_{unit}"] = metric(gap, unit, must=must)
        found[f"error_at_{usual:g}_{unit}"] = metric(before, unit)
    tension = numbers(results, OURS, usual, "max_tension_N")
    tension = tension / numbers(results, SAG, usual, "max_tension_N")
    found["largest_tension_ratio"] = metric(tension, "", must=MUST_TENSION)
    for agent in (OURS, TENDONS):
        name = f"stiffness_away_{agent.replace(' ', '_')}"
        found[name] = metric(away(results, agent), "", must=MUST_STIFFNESS)
    return found


def loaded(results: Results, mass: float, key: str, condition: str = OURS) -> Floats:
    """A result of a condition with a load [kg], of each robot."""
    found = [result[condition]["loads"][f"{mass:g}"][key] for result in results.values()]
    return np.array(found, dtype=float)


def load_ratios(
    results: Results, loads: Sequence[float], name: str, condition: str = OURS
) -> dict[str, Mapping[str, Any]]:
    """Errors of postures over those with an empty hand.

    Args:
        results: of all robots, each with ``loads`` by mass, from `load.carried`.
        loads: masses [kg], the empty hand first.
        name: beginning of the metrics' names.
        condition: whose results are meant.
    """
    empty, *others = loads
    found: dict[str, Mapping[str, Any]] = {}
    for mass in others:
        for unit in ("deg", "mm"):
            key = f"target_true_{unit}"
            ratio = loaded(results, mass, key, condition) / loaded(results, empty, key, condition)
            must = MUST_LOADED if unit == "deg" else None
            found[f"{name}_with_{mass:g}_kg_over_empty_{unit}"] = metric(ratio, "", must=must)
    return found


def load_metrics(results: Results, loads: Sequence[float]) -> dict[str, Mapping[str, Any]]:
    """Errors of masses, and `load_ratios`."""
    empty, *others = loads
    found: dict[str, Mapping[str, Any]] = {
        "mass_of_nothing_kg": metric(np.abs(loaded(results, empty, "mass_kg")), "kg")
    }
    for mass in others:
        error = np.abs(loaded(results, mass, "mass_kg") / mass - 1.0)
        found[f"mass_error_{mass:g}_kg"] = metric(error, "", must=MUST_MASS)
    return found | load_ratios(results, loads, "error")


def load_table(results: Results, loads: Sequence[float], condition: str = OURS) -> Table:
    """Estimated masses, and errors of the postures, median over robots (worst robot)."""
    rows = []
    for mass in loads:
        estimates, spreads = (
            loaded(results, mass, key, condition) for key in ("mass_kg", "std_kg")
        )
        keys = ("target_true_deg", "target_true_mm", "max_tension_N")
        cells = [median_cell(loaded(results, mass, key, condition)) for key in keys]
        between = f"{estimates.min():.2f} to {estimates.max():.2f}"
        spread = np.median(np.where(np.isnan(spreads), np.inf, spreads))
        known = f"{spread:.2f}" if np.isfinite(spread) else "unknown"
        rows.append((f"{mass:g}", f"{np.median(estimates):.2f}", between, known, *cells))
    header = ("load [kg]", "estimate [kg]", "of all robots [kg]", "standard deviation [kg]",
              "joints [deg]", "hand [mm]", "largest tension [N]")  # fmt: skip
    note = (
        "Errors count after the first postures with a load. The first row is an empty hand that "
        "the agent believes to be full."
    )
    return Table("Loads in the hand", header, rows, note)


def friction_metrics(results: Results, stiffness: Sequence[float]) -> dict[str, Mapping[str, Any]]:
    """Errors of what is done against friction, over those of a movement alone."""
    found: dict[str, Mapping[str, Any]] = {}
    for kind in (SIDE, FEEDBACK):
        for value in stiffness:
            for unit in ("deg", "mm"):
                key = f"target_true_{unit}"
                usual = numbers(results, OURS, value, key)
                ratio = numbers(results, OURS, value, key, kind) / usual
                name = f"{kind.replace(' ', '_')}_over_movement_at_{value:g}_{unit}"
                found[name] = metric(ratio, "")
    return found


def friction_table(results: Results, stiffness: Sequence[float]) -> Table:
    """Errors of what is done against friction, median over robots (worst robot)."""
    keys = (
        "estimate_target_deg", "target_true_deg", "worst_deg", "target_true_mm", "max_tension_N"
    )  # fmt: skip
    rows = [
        (title, f"{value:g}", *(median_cell(one) for one in errors))
        for kind, title in FRICTION_TITLES.items()
        for value in stiffness
        for errors in [[numbers(results, OURS, value, key, kind) for key in keys]]
    ]
    header = ("how the posture is reached", "K [N/mm]", "joints, estimate - target [deg]",
              "joints, target - true [deg]", "worst posture [deg]", "hand, target - true [mm]",
              "largest tension [N]")  # fmt: skip
    return Table(
        "What friction leaves of a movement",
        header,
        rows,
        "By the agent whose commands pull with distributed tensions.",
    )


def tables(results: Results, stiffness: Sequence[float]) -> list[Table]:
    """All tables of the report."""
    rows = []
    for agent, title in AGENTS.items():
        for value in stiffness:
            keys = ("target_true_deg", "worst_deg", "target_true_mm", "max_tension_N")
            cells = [median_cell(numbers(results, agent, value, key)) for key in keys]
            rows.append((title, f"{value:g}", *cells, f"{FRICTION / value:.1f}"))
    pushes = []
    for agent in (OURS, TENDONS):
        for seed, result in results.items():
            for one in result[agent]["pushes"]:
                low, high = (1e-3 * value for value in one["muscles"])
                pushes.append(
                    (
                        AGENTS[agent],
                        seed,
                        one["joint"],
                        f"{one['asked']:.1f}",
                        f"{one['predicted']:.1f}",
                        f"{one['measured']:.1f}",
                        f"{low:.1f} to {high:.1f}",
                        f"{one['tension_N']:.0f}",
                    )
                )
    return [
        Table(
            "target - true by stiffness, median over robots (worst robot)",
            ("agent", "K [N/mm]", "joints [deg]", "worst posture [deg]", "hand [mm]",
             "largest tension [N]", "friction [mm]"),
            rows,
            "Medians over postures, but the fourth column. Last: length within which friction of "
            "5 N leaves a muscle.",
        ),
        Table(
            "Stiffness of joints by a push",
            ("agent", "robot", "joint", "asked [N m/rad]", "predicted", "measured",
             "muscles [N/mm]", "largest tension [N]"),
            pushes,
            "Torque on the joint alone, both ways; the second half of the push counts.",
        ),
    ]  # fmt: skip


def per_seed(results: Results) -> dict[int, Any]:
    """Errors of joints [deg] and largest tensions [N] by agent and stiffness, of each robot."""
    return {
        seed: {
            agent: {
                value: [found["target_true_deg"], found["max_tension_N"]]
                for value, found in result[agent]["at"].items()
            }
            for agent in AGENTS
        }
        for seed, result in results.items()
    }

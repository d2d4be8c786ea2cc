"""What the numbers on muscle Jacobians say: stages of a map, paired differences, the claim."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from experiments.harness.experiment import Results
from experiments.harness.report import Table
from experiments.harness.statistics import Interval, interval, metric, paired
from experiments.muscle_jacobian.moment_arms import ANALYTIC, KINDS, QUADRATIC, TRUE
from experiments.muscle_jacobian.roughness import ALL, TURN, numbers
from kengoro_env.names import GROUP_JOINTS

OURS, RULE, PAPER = "ours", "rule", "paper"
"""Our map and learning; our map and the paper's learning; the paper's map, on no robot."""

LEARNED = {OURS: "our map, our learning", RULE: "our map, the paper's learning"}
"""Conditions in which a robot learns."""

WAVY = 1.5
"""Moment arms that turn so many times as often as the true ones are called wavy."""


class Stage(NamedTuple):
    """A map at some time, and what it is compared with.

    Attributes:
        key: in the names of metrics.
        told: in tables.
        short: in pictures.
        condition, examined: where its numbers stand in the results.
    """

    key: str
    told: str
    short: str
    condition: str
    examined: str

    @property
    def truth(self) -> str:
        """What it is compared with."""
        return "nominal" if self.examined == "nominal" else "robot"


STAGES = (
    Stage("ours", "our map before learning", "our map", OURS, "nominal"),
    Stage("paper", "the paper's map before learning", "paper's map", PAPER, "nominal"),
    Stage("ours_before", "our map before learning", "our map,\nbefore", OURS, "before"),
    Stage("ours_learned", "our map after our learning", "our map,\nour learning", OURS, "after"),
    Stage(
        "paper_learned",
        "our map after the paper's learning",
        "our map,\npaper's learning",
        RULE,
        "after",
    ),
)

MEASURED = {
    "error": "RMS error [mm/rad]",
    "roughness": "bend / true bend",
    "turns": "turns a sweep",
}
"""Numbers that are compared, as in `waviness.numbers`."""

PARTS = {
    "whole": "the whole range",
    "inner": "the range without 20 deg at both ends",
}


def over_seeds(
    results: Results, stage: Stage, kind: str, name: str, part: str = "whole", group: str = ALL
) -> list[float]:
    """A number of `waviness.numbers` for each seed."""
    return [
        numbers(result[stage.condition][stage.examined][part], kind, group)[name]
        for result in results.values()
    ]


def gain(
    results: Results, stage: Stage, name: str, part: str = "whole", group: str = ALL
) -> Interval:
    """Quadratic - analytic on the same robot: below 0 where the quadratic one is better."""
    one, other = (
        over_seeds(results, stage, kind, name, part, group) for kind in (QUADRATIC, ANALYTIC)
    )
    return paired(one, other)


class Verdict(NamedTuple):
    """What holds of the paper's claim, in words."""

    wavy: bool
    turns: str
    error: str

    @property
    def claim(self) -> str:
        """Whether the claim holds: the analytic one is wavy, the quadratic one smoother."""
        return {2: "yes", 1: "in part", 0: "no"}[self.wavy + (self.turns == "fewer")]


def verdict(results: Results, stage: Stage, part: str = "whole", group: str = ALL) -> Verdict:
    """What the intervals over robots say; nothing is said where they hold 0."""
    turns = np.array(over_seeds(results, stage, ANALYTIC, "turns", part, group))
    true = np.array(over_seeds(results, stage, TRUE, "turns", part, group))
    return Verdict(
        interval(turns - WAVY * true).low > 0,
        _word(gain(results, stage, "turns", part, group), "fewer", "more"),
        _word(gain(results, stage, "error", part, group), "closer", "farther"),
    )


def _word(gained: Interval, better: str, worse: str) -> str:
    return better if gained.high < 0 else worse if gained.low > 0 else "no difference"


def claim_table(results: Results, part: str) -> Table:
    """The paper's claim on each map."""
    rows = []
    for stage in STAGES:
        found = verdict(results, stage, part)
        rows.append(
            (
                stage.told,
                stage.truth,
                "yes" if found.wavy else "no",
                found.turns,
                found.error,
                found.claim,
            )
        )
    return Table(
        f"Does the paper's claim hold? Over {PARTS[part]}",
        (
            "map",
            "truth",
            "analytic is wavy",
            "quadratic turns",
            "quadratic is to the truth",
            "the claim holds",
        ),
        rows,
        f"Wavy: it turns more than {WAVY:g} times as often as the true one. All by 95 % intervals "
        "over robots, paired; the claim is that the analytic one is wavy and the quadratic one "
        "turns less often. Within 20 deg of an end of a joint's range the five points reach beyond "
        "it, where little or nothing was learned.",
    )


def stage_table(results: Results, part: str) -> Table:
    """All numbers of each map, all groups together."""
    rows: list[list[object]] = []
    for stage in STAGES:
        for name, told in MEASURED.items():
            kinds = (ANALYTIC, QUADRATIC, TRUE) if name == "turns" else (ANALYTIC, QUADRATIC)
            cells = [interval(over_seeds(results, stage, kind, name, part)) for kind in kinds]
            rows.append(
                [
                    f"{stage.told} ({stage.truth}): {told}",
                    *cells,
                    *[""] * (3 - len(cells)),
                    gain(results, stage, name, part),
                ]
            )
    return Table(
        f"Errors and waviness over {PARTS[part]}: median over robots with its 95 % interval",
        ("", "analytic", "quadratic", "true", "quadratic - analytic, paired"),
        rows,
        "Bend: RMS of the second derivative along a sweep. A turn: a moment arm goes back by more "
        f"than {TURN:g} mm/rad. {_difference(results)} {_kinks(results)}",
    )


def _difference(results: Results) -> str:
    """How far the paper's difference is from the analytic derivative."""
    gaps = [r[of.condition][of.examined]["difference"] for r in results.values() for of in STAGES]
    return (
        "The paper also names a difference over 0.1 deg; it is within "
        f"{max(gaps):.1g} mm/rad of the analytic one during flexion."
    )


def _kinks(results: Results) -> str:
    """How much rougher than the drawing's the true moment arms of the robots are."""
    ratios = [
        r[OURS]["before"]["whole"][TRUE][ALL]["bend"]
        / r[OURS]["nominal"]["whole"][TRUE][ALL]["bend"]
        for r in results.values()
    ]
    return (
        f"The robots' true moment arms bend {np.median(ratios):.2g} times as much as the drawing's "
        f"(at most {max(ratios):.2g}): where a wire begins to wrap over a bone they have a kink."
    )


def group_table(results: Results) -> Table:
    """Error and turns by group, over the whole range."""
    rows = []
    for stage in STAGES:
        for group in GROUP_JOINTS:
            cells = [
                f"{np.median(over_seeds(results, stage, kind, name, 'whole', group)):.3g}"
                for name, kinds in (("error", KINDS), ("turns", (*KINDS, TRUE)))
                for kind in kinds
            ]
            rows.append((f"{stage.told} ({stage.truth}): {group}", *cells))
    return Table(
        "By group, over the whole range: medians over robots",
        (
            "",
            "analytic: error [mm/rad]",
            "quadratic: error [mm/rad]",
            "analytic: turns",
            "quadratic: turns",
            "true: turns",
        ),
        rows,
    )


def estimator_table(results: Results) -> Table:
    """Joint estimation by both Jacobians."""
    rows = []
    for condition, told in LEARNED.items():
        found = [result[condition]["estimator"] for result in results.values()]
        columns = {
            name: [of[name] for of in found] for name in ("analytic", "quadratic", "between")
        }
        rows.append(
            (
                told,
                *map(interval, columns.values()),
                paired(columns["quadratic"], columns["analytic"]),
            )
        )
    return Table(
        "Does it matter? Joint angles estimated by both Jacobians on new movements [deg]",
        (
            "map after learning",
            "analytic: estimate - true",
            "quadratic: estimate - true",
            "between the two estimates",
            "quadratic - analytic, paired",
        ),
        rows,
        "RMS over time and joints of each robot; the same measured lengths for both. Median over "
        "robots with its 95 % interval.",
    )


def told(results: Results) -> list[str]:
    """Whether the claim holds, in sentences."""
    sentences = []
    for part in PARTS:
        for stage in STAGES:
            found = verdict(results, stage, part)
            wavy = "wavy" if found.wavy else "not wavy"
            sentences.append(
                f"{stage.told.capitalize()}, against the {stage.truth}, over {PARTS[part]}: "
                f"claim holds: {found.claim}; the analytic Jacobian is {wavy}; "
                f"turns of the quadratic one: {found.turns}; it is to the truth: {found.error}."
            )
    return sentences


def metrics(results: Results) -> dict[str, dict[str, Any]]:
    """Errors of both Jacobians on each map, how wavy the analytic one is, what the other gains."""
    found = {}
    for stage in STAGES:
        of = {
            (kind, name): np.array(over_seeds(results, stage, kind, name))
            for kind in KINDS
            for name in MEASURED
        }
        true = np.array(over_seeds(results, stage, TRUE, "turns"))
        found[f"{stage.key}_analytic_error"] = metric(of[ANALYTIC, "error"], "mm/rad")
        found[f"{stage.key}_quadratic_error"] = metric(of[QUADRATIC, "error"], "mm/rad")
        turned = of[ANALYTIC, "turns"] / true
        found[f"{stage.key}_analytic_turns_per_true_turn"] = metric(turned, "", paper="wavy")
        for name, paper in (("error", None), ("roughness", "< 0"), ("turns", "< 0")):
            gained = of[QUADRATIC, name] - of[ANALYTIC, name]
            unit = "mm/rad" if name == "error" else ""
            key = f"{stage.key}_quadratic_minus_analytic_{name}"
            found[key] = metric(gained, unit, paper=paper)
    return found

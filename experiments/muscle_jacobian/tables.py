"""Tables of muscle Jacobians: stages of a map, paired differences, verdict on the claim."""

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
"""Conditions: our map and learning; our map and the paper's learning; the paper's map, no robot."""

LEARNED = {OURS: "our map, our learning", RULE: "our map, the paper's learning"}
"""Conditions in which a robot learns."""

ROUGH = 1.5
"""Ratio of turns to true turns above which moment arms count as rough."""


class Stage(NamedTuple):
    """A map at some stage, and the truth that it is compared with.

    Attributes:
        key: in the names of metrics.
        title: in tables.
        short: in figures.
        condition, evaluated: keys of its numbers in the results.
    """

    key: str
    title: str
    short: str
    condition: str
    evaluated: str

    @property
    def truth(self) -> str:
        """Source of the true moment arms."""
        return "nominal" if self.evaluated == "nominal" else "robot"


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
"""Numbers that are compared, as in `roughness.numbers`."""

PARTS = {
    "whole": "the whole range",
    "inner": "the range without 20 deg at both ends",
}


def over_seeds(
    results: Results, stage: Stage, kind: str, name: str, part: str = "whole", group: str = ALL
) -> list[float]:
    """A number of `roughness.numbers` for each seed."""
    return [
        numbers(result[stage.condition][stage.evaluated][part], kind, group)[name]
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
    """Verdict on the claim of the paper.

    Attributes:
        rough: whether the analytic Jacobian is rough.
        turns: turns of the quadratic one compared with the analytic one.
        error: error of the quadratic one compared with the analytic one.
    """

    rough: bool
    turns: str
    error: str

    @property
    def claim(self) -> str:
        """Whether the analytic Jacobian is rough and the quadratic one smoother."""
        return {2: "yes", 1: "in part", 0: "no"}[self.rough + (self.turns == "fewer")]


def verdict(results: Results, stage: Stage, part: str = "whole", group: str = ALL) -> Verdict:
    """Verdict from intervals over robots; there is no difference if they include 0."""
    turns = np.array(over_seeds(results, stage, ANALYTIC, "turns", part, group))
    true = np.array(over_seeds(results, stage, TRUE, "turns", part, group))
    return Verdict(
        interval(turns - ROUGH * true).low > 0,
        _word(gain(results, stage, "turns", part, group), "fewer", "more"),
        _word(gain(results, stage, "error", part, group), "smaller", "larger"),
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
                stage.title,
                stage.truth,
                "yes" if found.rough else "no",
                found.turns,
                found.error,
                found.claim,
            )
        )
    return Table(
        f"Verdict on the paper's claim over {PARTS[part]}",
        (
            "map",
            "truth",
            "analytic is rough",
            "quadratic turns",
            "error of quadratic",
            "claim holds",
        ),
        rows,
        f"Rough: it turns more than {ROUGH:g} times as often as the true one. All by paired 95 % "
        "intervals over robots. The claim is that the analytic one is rough and the quadratic one "
        "turns less often. Within 20 deg of an end of a joint's range some of the five points are "
        "outside the range, where the map is hardly trained.",
    )


def stage_table(results: Results, part: str) -> Table:
    """Table of all numbers of each map over all groups."""
    rows: list[list[object]] = []
    for stage in STAGES:
        for name, label in MEASURED.items():
            kinds = (ANALYTIC, QUADRATIC, TRUE) if name == "turns" else (ANALYTIC, QUADRATIC)
            cells = [interval(over_seeds(results, stage, kind, name, part)) for kind in kinds]
            rows.append(
                [
                    f"{stage.title} ({stage.truth}): {label}",
                    *cells,
                    *[""] * (3 - len(cells)),
                    gain(results, stage, name, part),
                ]
            )
    return Table(
        f"Errors and roughness over {PARTS[part]}: median over robots with its 95 % interval",
        ("", "analytic", "quadratic", "true", "quadratic - analytic, paired"),
        rows,
        "Bend: RMS of the second derivative along a sweep. Turn: the moment arm reverses by more "
        f"than {TURN:g} mm/rad. {_difference(results)} {_kinks(results)}",
    )


def _difference(results: Results) -> str:
    """Sentence on the difference quotient of the paper and the analytic derivative."""
    gaps = [r[of.condition][of.evaluated]["difference"] for r in results.values() for of in STAGES]
    return (
        "The paper also mentions a difference over 0.1 deg, which deviates from the analytic one "
        f"by at most {max(gaps):.1g} mm/rad during flexion."
    )


def _kinks(results: Results) -> str:
    """Sentence on the roughness of the true moment arms of robots and nominal model."""
    ratios = [
        r[OURS]["before"]["whole"][TRUE][ALL]["bend"]
        / r[OURS]["nominal"]["whole"][TRUE][ALL]["bend"]
        for r in results.values()
    ]
    return (
        f"The bend of the robots' true moment arms is {np.median(ratios):.2g} times that of the "
        f"nominal model (at most {max(ratios):.2g}), due to a kink where a muscle starts to "
        "wrap around a bone."
    )


def group_table(results: Results) -> Table:
    """Table of error and turns by group over the whole range."""
    rows = []
    for stage in STAGES:
        for group in GROUP_JOINTS:
            cells = [
                f"{np.median(over_seeds(results, stage, kind, name, 'whole', group)):.3g}"
                for name, kinds in (("error", KINDS), ("turns", (*KINDS, TRUE)))
                for kind in kinds
            ]
            rows.append((f"{stage.title} ({stage.truth}): {group}", *cells))
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
    """Table of the joint estimation by both Jacobians."""
    rows = []
    for condition, label in LEARNED.items():
        found = [result[condition]["estimator"] for result in results.values()]
        columns = {
            name: [of[name] for of in found] for name in ("analytic", "quadratic", "between")
        }
        rows.append(
            (
                label,
                *map(interval, columns.values()),
                paired(columns["quadratic"], columns["analytic"]),
            )
        )
    return Table(
        "Joint angles estimated by both Jacobians on new movements [deg]",
        (
            "map after learning",
            "analytic: estimate - true",
            "quadratic: estimate - true",
            "between the two estimates",
            "quadratic - analytic, paired",
        ),
        rows,
        "RMS over time and joints of each robot, from the same measured lengths. Median over "
        "robots with its 95 % interval.",
    )


def statements(results: Results) -> list[str]:
    """Verdicts on the claim, in sentences."""
    sentences = []
    for part in PARTS:
        for stage in STAGES:
            found = verdict(results, stage, part)
            rough = "rough" if found.rough else "not rough"
            sentences.append(
                f"{stage.title.capitalize()}, compared with the {stage.truth}, over {PARTS[part]}: "
                f"claim holds: {found.claim}; the analytic Jacobian is {rough}; "
                f"turns of the quadratic one: {found.turns}; error of it: {found.error}."
            )
    return sentences


def metrics(results: Results) -> dict[str, dict[str, Any]]:
    """Metrics of errors and roughness of both Jacobians on each map."""
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
        found[f"{stage.key}_analytic_turns_per_true_turn"] = metric(turned, "", paper="rough")
        for name, paper in (("error", None), ("roughness", "< 0"), ("turns", "< 0")):
            gained = of[QUADRATIC, name] - of[ANALYTIC, name]
            unit = "mm/rad" if name == "error" else ""
            key = f"{stage.key}_quadratic_minus_analytic_{name}"
            found[key] = metric(gained, unit, paper=paper)
    return found

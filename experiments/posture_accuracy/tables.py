"""Metrics and tables of posture accuracy: averages over trials, spread over start postures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from experiments.harness.report import Table
from experiments.harness.statistics import interval, metric, paired
from experiments.robots.conditions import ACTUAL, NOMINAL
from jmm_agent.types import Floats
from kengoro.visits import ERRORS, Visits, error_rows, gaps, hand_mm, rmse_deg
from kengoro_env.names import JOINTS

WHEN = ("before", "after")
MEASURES = {"deg": rmse_deg, "mm": hand_mm}
"""RMSE_joint [deg] and Distance_hand [mm] of each visit."""

NAMED = 3
"""Number of joints with the largest errors that are listed."""

DISAGREE = 1.5
"""Ratio of true to seen error from which on they disagree."""


class Judged(NamedTuple):
    """An error of `averages` with its thresholds.

    Attributes:
        key: of `averages`.
        paper: numbers of the paper: before, after, and ratio after / before.
        must, must_ratio: thresholds of after, and of the ratio.
        aim: further threshold of after.
    """

    key: str
    paper: tuple[float | None, float | None, float | None] = (None, None, None)
    must: float | None = None
    must_ratio: float | None = None
    aim: float | None = None


JUDGED = {
    "rmse_seen": Judged("estimate_seen_deg", (12.49, 4.99, 0.40), 4.99, 0.40),
    "hand_seen": Judged("estimate_seen_mm", (217.95, 57.53, 0.26)),
    "rmse_true": Judged("target_true_deg", must=4.99, aim=2.5),
    "hand_true": Judged("target_true_mm", must=57.5, must_ratio=0.26, aim=20.0),
    "rmse_estimate_true": Judged("estimate_true_deg"),
    "hand_estimate_true": Judged("estimate_true_mm"),
}

PerSeed = Mapping[int, Mapping[str, Any]]
"""`seed_entry` by seed and condition."""


def by_posture(visits: Visits, starts: int, pair: str, unit: str) -> list[Floats]:
    """Errors of the trials of each target posture, one number a start with an error.

    Args:
        visits: of all trials, ordered by target.
        starts: number of start postures of each target.
        pair: of `ERRORS`.
        unit: of `MEASURES`.
    """
    count = len(visits["time"]) // starts
    parts = [slice(k * starts, (k + 1) * starts) for k in range(count)]
    return [MEASURES[unit]({key: v[part] for key, v in visits.items()}, pair) for part in parts]


def averages(visits: Visits, starts: int) -> dict[str, Any]:
    """Means over trials, as in the paper.

    Returns:
        ``PAIR_deg`` and ``PAIR_mm``: means. ``PAIR_deg_std`` and ``PAIR_mm_std``: standard
        deviations over the starts of a posture, mean over postures. Further: largest tension,
        numbers of trials and observations, and joints with the largest errors. Pairs without
        any error are left out, such as those with seen angles if the hand was never seen.
    """
    result: dict[str, Any] = {}
    for pair in ERRORS:
        for unit in MEASURES:
            found = [errors for errors in by_posture(visits, starts, pair, unit) if errors.size]
            if found:
                result[f"{pair}_{unit}"] = round(float(np.concatenate(found).mean()), 4)
                result[f"{pair}_{unit}_std"] = round(float(np.mean([e.std() for e in found])), 4)
    result["max_tension_N"] = max(visits["max_tension"])
    result["trials"] = len(visits["time"])
    result["seen"] = sum(seen is not None for seen in visits["seen"])
    off = np.degrees(np.sqrt(np.mean(gaps(visits, "estimate_true") ** 2, axis=0)))
    worst = np.argsort(-off)[:NAMED]
    result["most_off_deg"] = {JOINTS[j]: round(float(off[j]), 2) for j in worst}
    return result


def seed_entry(result: Mapping[str, Any]) -> dict[str, Any]:
    """Entry of one robot in the summary."""
    more = ("learning_time", "updates", "dropped")
    return {
        **{when: averages(result[when], result["starts"]) for when in WHEN},
        "away_deg": min(result["away_deg"]),
        "away_rms_deg": min(result["away_rms_deg"]),
        **{key: result[key] for key in more},
    }


def of_robots(per_seed: PerSeed, key: str, when: str, condition: str = ACTUAL) -> dict[int, float]:
    """A number of `averages` by robot, without robots that do not have it."""
    found = {seed: entry[condition][when] for seed, entry in per_seed.items()}
    return {seed: averages[key] for seed, averages in found.items() if key in averages}


def metrics(per_seed: PerSeed) -> dict[str, dict[str, Any]]:
    """Metrics; those that no robot has are left out."""
    found: dict[str, tuple[Any, ...]] = {}  # by name, the arguments of `metric`
    for name, judged in JUDGED.items():
        before, after = (of_robots(per_seed, judged.key, when) for when in WHEN)
        ratio = {seed: after[seed] / before[seed] for seed in after if seed in before}
        unit, paper = judged.key.rpartition("_")[2], judged.paper
        found[f"{name}_before"] = (before, unit, None, paper[0])
        found[f"{name}_after"] = (after, unit, judged.must, paper[1])
        found[f"{name}_ratio"] = (ratio, "", judged.must_ratio, paper[2])
        if judged.aim is not None:
            found[f"{name}_after_aim"] = (after, unit, judged.aim)
    for name in ("rmse_seen", "rmse_true"):
        spread = of_robots(per_seed, f"{JUDGED[name].key}_std", "after")
        found[f"{name}_std_over_starts_after"] = (spread, "deg", None, "very small")
    for name in ("rmse_true", "hand_true"):
        key, unit = JUDGED[name].key, JUDGED[name].key.rpartition("_")[2]
        for when in WHEN:
            found[f"{name}_{when}_nominal"] = (of_robots(per_seed, key, when, NOMINAL), unit)
    time, away, away_rms = (
        [entry[ACTUAL][key] for entry in per_seed.values()]
        for key in ("learning_time", "away_deg", "away_rms_deg")
    )
    found["learning_time"] = (time, "s", 300.0, 300.0)
    found["away_largest_joint"] = (away, "deg", 20.0, 20.0, "high")
    found["away_rms"] = (away_rms, "deg", None, None, "high")
    return {name: metric(*arguments) for name, arguments in found.items() if arguments[0]}


def tables(per_seed: PerSeed) -> list[Table]:
    """Tables of both definitions of error, and of each robot."""
    columns = {
        f"{condition}, {when}": [entry[condition][when] for entry in per_seed.values()]
        for condition in (ACTUAL, NOMINAL)
        for when in WHEN
    }
    return [
        Table(
            "Both definitions of error: mean over trials, median over robots (worst robot)",
            ("", *columns),
            error_rows(columns),
            " ".join((disagreement(per_seed), sag(per_seed), spread(per_seed), counted(per_seed))),
        ),
        robot_table(per_seed),
    ]


def disagreement(per_seed: PerSeed) -> str:
    """Sentence on the agreement of seen and true errors after learning."""
    seen = of_robots(per_seed, "estimate_seen_deg", "after")
    true = of_robots(per_seed, "estimate_true_deg", "after")
    both = [(true[seed], seen[seed]) for seed in seen]
    if not both:
        return "The hand was never seen after learning."
    gap, share = paired(*zip(*both, strict=True)), interval([t / s for t, s in both])
    named = Counter(j for e in per_seed.values() for j in e[ACTUAL]["after"]["most_off_deg"])
    joints = ", ".join(joint for joint, _ in named.most_common(NAMED))
    if gap.low <= 0.0 or share.median < DISAGREE:
        return f"Seen and true agree after learning: estimate - true is {share} times as large."
    return (
        f"Seen and true disagree after learning: estimate - true is {gap} deg larger than "
        f"estimate - seen, {share} times as large. The joints that most often have the largest "
        f"errors are {joints}."
    )


def sag(per_seed: PerSeed) -> str:
    """Sentence on the error without departures."""
    nominal, actual = (
        interval(list(of_robots(per_seed, "target_true_deg", "before", condition).values()))
        for condition in (NOMINAL, ACTUAL)
    )
    after = interval(list(of_robots(per_seed, "target_true_deg", "after", NOMINAL).values()))
    return (
        f"Without departures, target - true is {nominal} deg before learning, which is sag under "
        f"gravity, and {after} deg after; on the actual robots it is {actual} deg before."
    )


def spread(per_seed: PerSeed) -> str:
    """Sentence on the spread over start postures."""
    before, after = (
        interval(list(of_robots(per_seed, "target_true_deg_std", when).values())) for when in WHEN
    )
    return (
        "Standard deviation of target - true over the starts of a posture: "
        f"{before} deg before, {after} deg after."
    )


def counted(per_seed: PerSeed) -> str:
    """Sentence on the number of trials."""
    robot = next(iter(per_seed.values()))
    own, nominal = (robot[condition]["before"]["trials"] for condition in (ACTUAL, NOMINAL))
    return (
        f"Trials before, and the same after: {own} on each actual robot, and {nominal} on each "
        "robot without departures, from the first of the same starts."
    )


def robot_table(per_seed: PerSeed) -> Table:
    """Table of each robot's means before and after."""
    pairs = ("estimate_seen", "target_true")
    rows = []
    for seed, entry in per_seed.items():
        found = entry[ACTUAL]
        cells = [
            " -> ".join(_cell(found[when].get(f"{pair}_{unit}")) for when in WHEN)
            for unit in MEASURES
            for pair in pairs
        ]
        observations = " -> ".join(f"{found[w]['seen']} of {found[w]['trials']}" for w in WHEN)
        away = f"{found['away_deg']:.0f} ({found['away_rms_deg']:.0f})"
        rows.append((seed, *cells, observations, f"{found['learning_time']:.0f}", away))
    names = [f"{ERRORS[pair]} [{unit}]" for unit in MEASURES for pair in pairs]
    head = ("robot", *names, "hand seen in", "learning [s]", "away [deg]")
    return Table(
        "Each robot, before -> after",
        head,
        rows,
        "Means over trials; mm is Distance_hand. Learning: simulated time. Away: least "
        "distance of a new posture from the nearest learned one, by the largest joint difference "
        "(by the RMS over joints).",
    )


def _cell(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"

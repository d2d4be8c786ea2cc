"""Antagonism Updater on the elbow (paper, sec. IV-B): wires that fight each other give way.

All wires of a robot are tightened by one length such that its first movement needs 375 N, as the
paper's did. Then the elbow moves to 30, 60 and 90 deg, eleven times, and learns what it feels.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import bisect

from experiments.harness.errors import ExperimentError
from experiments.harness.experiment import Findings, Results, Study
from experiments.harness.report import Table
from experiments.harness.statistics import interval, metric, paired
from experiments.robots.elbow import AGONISTS, ANTAGONIST, SCENE, Elbow
from jmm_agent.mapping.minibatch import MinibatchRule
from kengoro.arm import ACTUAL, NOMINAL
from kengoro_env.assets import asset_path
from kengoro_env.postures import least_tension
from kengoro_env.robot.motors import DEFAULT_GAINS
from kengoro_env.robot.nominal_model import NominalArm

ANGLES_DEG = (30.0, 60.0, 90.0)
START_N = 375.0
"""Largest tension of the first movement, without learning: the middle of 350 to 400 N."""
TIGHTEST = 0.03
"""How much wires are tightened, or loosened, at most [m]."""
THINNED = 5
"""Every so many control steps are kept for the figure."""

OURS, PAPER, OFF = "ours", "paper", "off"
RULES = {OURS: "ours", PAPER: "the paper's minibatch steps", OFF: "no learning"}


@dataclass(frozen=True)
class Sizes:
    """How much is done.

    Attributes:
        trials: number of trials with learning.
        move, hold: duration of a movement, and of the rest after it [s].
        tightening: how exactly the common tightening is found [m].
    """

    trials: int = 11
    move: float = 2.0
    hold: float = 2.0
    tightening: float = 1e-4


QUICK = Sizes(trials=2, move=0.6, hold=0.8, tightening=2e-3)


def run(condition: str, seed: int, sizes: Sizes, maps: Path | None) -> dict[str, Any]:
    """One robot: how much it is tightened [m], and its trials under each rule."""
    tightened = tighten(condition, seed, sizes, maps)
    result: dict[str, Any] = {"tightened": tightened}
    for name in (OURS, PAPER, OFF) if condition == ACTUAL else (OURS,):
        elbow = Elbow(
            condition,
            seed,
            tightened,
            maps,
            MinibatchRule() if name == PAPER else None,
            learning=False,
        )
        stretch(elbow, sizes)
        trials = [move(elbow, sizes)]
        elbow.learning = name != OFF
        trials += [move(elbow, sizes) for _ in range(sizes.trials)]
        result[name] = trials
    return result


def tighten(condition: str, seed: int, sizes: Sizes, maps: Path | None) -> float:
    """By how much all wires must be zeroed too tight for a first movement at `START_N` [m]."""

    def beyond(length: float) -> float:
        elbow = Elbow(condition, seed, length, maps, learning=False)
        stretch(elbow, sizes)
        return float(move(elbow, sizes)["largest"]) - START_N

    try:
        return float(bisect(beyond, -TIGHTEST, TIGHTEST, xtol=sizes.tightening))
    except ValueError as error:
        raise ExperimentError(
            f"Robot {seed}: no common tightening of up to {1e3 * TIGHTEST:.0f} mm makes its first "
            f"movement need {START_N:.0f} N."
        ) from error


def stretch(elbow: Elbow, sizes: Sizes) -> None:
    """To 90 deg and back once, which does not count: dry friction remembers how it was mounted."""
    elbow.go(np.radians(ANGLES_DEG[-1]), sizes.move, sizes.hold)
    elbow.go(0.0, sizes.move, sizes.hold)


def move(elbow: Elbow, sizes: Sizes) -> dict[str, Any]:
    """One trial: to each angle and back to zero. The way back does not count.

    Returns:
        ``largest`` tension [N] of the trial; by angle ``tensions`` (3, 3) [N] at the end of each
        rest, ``target``, ``true``, ``estimate`` [deg], and ``least``, the tension [N] with which
        the drawing's wires could hold the true angle; ``curve`` of the tensions (K, 3) [N].
    """
    arm = _drawing()
    curve, tensions, angles, least = [], [], [], []
    for angle in ANGLES_DEG:
        found = elbow.go(np.radians(angle), sizes.move, sizes.hold)
        curve.append(found)
        tensions.append(found[-10:].mean(axis=0))
        angles.append((angle, np.degrees(elbow.true), np.degrees(elbow.estimate)))
        here = np.array([elbow.true])
        least.append(
            least_tension(arm.moment_arms(here), arm.gravity(here), least=DEFAULT_GAINS.bias)
        )
    elbow.go(0.0, sizes.move, sizes.hold)
    every = np.concatenate(curve)
    target, true, estimate = np.round(angles, 3).T.tolist()
    return {
        "largest": round(float(every.max()), 2),
        "tensions": np.round(tensions, 2).tolist(),
        "least": np.round(least, 2).tolist(),
        "target": target,
        "true": true,
        "estimate": estimate,
        "curve": np.round(every[::THINNED], 1).tolist(),
    }


@cache
def _drawing() -> NominalArm:
    return NominalArm(asset_path(SCENE))


def numbers(trial: dict[str, Any]) -> dict[str, float]:
    """What is told of one trial; all but the largest tension at rest, over the angles."""
    tensions = np.array(trial["tensions"])
    one, other = AGONISTS
    angles = {key: np.array(trial[key]) for key in ("target", "true", "estimate")}
    return {
        "largest_N": trial["largest"],
        "agonist_difference_N": float(np.mean(np.abs(tensions[:, one] - tensions[:, other]))),
        "antagonist_N": float(np.mean(tensions[:, ANTAGONIST])),
        "excess_N": float(np.mean(tensions.max(axis=1) - trial["least"])),
        "estimate_true_deg": _rms(angles["estimate"] - angles["true"]),
        "target_true_deg": _rms(angles["target"] - angles["true"]),
        "true_at_90_deg": trial["true"][-1],
    }


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


TOLD = {
    "largest_N": "largest tension of the trial [N]",
    "agonist_difference_N": "biceps against brachialis, difference [N]",
    "antagonist_N": "triceps [N]",
    "excess_N": "largest tension beyond the least that holds the posture [N]",
    "estimate_true_deg": "estimate - true [deg]",
    "target_true_deg": "target - true [deg]",
    "true_at_90_deg": "true angle when 90 deg are wanted [deg]",
}


def conclude(results: Results, sizes: Sizes) -> Findings:
    """First trial without learning against the last after it."""
    from experiments.antagonism_elbow.figures import pictures

    per_seed: dict[int, Any] = {}
    for seed, result in results.items():
        runs = {name: result[ACTUAL][name] for name in RULES} | {NOMINAL: result[NOMINAL][OURS]}
        per_seed[seed] = {
            name: {"first": _rounded(trials[0]), "last": _rounded(trials[-1])}
            for name, trials in runs.items()
        }
        per_seed[seed]["tightened_mm"] = round(1e3 * result[ACTUAL]["tightened"], 2)

    def values(key: str, when: str, name: str = OURS) -> np.ndarray:
        return np.array([entry[name][when][key] for entry in per_seed.values()])

    def change(key: str, name: str = OURS) -> np.ndarray:
        return values(key, "last", name) - values(key, "first", name)

    def ratio(name: str) -> np.ndarray:
        return values("largest_N", "last", name) / values("largest_N", "first", name)

    metrics = {
        "first_largest_tension": metric(values("largest_N", "first"), "N", paper=370),
        "last_largest_tension": metric(values("largest_N", "last"), "N", paper=250),
        "tension_ratio": metric(ratio(OURS), "", must=0.68, paper=0.68),
        "tension_ratio_paper_rule": metric(ratio(PAPER), "", paper=0.68),
        "tension_ratio_nominal": metric(ratio(NOMINAL), ""),
        "agonist_difference_change": metric(
            change("agonist_difference_N"), "N", 0.0, "becomes equal"
        ),
        "antagonist_change": metric(change("antagonist_N"), "N", 0.0, "decreases"),
        "excess_tension_first": metric(values("excess_N", "first"), "N"),
        "excess_tension_last": metric(values("excess_N", "last"), "N"),
        "true_drop_at_90": metric(-change("true_at_90_deg"), "deg", 10.0, "largely different"),
        "estimate_true_first": metric(values("estimate_true_deg", "first"), "deg"),
        "estimate_true_last": metric(values("estimate_true_deg", "last"), "deg"),
        "target_true_last": metric(values("target_true_deg", "last"), "deg"),
    }
    tables = [_table(per_seed), _rule_table(per_seed)]
    return Findings(metrics, per_seed, tables, pictures(results), {})


def _rounded(trial: dict[str, Any]) -> dict[str, float]:
    return {key: round(value, 2) for key, value in numbers(trial).items()}


def _table(per_seed: dict[int, Any]) -> Table:
    """First and last trial of ours, beside the robots without departures."""
    rows = []
    for key, told in TOLD.items():
        cells = []
        for name in (OURS, NOMINAL):
            for when in ("first", "last"):
                found = [entry[name][when][key] for entry in per_seed.values()]
                cells.append(f"{np.median(found):.1f} ({min(found):.1f} to {max(found):.1f})")
        rows.append((told, *cells))
    return Table(
        "First trial without learning and last after it: median (range) over robots",
        ("", "actual, first", "actual, last", "drawing, first", "drawing, last"),
        rows,
        "The elbow has no camera, so the truth stands for what the paper's observers saw. At rest, "
        "means over 30, 60 and 90 deg. Both robots were tightened to the same first tension. The "
        "least tension is that of the drawing's wires, none below the bias of the motors.",
    )


def _rule_table(per_seed: dict[int, Any]) -> Table:
    """Largest tension by rule, paired against no learning."""
    rows = []
    last = {
        name: [entry[name]["last"]["largest_N"] for entry in per_seed.values()] for name in RULES
    }
    for name, told in RULES.items():
        gain = "" if name == OFF else f"{paired(last[name], last[OFF])}"
        rows.append((told, f"{interval(last[name])}", f"{max(last[name]):.0f}", gain))
    return Table(
        "Largest tension [N] in the last trial by rule",
        ("", "median [95 % interval]", "worst robot", "against no learning, paired"),
        rows,
        "Medians over robots with bootstrap 95 % intervals. The paper does not tell the size and "
        f"number of its gradient steps; here they are {MinibatchRule().steps} of Adam at a rate of "
        f"{MinibatchRule().rate:g}.",
    )


STUDY = Study(
    name="antagonism-elbow",
    title="Antagonism Updater on the elbow",
    introduction=(
        "The elbow moves to 30, 60 and 90 deg and back, eleven times, and learns the lengths that "
        "it feels at the angles that it believes in. Robots differ by their seed; so that they "
        "start alike, all wires of one robot are tightened by the same length until its first "
        "movement, without learning, needs 375 N. The gains are the same for all: "
        f"{DEFAULT_GAINS.stiffness / 1e3:.0f} N/mm and {DEFAULT_GAINS.bias:.0f} N of bias."
    ),
    figure="Fig. 9",
    conditions=(ACTUAL, NOMINAL),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
)

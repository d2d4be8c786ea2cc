"""Antagonism Updater on the elbow (paper, sec. IV-B): antagonistic muscles pull less.

All muscles of a robot are tightened by one length such that its first movement needs 375 N, as in
the paper. Then the elbow moves to 30, 60 and 90 deg, eleven times, and learns from its lengths.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import bisect

from experiments.harness import common
from experiments.harness.common import Summary
from experiments.harness.errors import ExperimentError
from experiments.harness.experiment import Experiment, Findings, Results, run_experiment
from experiments.harness.report import Table
from experiments.harness.statistics import interval, metric, paired
from experiments.robots.conditions import ACTUAL, NOMINAL
from experiments.robots.elbow import AGONISTS, ANTAGONIST, SCENE, Elbow
from jmm_agent.mapping.minibatch import MinibatchRule
from kengoro_env.assets import asset_path
from kengoro_env.postures import least_tension
from kengoro_env.robot.muscle_law import DEFAULT_GAINS
from kengoro_env.robot.nominal_model import NominalArm

ANGLES_DEG = (30.0, 60.0, 90.0)
START_N = 375.0
"""Largest tension of the first movement, without learning: the middle of 350 to 400 N."""
TIGHTEST = 0.03
"""Largest length by which muscles are tightened or loosened [m]."""
THINNED = 5
"""Number of control steps for each sample of the figure."""

OURS, PAPER, OFF = "ours", "paper", "off"
RULES = {OURS: "ours", PAPER: "the paper's minibatch steps", OFF: "no learning"}


@dataclass(frozen=True)
class Sizes:
    """Amount of work on each robot.

    Attributes:
        trials: number of trials with learning.
        move, hold: duration of a movement, and of the rest after it [s].
        tightening: tolerance of the common tightening [m].
    """

    trials: int = 11
    move: float = 2.0
    hold: float = 2.0
    tightening: float = 1e-4


QUICK = Sizes(trials=2, move=0.6, hold=0.8, tightening=2e-3)


def run(condition: str, seed: int, sizes: Sizes, maps: Path | None) -> dict[str, Any]:
    """Run one robot; returns its tightening [m] and its trials with each rule."""
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
    """Length by which all muscles are tightened for a first movement at `START_N` [m]."""

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
    """Move to 90 deg and back without recording, so that dry friction is in a defined state."""
    elbow.go(np.radians(ANGLES_DEG[-1]), sizes.move, sizes.hold)
    elbow.go(0.0, sizes.move, sizes.hold)


def move(elbow: Elbow, sizes: Sizes) -> dict[str, Any]:
    """Run one trial: move to each angle, and back to zero without recording.

    Returns:
        ``largest``: largest tension of the trial [N]. By angle: ``tensions`` at the end of each
        rest, shape (3, 3) [N]; ``target``, ``true`` and ``estimate`` [deg]; ``least``: smallest
        largest tension with which the nominal muscles can hold the true angle [N]. ``curve`` of
        the tensions, shape (K, 3) [N].
    """
    arm = _nominal()
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
def _nominal() -> NominalArm:
    return NominalArm(asset_path(SCENE))


def numbers(trial: dict[str, Any]) -> dict[str, float]:
    """Numbers of one trial: its largest tension, and means at rest over the angles."""
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


LABELS = {
    "largest_N": "largest tension of the trial [N]",
    "agonist_difference_N": "difference of biceps and brachialis [N]",
    "antagonist_N": "triceps [N]",
    "excess_N": "largest tension above the least that holds the posture [N]",
    "estimate_true_deg": "estimate - true [deg]",
    "target_true_deg": "target - true [deg]",
    "true_at_90_deg": "true angle at a target of 90 deg [deg]",
}


def conclude(results: Results, sizes: Sizes) -> Findings:
    """Compare the first trial, without learning, with the last."""
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
    """Table of the first and last trial on actual robots and on those without departures."""
    rows = []
    for key, label in LABELS.items():
        cells = []
        for name in (OURS, NOMINAL):
            for when in ("first", "last"):
                found = [entry[name][when][key] for entry in per_seed.values()]
                cells.append(f"{np.median(found):.1f} ({min(found):.1f} to {max(found):.1f})")
        rows.append((label, *cells))
    return Table(
        "First trial without learning, and last trial: median (range) over robots",
        ("", "actual, first", "actual, last", "nominal, first", "nominal, last"),
        rows,
        "The elbow has no camera, so the true angle stands for the observation in the paper. At "
        "rest: means over 30, 60 and 90 deg. All robots are tightened to the same first tension. "
        "The least tension is that of the nominal muscles, none below the bias of the motors.",
    )


def _rule_table(per_seed: dict[int, Any]) -> Table:
    """Table of the largest tension by rule, paired with no learning."""
    rows = []
    last = {
        name: [entry[name]["last"]["largest_N"] for entry in per_seed.values()] for name in RULES
    }
    for name, label in RULES.items():
        gain = "" if name == OFF else f"{paired(last[name], last[OFF])}"
        rows.append((label, f"{interval(last[name])}", f"{max(last[name]):.0f}", gain))
    return Table(
        "Largest tension [N] in the last trial by rule",
        ("", "median [95 % interval]", "worst robot", "minus no learning, paired"),
        rows,
        "Medians over robots with bootstrap 95 % intervals. The paper does not state the size and "
        f"number of its gradient steps; here they are {MinibatchRule().steps} steps of Adam at a "
        f"rate of {MinibatchRule().rate:g}.",
    )


EXPERIMENT = Experiment(
    name="antagonism-elbow",
    title="Antagonism Updater on the elbow",
    introduction=(
        "The elbow moves to 30, 60 and 90 deg and back, eleven times, and learns the measured "
        "lengths at its estimated angles. All muscles of a robot are tightened by one length such "
        "that the first movement, without learning, needs 375 N, so that all robots start with "
        "the same tension. The gains are the same for all: "
        f"{DEFAULT_GAINS.stiffness / 1e3:.0f} N/mm and {DEFAULT_GAINS.bias:.0f} N of bias."
    ),
    figure="Fig. 9",
    conditions=(ACTUAL, NOMINAL),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
)


@dataclass(frozen=True)
class Args(common.Args):
    """Antagonism Updater on the elbow: antagonistic muscles pull less (Fig. 9)."""

    seeds: str = "0-9"
    out: Path = Path("out/antagonism-elbow")


def main(args: Args) -> Summary:
    """Run the experiment; returns its summary."""
    return run_experiment(EXPERIMENT, args)

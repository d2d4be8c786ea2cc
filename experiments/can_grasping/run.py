"""Can grasping (paper, sec. IV, last subsection): a can that was missed is grasped.

On each robot the whole trial runs, then its control: the map before learning, from the same IK
target as the last approach. Beside them stand tests of both maps on postures that were not learned,
and the trial of the same robot without departures.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich import get_console

from experiments.can_grasping.narration import Tell, no_progress, stage_bar, watcher
from experiments.can_grasping.robot import SWEEP_DEG, CanRobot
from experiments.can_grasping.tables import metrics, outcome_table, tables
from experiments.harness import common
from experiments.harness.common import Summary
from experiments.harness.experiment import Findings, Results, Study, run_study
from experiments.harness.report import print_table
from kengoro import trained_maps
from kengoro.arm import ACTUAL, NOMINAL
from kengoro.hand_search import TrialOptions
from kengoro.viewer.video import Video
from mjcf_sandbox.files import whole_file

FLEXED_DEG = -120.0
"""Shoulder pitch at which the paper compares the map before and after."""


@dataclass(frozen=True)
class Sizes:
    """How much is done.

    Attributes:
        trial: how the trial runs.
        tested: postures on which the map is tested before and after.
    """

    trial: TrialOptions = field(default_factory=TrialOptions)
    tested: int = 8


QUICK = Sizes(TrialOptions(approaches=2, postures=3, move=1.0, patience=1.5), tested=2)


@dataclass(frozen=True)
class Args(common.Args):
    """Options of the can-grasping experiment.

    Attributes:
        seeds: robots, as A-B or A; seeds below 100 are for tuning.
        out: folder of the results.
    """

    seeds: str = "100"
    out: Path = Path("out/can-grasping")


def run(
    condition: str,
    seed: int,
    sizes: Sizes,
    cache: Path | None,
    films: Mapping[int, Path] | None = None,
    live: bool = False,
) -> dict[str, Any]:
    """The experiment on one robot: its ``summary`` and the ``curves`` for the figures.

    Args:
        condition: `ACTUAL`, or `NOMINAL`: without departures, the trial only.
        seed: of the robot.
        sizes: how much is done.
        cache: folder of trained maps.
        films: by seed, where the video of an actual robot's trial goes.
        live: whether a bar shows what the robot does.
    """
    robot = CanRobot(condition, seed, sizes.trial, sizes.tested, cache)
    name = "Kengoro" if condition == ACTUAL else "Kengoro as drawn"
    film = (films or {}).get(seed) if condition == ACTUAL else None
    with stage_bar(name) if live else nullcontext(no_progress) as tell:
        if condition == NOMINAL:
            robot.run_trial(watcher(None, tell))
            return {"summary": trial_summary(robot)}
        return run_actual(robot, film, tell)


def run_actual(robot: CanRobot, film: Path | None, tell: Tell) -> dict[str, Any]:
    """Test, trial, test and control of an actual robot."""
    tell("is tested before", 0.0)
    before = robot.test(robot.before)
    if film is None:
        robot.run_trial(watcher(None, tell))
    else:
        with Video(film) as video:
            robot.run_trial(watcher(video, tell), render_mode="rgb_array")
    tell("is tested after", 0.0)
    after, control, curves = robot.test(), robot.run_control(), robot.curves()
    summary = trial_summary(robot)
    flexed = SWEEP_DEG.tolist().index(FLEXED_DEG)
    changes = np.subtract(curves["lengths_after"], curves["lengths_before"])[flexed]
    return {
        "summary": {
            "grasped_before": control or summary["grasped_at_first_approach"],
            "grasped_before_from_the_last_target": control,
            **summary,
            "before": before,
            "after": after,
            "jmm_change_mm": round(float(np.abs(changes).max()), 2),
        },
        "curves": curves,
    }


def trial_summary(robot: CanRobot) -> dict[str, Any]:
    """How a trial went."""
    trial, agent = robot.trial, robot.agent
    return {
        "grasped_at_first_approach": bool(trial.approaches) and trial.approaches[0].grasped,
        "grasped_after": bool(trial.approaches) and trial.approaches[-1].grasped,
        "approaches": [
            {
                "hand_distance_mm": round(1e3 * approach.distance, 1),
                "can_distance_mm": round(1e3 * approach.can_distance, 1),
                "grasped": approach.grasped,
                "max_tension_N": round(approach.max_tension, 1),
            }
            for approach in trial.approaches
        ],
        "postures": trial.postures,
        "updates": {
            "antagonism": agent.antagonism.fired,
            "vision": agent.vision.fired,
            "dropped": agent.vision.dropped,
        },
        "estimator_consistent": consistency(robot),
        "notes": trial.notes,
    }


def consistency(robot: CanRobot) -> dict[str, Any] | None:
    """Whether wires and map agree within the encoders' noise at the end, and by how much not."""
    found = robot.agent.estimator.consistency
    if found is None:
        return None
    return {
        "consistent": found.consistent,
        "nis": round(found.value, 1),
        "band": [round(found.low, 1), round(found.high, 1)],
    }


def conclude(results: Results, sizes: Sizes) -> Findings:
    """Who grasped, and errors and tensions before and after."""
    from experiments.can_grasping.figures import figures

    per_seed = {
        seed: {**result[ACTUAL]["summary"], NOMINAL: result[NOMINAL]["summary"]}
        for seed, result in results.items()
    }
    return Findings(metrics(per_seed), per_seed, tables(per_seed), figures(results), {})


STUDY = Study(
    name="can-grasping",
    title="Can grasping",
    introduction=(
        "Kengoro looks at a can, solves inverse kinematics and reaches for it as its drawing tells "
        "it, but the robot is not the drawing. It moves its hand before its eyes and learns, "
        "approaches again, looks once more at its arm if it must, until it grasps the can and "
        "lifts it or has no approach left. After a miss a person puts the can back where it stood. "
        "Beside the actual robots stand the same without departures."
    ),
    figure="Figs. 12 to 14",
    conditions=(ACTUAL, NOMINAL),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
)


def main(args: Args) -> Summary:
    """Run the experiment, or what of it is missing; one robot alone is shown live."""
    seeds = common.parse_seeds(args.seeds)
    common.check_jobs(args.jobs)
    console, alone = get_console(), len(seeds) == 1
    with console.status("Kengoro studies its drawing (some seconds, once) ..."):
        trained_maps.trained_map(args.cache)
    kept = args.out / "robots" / f"{seeds[0]:03d}-{ACTUAL}.json"
    film = kept.with_name(f"{seeds[0]:03d}.mp4")
    if not args.quick and not film.exists():
        kept.unlink(missing_ok=True)  # its trial runs again and is filmed
    films = None if args.quick else {seeds[0]: film}
    study = replace(STUDY, run=partial(run, films=films, live=alone))
    summary = run_study(study, replace(args, jobs=1) if alone else args)
    print_table(console, outcome_table(summary["per_seed"]))
    if films is not None:
        with whole_file(args.out / "episode.mp4") as beside:
            shutil.copyfile(film, beside)
        console.print(f"Video: {args.out}/episode.mp4")
    return summary

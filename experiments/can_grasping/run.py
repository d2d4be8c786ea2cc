"""Can grasping (paper, sec. IV, last subsection): a can that was missed is grasped.

On each robot the trial runs, then its control: the map before learning with the IK target of the
last approach. Both maps are also tested on postures that are not learned from, and the trial runs
on the robot without departures.
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

from experiments.can_grasping.robot import SWEEP_DEG, CanRobot
from experiments.can_grasping.tables import closing, metrics, outcome_table, tables
from experiments.harness import common
from experiments.harness.common import Summary
from experiments.harness.experiment import Experiment, Findings, Results, run_experiment
from experiments.harness.report import print_table
from experiments.robots.conditions import ACTUAL, NOMINAL, Seen, with_seen
from jmm_agent.updaters.vision_options import HandKind
from jmm_agent.vision.can_shape import CanKind
from kengoro import trained_maps
from kengoro.hand_search import TrialOptions
from kengoro.viewer.progress import ProgressCallback, film_and_progress, no_progress, stage_bar
from kengoro.viewer.video import open_video
from mjcf_sandbox.files import whole_file

OUT = Path("out/can-grasping")
"""Folder of the results, if none is given."""
FLEXED_DEG = -120.0
"""Shoulder pitch at which the paper compares the map before and after [deg]."""


@dataclass(frozen=True)
class Sizes:
    """Amount of work on each robot.

    Attributes:
        trial: options of the trial.
        tested: number of postures on which the map is tested before and after.
        hand: whether the hand carries its marker ("marker") or none ("seen").
        detector: digest of the file that sees the hand; empty for Kengoro's own.
        can: whether the can carries its marker ("marker") or none ("seen").
    """

    trial: TrialOptions = field(default_factory=TrialOptions)
    tested: int = 8
    hand: HandKind = "marker"
    detector: str = ""
    can: CanKind = "marker"


QUICK = Sizes(TrialOptions(approaches=2, postures=3, move=1.0, patience=1.5), tested=2)


@dataclass(frozen=True)
class Args(common.Args):
    """A can that was missed is grasped after learning (sec. IV).

    Attributes:
        seeds: robots, as A-B or A; seeds below 100 are for tuning.
        out: folder of the results.
        hand: whether the hand carries a marker ("marker"), or is seen without one ("seen").
        can: whether the can carries a marker ("marker"), or is seen without one ("seen").
        detector: file of `kengoro hand-detector` that sees the hand; Kengoro's own if left out.
    """

    seeds: str = "100"
    out: Path = OUT
    hand: HandKind = "marker"
    can: CanKind = "marker"
    detector: Path | None = None


def run(
    condition: str,
    seed: int,
    sizes: Sizes,
    cache: Path | None,
    films: Mapping[int, Path] | None = None,
    live: bool = False,
    detector: Path | None = None,
) -> dict[str, Any]:
    """Run one robot; returns its ``summary`` and the ``curves`` for the figures.

    Args:
        condition: `ACTUAL`, or `NOMINAL` for the trial only, without departures.
        seed: of the robot.
        sizes: amount of work.
        cache: folder of trained maps.
        films: files for the videos of actual robots' trials, by seed.
        live: whether a bar shows the progress.
        detector: file that sees the hand; None: Kengoro's own.
    """
    seen = Seen(sizes.hand, detector, sizes.can)
    robot = CanRobot(condition, seed, sizes.trial, sizes.tested, cache, seen)
    name = "Kengoro" if condition == ACTUAL else "nominal Kengoro"
    film = (films or {}).get(seed) if condition == ACTUAL else None
    with stage_bar(name) if live else nullcontext(no_progress) as progress:
        if condition == NOMINAL:
            robot.run_trial(film_and_progress(None, progress))
            return {"summary": trial_summary(robot)}
        return run_actual(robot, film, progress)


def run_actual(robot: CanRobot, film: Path | None, progress: ProgressCallback) -> dict[str, Any]:
    """Run test, trial, test and control of an actual robot."""
    progress("tests the map before", 0.0)
    before = robot.test(robot.before)
    if film is None:
        robot.run_trial(film_and_progress(None, progress))
    else:
        with open_video(film) as video:
            robot.run_trial(film_and_progress(video, progress), render_mode="rgb_array")
    progress("tests the map after", 0.0)
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
    """Entry of a trial in the summary."""
    trial, agent = robot.trial, robot.agent
    return {
        "grasped_at_first_approach": bool(trial.approaches) and trial.approaches[0].grasped,
        "grasped_after": bool(trial.approaches) and trial.approaches[-1].grasped,
        "approaches": [
            {
                "start_s": round(approach.start, 2),
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
    """Consistency of muscle lengths and map with the noise of the encoders at the end."""
    found = robot.agent.estimator.consistency
    if found is None:
        return None
    return {
        "consistent": found.consistent,
        "nis": round(found.value, 1),
        "band": [round(found.low, 1), round(found.high, 1)],
    }


def conclude(results: Results, sizes: Sizes) -> Findings:
    """Grasps, and errors and tensions before and after learning."""
    from experiments.can_grasping.figures import figures

    per_seed = {
        seed: {**result[ACTUAL]["summary"], NOMINAL: result[NOMINAL]["summary"]}
        for seed, result in results.items()
    }
    found = Findings(metrics(per_seed), per_seed, tables(per_seed), figures(results), {})
    return replace(found, closing=closing(*per_seed.values())) if len(per_seed) == 1 else found


EXPERIMENT = Experiment(
    name="can-grasping",
    title="Can grasping",
    introduction=(
        "Kengoro observes a can, solves inverse kinematics and reaches for it with the map of the "
        "nominal model, from which the robot departs. Then it moves its hand in view of the camera "
        "and learns, and approaches again, until it grasps and lifts the can or no approach is "
        "left. After a miss the can is put back to its place. The same is done on robots without "
        "departures."
    ),
    figure="Figs. 12 to 14",
    conditions=(ACTUAL, NOMINAL),
    sizes=Sizes(),
    quick=QUICK,
    run=run,
    conclude=conclude,
)


def main(args: Args) -> Summary:
    """Run the experiment; a bar shows the progress of a single robot."""
    seen = Seen(args.hand, args.detector, args.can)
    chosen, args = with_seen(EXPERIMENT, args, seen, OUT)
    seeds = common.parse_seeds(args.seeds)
    common.check_jobs(args.jobs)
    console, alone = get_console(), len(seeds) == 1
    with console.status("Training the map of the nominal model (half a minute, once) ..."):
        trained_maps.trained_map(args.cache)
    kept = args.out / "robots" / f"{seeds[0]:03d}-{ACTUAL}.json"
    film = kept.with_name(f"{seeds[0]:03d}.mp4")
    if not args.quick and not film.exists():
        kept.unlink(missing_ok=True)  # so that its trial runs again and is filmed
    films = None if args.quick else {seeds[0]: film}
    known: dict[str, Any] = {} if args.detector is None else {"detector": args.detector}
    experiment = replace(chosen, run=partial(run, films=films, live=alone, **known))
    summary = run_experiment(experiment, replace(args, jobs=1) if alone else args)
    if not alone:
        print_table(console, outcome_table(summary["per_seed"]))
    if films is not None:
        with whole_file(args.out / "episode.mp4") as beside:
            shutil.copyfile(film, beside)
        console.print(f"Film: {args.out}/episode.mp4")
    return summary

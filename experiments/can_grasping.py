"""Can grasping (paper, sec. IV, last subsection): a can that was missed is grasped.

On each robot the whole trial runs, then its control: the map before learning, from the same IK
target as the last approach. Beside them stand tests of both maps on postures that were not learned.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from experiments import common
from experiments.arm import make_agent
from experiments.can_figures import figures
from experiments.can_robot import CanRobot
from experiments.can_tables import error_table, medians_and_worst, outcome_table
from experiments.common import Summary
from experiments.report import print_table, write_report
from experiments.session import Session
from experiments.video import Video
from kengoro_env.names import GROUP_JOINTS

MODULES = (
    "can_grasping.py",
    "can_robot.py",
    "grasp_trial.py",
    "session.py",
)
LOG_PERIOD = 0.2
"""Time between two points of the curves that are kept [s]."""

VIDEO_PERIOD = 0.2
"""Time between two pictures of the video [s]; it runs five times as fast as the robot."""

USUAL_TIME = 120.0
"""Time that a trial takes, roughly, for the bar [s of the robot's time]."""

INTRODUCTION = (
    "Kengoro looks at a can, solves inverse kinematics, reaches, and misses, because the robot is "
    "not the drawing. It moves its hand before its eyes and learns, approaches again, looks once "
    "more at its arm if it must, grasps the can and lifts it. After a miss a person puts the can "
    "back where it stood."
)


@dataclass(frozen=True)
class Args(common.Args):
    """Options of the can-grasping experiment.

    Attributes:
        seeds: robots, as A-B or A; seeds below 100 are for tuning.
        out: folder of the results.
        drawn: run the drawing itself instead of actual robots, as the check that it can grasp.
    """

    seeds: str = "100"
    out: Path = Path("out/can-grasping")
    drawn: bool = False


def main(args: Args) -> Summary:
    """Run it on all seeds; write ``summary.json``, ``report.html`` and ``episode.mp4``."""
    seeds = common.parse_seeds(args.seeds)
    common.check_jobs(args.jobs)
    begin = time.perf_counter()
    console = Console()
    _train(args.cache, console)
    if not args.drawn:
        common.log_reported(seeds)
    first, video = f"{seeds[0]}", args.out / "episode.mp4"
    tasks = {
        f"{seed}": (seed, args.cache, args.drawn, video if seed == seeds[0] else None)
        for seed in seeds
    }
    if len(seeds) == 1:
        with stage_bar(console) as tell:
            results = {first: run_robot(*tasks[first], tell)}
    else:
        key = common.source_digest(*MODULES)
        results = common.run_tasks(run_robot, tasks, args.jobs, args.out / "robots", key)
    per_seed = {seed: results[f"{seed}"]["summary"] for seed in seeds}
    summary = common.make_summary(
        "can-grasping", per_seed, time.perf_counter() - begin, medians=medians_and_worst(per_seed)
    )
    pictures = figures(results)
    tables = [outcome_table(per_seed), error_table(per_seed)]
    write_report(args.out / "report.html", "Can grasping", INTRODUCTION, summary, tables, pictures)
    common.write_json(args.out / "summary.json", summary)
    for table in tables:
        print_table(console, table)
    console.print(f"Results: {args.out}/summary.json, report.html, episode.mp4")
    return summary


def run_robot(
    seed: int,
    cache: Path | None,
    drawn: bool,
    video: Path | None,
    tell: Callable[[str, float], None] | None = None,
) -> dict[str, Any]:
    """The experiment on one robot: its ``summary`` and the ``curves`` for the figures.

    Args:
        seed: of the robot.
        cache: folder of trained maps.
        drawn: whether the robot is the drawing.
        video: where the video goes; None for none.
        tell: called with the stage and the simulated time [s].
    """
    robot = CanRobot(seed, cache, drawn)
    if tell is not None:
        tell("is tested before", 0.0)
    before = robot.test(make_agent(robot.before, seed))
    if video is None:
        robot.run_trial(_watcher(None, tell))
    else:
        with Video(video) as film:
            robot.run_trial(_watcher(film, tell), render_mode="rgb_array")
    if tell is not None:
        tell("is tested after", 0.0)
    after = robot.test(robot.agent)
    control = robot.run_control()
    return {
        "summary": _seed_summary(robot, before, after, control),
        "curves": _curves(robot),
    }


def _watcher(
    film: Video | None, tell: Callable[[str, float], None] | None
) -> Callable[[Session, str], None]:
    def watch(session: Session, stage: str) -> None:
        steps = round(session.time / VIDEO_PERIOD, 6)
        if not steps.is_integer():
            return
        if tell is not None:
            tell(stage, session.time)
        if film is not None:
            outside = session.env.render()
            frame = session.observation["frame"]
            film.add(frame, np.asarray(outside), stage, f"{session.time:5.1f} s")

    return watch


@contextmanager
def stage_bar(console: Console) -> Iterator[Callable[[str, float], None]]:
    """A bar that tells what the robot does and how much of its time has gone."""
    columns = (
        TextColumn("Kengoro {task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.0f} s of its time"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console) as bar:
        task = bar.add_task("wakes up", total=USUAL_TIME)
        yield lambda stage, at: bar.update(task, description=f"{stage:<33}", completed=at or None)
        bar.update(task, description=f"{'is done':<33}", completed=USUAL_TIME)


def _train(cache: Path | None, console: Console) -> None:
    with console.status("Kengoro studies its drawing (some seconds, once) ..."):
        common.trained_map(cache)


def _seed_summary(
    robot: CanRobot, before: Mapping[str, float], after: Mapping[str, float], control: bool
) -> dict[str, Any]:
    trial = robot.trial
    first = bool(trial.approaches) and trial.approaches[0].grasped
    pair = {"before": before, "after": after}

    def both(name: str) -> dict[str, float | None]:
        return {
            when: round(test[name], 3) if np.isfinite(test[name]) else None
            for when, test in pair.items()
        }

    return {
        "grasped_before": control or first,
        "grasped_before_at_first_approach": first,
        "grasped_before_from_the_last_target": control,
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
        "rmse_joint_deg": both("target_true_deg"),
        "rmse_joint_seen_deg": both("seen_deg"),
        "estimate_true_deg": both("estimate_true_deg"),
        "estimate_target_deg": both("estimate_target_deg"),
        "hand_target_true_mm": both("hand_target_true_mm"),
        "hand_estimate_true_mm": both("hand_estimate_true_mm"),
        "max_tension_N": both("max_tension_N"),
        "updates": {
            "antagonism": robot.agent.antagonism.fired,
            "vision": robot.agent.vision.fired,
            "dropped": robot.agent.vision.dropped,
        },
        "estimator_consistent": _consistency(robot),
        "notes": trial.notes,
    }


def _consistency(robot: CanRobot) -> dict[str, Any] | None:
    """Whether wires and map agree within the encoders' noise at the end, and by how much not."""
    found = robot.agent.estimator.consistency
    if found is None:
        return None
    return {
        "consistent": found.consistent,
        "nis": round(found.value, 1),
        "band": [round(found.low, 1), round(found.high, 1)],
    }


def _curves(robot: CanRobot) -> dict[str, Any]:
    """What the figures show, in the units in which people read: s, deg, N, mm."""
    session = robot.session
    if session is None:
        raise RuntimeError("the trial has not run")
    log, agent = session.log, robot.agent
    thin = max(1, round(LOG_PERIOD / (log.time[1] - log.time[0])))
    joints = agent.map.joints
    groups = {name: [joints.index(joint) for joint in own] for name, own in GROUP_JOINTS.items()}
    looks = np.degrees(log.look_error).reshape(-1, len(joints))
    true = np.degrees(np.array(log.estimate) - np.array(log.true))[::thin]
    pitch = np.radians(np.arange(-120.0, 31.0, 2.0))
    postures = np.zeros((len(pitch), len(joints)))
    postures[:, joints.index("sh_pitch")] = pitch
    shoulder = next(group for group in agent.map.groups if group.name == "shoulder")
    return {
        "time": np.round(log.time[::thin], 2).tolist(),
        "tensions": np.round(log.tensions[::thin], 1).tolist(),
        "true_error": np.round(np.sqrt(np.mean(true**2, axis=1)), 2).tolist(),
        "look_time": np.round(log.look_time, 2).tolist(),
        "look_error": {
            name: np.round(np.sqrt(np.mean(looks[:, own] ** 2, axis=1)), 2).tolist()
            for name, own in {"all": list(range(len(joints))), **groups}.items()
        },
        "approach_start": [round(approach.start, 2) for approach in robot.trial.approaches],
        "pitch": np.degrees(pitch).tolist(),
        "muscles": [agent.map.muscles[i] for i in shoulder.muscle_index],
        "lengths_before": _shoulder_lengths(robot.before, postures, shoulder.muscle_index),
        "lengths_after": _shoulder_lengths(agent.map, postures, shoulder.muscle_index),
    }


def _shoulder_lengths(jmm: Any, postures: np.ndarray, muscles: np.ndarray) -> list[list[float]]:
    lengths: list[list[float]] = np.round(1e3 * jmm.lengths(postures)[:, muscles], 2).tolist()
    return lengths

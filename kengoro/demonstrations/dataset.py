"""Both data sets of some robots, made robot by robot so that a stopped command goes on."""

from __future__ import annotations

import json
import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path

from kengoro.demonstrations.damage import damaged
from kengoro.demonstrations.episode import frame_stride
from kengoro.demonstrations.frames import count_frames, open_frames
from kengoro.demonstrations.lerobot import video_path, write_lerobot
from kengoro.demonstrations.minari import NAME, write_minari
from kengoro.demonstrations.robot import FIXED_TIMES, episode_seed, grasps, learned_agent, no_stage
from kengoro.demonstrations.robot_file import RobotEpisodes, read_robot, write_robot
from kengoro.errors import UsageError
from kengoro.hand_search import TrialOptions
from kengoro.output_folder import make_folder
from kengoro.robots import make_env
from kengoro_env.env import KengoroEnv
from kengoro_env.robot.control_period import CONTROL_PERIOD
from mjcf_sandbox.files import check_folder, remove_parts, write_json
from mjcf_sandbox.parent_watchdog import end_with_parent

Progress = Callable[[str, float], None]
"""Called with what is done, and by how many episodes it has advanced."""

FOLDERS = ("robots", "lerobot/data", "lerobot/meta/episodes", f"minari/{NAME}/data")
"""Folders of the files that are written."""


@dataclass(frozen=True)
class Plan:
    """What a data set holds.

    Attributes:
        robots: seeds of the actual robots.
        episodes: number of episodes of each robot.
        trial: durations and sizes of the trial in which each robot learns, and of its movements.
    """

    robots: tuple[int, ...]
    episodes: int
    trial: TrialOptions = FIXED_TIMES


def make_datasets(
    plan: Plan, out: Path, progress: Progress, jobs: int = 1, cache: Path | None = None
) -> list[RobotEpisodes]:
    """Run the missing robots and write both data sets.

    Args:
        plan: what the data sets hold.
        out: folder, which gets the folders ``lerobot``, ``minari`` and ``robots``.
        progress: called after each episode, with one job, or after each robot.
        jobs: number of processes; the result does not depend on it.
        cache: folder of trained maps.

    Returns:
        What the robots did.

    Raises:
        UsageError: the folder holds other data, or a robot's file that cannot be used; all that
            exist are read before another robot learns.
        OutputError: a file is where a folder belongs.
    """
    claim(out, plan)
    _remove_parts(out)
    positions = range(len(plan.robots))
    there = {i: read_done(plan, out, i) for i in positions if _is_done(plan, out, i)}
    for position in there:
        progress(f"robot {plan.robots[position]} was there", plan.episodes)
    missing = [i for i in positions if i not in there]
    _run(plan, out, missing, progress, jobs, cache)
    there |= {i: read_done(plan, out, i) for i in missing}
    found = [there[i] for i in positions]
    env = make_env("CanGrasp", None)
    world = env.unwrapped
    assert isinstance(world, KengoroEnv)
    write_lerobot(out / "lerobot", world.muscles, found)
    write_minari(out / "minari", world.observation_space, world.action_space, found)  # type: ignore[arg-type]
    env.close()
    return found


def claim(out: Path, plan: Plan) -> None:
    """Note in the folder what it is for, and make its folders; refuse one that is for other data.

    Raises:
        UsageError: the folder holds other data, or one in it cannot be made or written to.
        OutputError: a file is where a folder belongs.
    """
    folders = (out, *(out / name for name in FOLDERS), video_path(out / "lerobot", 0).parent)
    for folder in folders:
        check_folder(folder)
    path = out / "dataset.json"
    wanted = json.loads(json.dumps(asdict(plan)))
    if path.exists():
        try:
            stored = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise UsageError(f"{path} is damaged; choose another folder.") from error
        if stored != wanted:
            raise UsageError(f"{out} holds other robots or episodes; choose another folder.")
    elif out.exists() and any(out.iterdir()):
        raise UsageError(f"{out} is not empty, and holds no data set; choose another folder.")
    make_folder(out)
    write_json(path, wanted)
    for folder in folders:
        make_folder(folder)


def robot_path(out: Path, robot: int) -> Path:
    """Path of the file with a robot's episodes."""
    return out / "robots" / f"{robot:03d}.npz"


def run_robot(
    plan: Plan,
    out: Path,
    position: int,
    cache: Path | None = None,
    progress: Progress | None = None,
) -> None:
    """Let one robot learn and grasp; writes its video, and then its episodes."""
    robot = plan.robots[position]

    def stage(text: str) -> None:
        if progress is not None:
            progress(f"robot {robot} {text}", 0)

    agent = learned_agent(robot, plan.trial, cache, no_stage if progress is None else stage)
    seeds = [episode_seed(robot, number) for number in range(plan.episodes)]
    episodes, histograms = [], []
    with open_frames(video_path(out / "lerobot", position)) as video:
        for episode in grasps(agent, robot, seeds, plan.trial, video.add):
            episodes.append(episode)
            histograms.append(video.pop_histogram())
            if progress is not None:
                progress(f"robot {robot} grasps", 1)
    agent.close()
    found = RobotEpisodes(robot, tuple(episodes), tuple(histograms))
    write_robot(robot_path(out, robot), found)


def _run(
    plan: Plan, out: Path, missing: Sequence[int], progress: Progress, jobs: int, cache: Path | None
) -> None:
    if jobs == 1 or len(missing) < 2:
        for position in missing:
            run_robot(plan, out, position, cache, progress)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(jobs, len(missing)), context, end_with_parent) as pool:
        futures = {pool.submit(run_robot, plan, out, one, cache): one for one in missing}
        for future in as_completed(futures):
            future.result()
            progress(f"robot {plan.robots[futures[future]]} is done", plan.episodes)


def _is_done(plan: Plan, out: Path, position: int) -> bool:
    files = (robot_path(out, plan.robots[position]), video_path(out / "lerobot", position))
    return all(path.exists() for path in files)


def read_done(plan: Plan, out: Path, position: int) -> RobotEpisodes:
    """What a robot did, from its file; its video is checked to hold a frame for each row.

    Raises:
        UsageError: one of both is damaged, or is not that of the plan.
    """
    robot = plan.robots[position]
    found = read_robot(robot_path(out, robot), robot, plan.episodes)
    stride = frame_stride(CONTROL_PERIOD)
    wanted = sum(-(-len(episode) // stride) for episode in found.episodes)
    video = video_path(out / "lerobot", position)
    if (count := count_frames(video)) != wanted:
        raise damaged(video, f"holds another number of frames: {count}, not {wanted}")
    return found


def _remove_parts(out: Path) -> None:
    for folder in _folders(out):
        remove_parts(folder)


def _folders(out: Path) -> Iterator[Path]:
    yield out
    yield from (path for path in out.rglob("*") if path.is_dir())

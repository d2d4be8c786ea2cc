"""Time of an environment's step compared with MuJoCo's own steps, for nominal and actual robot.

Both compute the same physics: "raw" is `mj_step` with the same number of substeps and the same
commands. The rounds of both alternate. The times are medians of the CPU time of one thread, which
other programs change little; with the camera, which draws on all cores, of the wall-clock time.
"ratio" and "added" are medians over pairs of neighbouring rounds, because the clock rate of a core
varies.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

from collections.abc import Callable
from time import perf_counter, thread_time

import gymnasium as gym
import mujoco
import numpy as np
from rich.console import Console
from rich.table import Table

from jmm_agent.types import Floats
from kengoro_env.env import KengoroEnv
from kengoro_env.robot.control_period import CONTROL_PERIOD
from kengoro_env.stepping.c_compiler import library

IDS = ("Kengoro/Elbow-v0", "Kengoro/Posture-v0", "Kengoro/CanGrasp-v0")
ROBOTS = (None, 0)
ROUNDS, STEPS = 25, 40
"""Rounds, and control steps of a round."""


def rounds_us(env: KengoroEnv, clock: Callable[[], float]) -> tuple[Floats, Floats]:
    """Time of an `env.step` and of the same physics alone in each round, by a clock [us]."""
    model, data = env.robot.model, env.robot.data
    substeps = round(CONTROL_PERIOD / model.opt.timestep)
    stepped, raw = [], []
    for seed in range(ROUNDS):
        observation, _ = env.reset(seed=seed)
        action = env.lengths_to_action(observation["lengths"])
        env.step(action)
        start = clock()
        for _ in range(STEPS):
            env.step(action)
        stepped.append(clock() - start)
        env.reset(seed=seed)
        env.step(action)
        start = clock()
        for _ in range(STEPS):
            mujoco.mj_step(model, data, substeps)
        raw.append(clock() - start)
    return 1e6 * np.array(stepped) / STEPS, 1e6 * np.array(raw) / STEPS


def main() -> None:
    """Print the table."""
    code = "NumPy" if library() is None else "compiled code"
    table = Table(title=f"One control step of {1e3 * CONTROL_PERIOD:.0f} ms, {code} [us]")
    for column in ("environment", "robot", "raw", "step", "ratio", "added", "step with camera"):
        table.add_column(column, justify="left" if column in ("environment", "robot") else "right")
    for env_id in IDS:
        for seed in ROBOTS:
            env = gym.make(env_id, robot_seed=seed, camera=False).unwrapped
            assert isinstance(env, KengoroEnv)
            stepped, raw = rounds_us(env, thread_time)
            camera_time = "-"
            if "Elbow" not in env_id:
                with_camera = gym.make(env_id, robot_seed=seed, camera=True).unwrapped
                assert isinstance(with_camera, KengoroEnv)
                camera_time = f"{np.median(rounds_us(with_camera, perf_counter)[0]):.0f}"
                with_camera.close()
            table.add_row(
                env_id,
                "nominal" if seed is None else f"actual({seed})",
                f"{np.median(raw):.0f}",
                f"{np.median(stepped):.0f}",
                f"{np.median(stepped / raw):.3f}",
                f"{np.median(stepped - raw):.1f}",
                camera_time,
            )
    Console().print(table)


if __name__ == "__main__":
    main()

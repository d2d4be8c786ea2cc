"""Time of a step of many environments compared with loops of `mj_step`, one loop per core.

Both compute the same physics on as many threads as there are cores: "raw" steps the same robots
from the same states with the same commands. Medians of alternating rounds, without a camera.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from time import perf_counter

import gymnasium as gym
import mujoco
import numpy as np
from rich.console import Console
from rich.table import Table

from kengoro_env.robot.control_period import CONTROL_PERIOD
from kengoro_env.stepping.choice import cores
from kengoro_env.vector import KengoroVectorEnv

IDS = ("Kengoro/Elbow-v0", "Kengoro/Posture-v0", "Kengoro/CanGrasp-v0")
ROBOTS = (None, 0)
COUNTS = (1, 2, 4, 8, 64, 256)
"""Numbers of environments."""

ROUNDS, STEPS = 25, 20
"""Rounds, and control steps of a round."""


def medians_us(env: KengoroVectorEnv) -> tuple[float, float]:
    """Median times of one environment's step among many, and of its physics alone [us]."""
    substeps = round(CONTROL_PERIOD / env.fleet.parts(0)[0].opt.timestep)
    actions = np.zeros(env.action_space.shape or (), dtype=np.float32)
    stepped, raw = [], []
    workers = cores()
    with ThreadPoolExecutor(workers) as pool:
        for seed in range(ROUNDS):
            env.reset(seed=seed)
            env.step(actions)
            robots = [env.fleet.parts(i) for i in range(env.num_envs)]
            start = perf_counter()
            for _ in range(STEPS):
                env.step(actions)
            stepped.append(perf_counter() - start)

            def loop(own: Sequence[tuple[mujoco.MjModel, mujoco.MjData]]) -> None:
                for _ in range(STEPS):
                    for model, data in own:
                        mujoco.mj_step(model, data, substeps)

            start = perf_counter()
            list(pool.map(loop, [robots[k::workers] for k in range(workers)]))
            raw.append(perf_counter() - start)
    each = 1e6 / (STEPS * env.num_envs)
    return each * float(np.median(stepped)), each * float(np.median(raw))


def main() -> None:
    """Print the table."""
    table = Table(title=f"Control step, time per environment on {cores()} cores [us]")
    for column in ("environment", "robot", "environments", "raw", "step", "rate / raw rate"):
        table.add_column(column, justify="left" if column in ("environment", "robot") else "right")
    for env_id in IDS:
        for seed in ROBOTS:
            for count in COUNTS:
                env = gym.make_vec(env_id, count, robot_seed=seed)
                assert isinstance(env, KengoroVectorEnv)
                stepped, raw = medians_us(env)
                robot = "nominal" if seed is None else f"actual({seed})"
                row = (env_id, robot, f"{count}", f"{raw:.0f}", f"{stepped:.0f}")
                table.add_row(*row, f"{raw / stepped:.2f}")
                env.close()
    Console().print(table)


if __name__ == "__main__":
    main()

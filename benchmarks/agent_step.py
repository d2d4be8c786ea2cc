"""Time of a control step of the agent in minutes of learning, and of its parts.

The agent moves the hand of an actual robot in front of the camera and learns with both updaters and
a guard. Each control step is timed: by the CPU time of the control loop's thread, and by the wall
clock, which other programs prolong. Steps come in real time, every 20 ms, so that learning beside
the loop has the time that it has on a robot. Must: no step takes more than 5 ms of CPU, and at the
99.9th percentile none takes more than 5 ms of the wall clock (on an idle machine).

`python -m benchmarks agent_step [--minutes 10] [--where process] [--unpaced] [--parts]`
"""

from __future__ import annotations

import os
import sys

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import threading
import time
from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter, thread_time

import cv2
import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks._agent_step_parts import parts_table
from jmm_agent.agent import Agent
from jmm_agent.driving.short_pauses import short_pauses
from jmm_agent.learning.options import BESIDE, LearningOptions
from jmm_agent.observation import SensorReadings
from jmm_agent.options import AgentOptions
from jmm_agent.types import Floats
from jmm_agent.updaters import VisionOptions
from jmm_agent.vision.hold_out import HoldOutOptions
from kengoro.agents import make_agent
from kengoro.hand_search import READY
from kengoro.robots import make_env
from kengoro.session import Session
from kengoro_env.postures import posture_set

SEED = 1
"""Seed of the robot, the agent and the postures."""

PERIOD = 0.02
"""Time between two control steps [s]."""

MOST = 5e-3
"""Longest control step [s]."""

PERCENTILE = 99.9
"""Percentile of the wall times that must be below `MOST`."""


class TimedAgent:
    """Agent whose control steps are timed.

    Args:
        agent: all other attributes are its attributes.
        paced: whether steps wait until they are due in real time.

    Attributes:
        wall: wall times of the steps [s].
        cpu: CPU times of the steps [s].
        learned: number of marker observations that were learned from, after each step.
    """

    OWN = ("_agent", "_paced", "_begin", "wall", "cpu", "learned")

    def __init__(self, agent: Agent, paced: bool) -> None:
        self._agent, self._paced = agent, paced
        self._begin = perf_counter()
        self.wall: list[float] = []
        self.cpu: list[float] = []
        self.learned: list[int] = []

    def __getattr__(self, name: str) -> object:
        return getattr(self._agent, name)

    def __setattr__(self, name: str, value: object) -> None:
        object.__setattr__(self if name in self.OWN else self._agent, name, value)

    def step(self, readings: SensorReadings) -> Floats:
        """Call `Agent.step` and record its times."""
        if self._paced:
            time.sleep(max(self._begin + PERIOD * len(self.wall) - perf_counter(), 0.0))
        begin, cpu_begin = perf_counter(), thread_time()
        lengths = self._agent.step(readings)
        self.cpu.append(thread_time() - cpu_begin)
        self.wall.append(perf_counter() - begin)
        self.learned.append(self._agent.vision.fired)
        return lengths


def learn(minutes: float, learning: LearningOptions, paced: bool) -> tuple[Agent, TimedAgent]:
    """Let an agent learn; return it, and the times of its steps.

    Args:
        minutes: of simulated time.
        learning: where it learns.
        paced: whether steps come in real time.
    """
    options = AgentOptions(vision=VisionOptions(hold_out=HoldOutOptions()), learning=learning)
    agent = make_agent(SEED, guard=True, options=options)
    env = make_env("CanGrasp", SEED, max_episode_steps=10**9)
    timer = TimedAgent(agent, paced)
    session = Session(env, timer, SEED, None, {"posture": np.array(READY)})  # type: ignore[arg-type]
    rng = np.random.default_rng(SEED)
    with short_pauses():  # as `drive` does
        while session.time < 60.0 * minutes:
            session.move(rng.choice(posture_set()), 2.0, 2.0)
            session.world.put_can_back()
    env.close()
    return agent, timer


def cpu_of_process(number: int | None) -> float:
    """CPU time that a process has used [s]; NaN where the system does not tell."""
    try:
        fields = Path(f"/proc/{number}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError):
        return float("nan")


def cpu_of_thread(name: str) -> float:
    """CPU time that a thread of this process has used [s]; NaN if there is none."""
    for thread in threading.enumerate():
        if thread.name == name and thread.ident is not None:
            return time.clock_gettime(time.pthread_getcpuclockid(thread.ident))
    return float("nan")


def steps_table(timer: TimedAgent, minutes: float) -> Table:
    """Times of the control steps, in all and in tenths of the time."""
    table = Table(title="Control step [ms]")
    columns = (
        "minutes",
        "learned from",
        "CPU median",
        "CPU worst",
        "wall 99 %",
        "wall 99.9 %",
        "wall worst",
    )
    for column in columns:
        table.add_column(column, justify="right")
    cpu, wall = 1e3 * np.array(timer.cpu), 1e3 * np.array(timer.wall)

    def row(name: str, part: slice) -> None:
        figures = (
            np.median(cpu[part]),
            cpu[part].max(),
            *np.percentile(wall[part], (99.0, PERCENTILE)),
            wall[part].max(),
        )
        learned = str(timer.learned[part][-1])
        table.add_row(name, learned, *(f"{figure:.2f}" for figure in figures))

    edges = np.linspace(0, len(cpu), 11).astype(int)
    for tenth in range(10):
        name = f"{minutes * tenth / 10:.1f} to {minutes * (tenth + 1) / 10:.1f}"
        row(name, slice(edges[tenth], edges[tenth + 1]))
    row("all", slice(0, len(cpu)))
    return table


def main(arguments: Sequence[str] = ()) -> None:
    """Print the tables.

    Args:
        arguments: of the command line, see the module docstring.
    """
    parser = ArgumentParser("python -m benchmarks agent_step")
    parser.add_argument("--minutes", type=float, default=1.0, help="of learning")
    parser.add_argument("--where", choices=("process", "step"), default="process")
    parser.add_argument("--unpaced", action="store_true", help="do not wait for the robot's time")
    parser.add_argument("--parts", action="store_true", help="time the parts, too")
    args = parser.parse_args(arguments)
    cv2.setNumThreads(1)
    learning = BESIDE if args.where == "process" else LearningOptions()
    begin, load = perf_counter(), os.getloadavg()[0]
    agent, timer = learn(args.minutes, learning, not args.unpaced)
    took = perf_counter() - begin
    console = Console()
    console.print(steps_table(timer, args.minutes))
    beside = cpu_of_process(agent.learning_process), cpu_of_thread("hand detection")
    console.print(
        f"{len(timer.cpu)} steps in {took:.0f} s; CPU beside the loop: {beside[0]:.1f} s in the "
        f"process, {beside[1]:.1f} s in the thread; not learned from: {agent.vision.dropped}; "
        f"load of the machine {load:.1f} before and {os.getloadavg()[0]:.1f} after."
    )
    agent.close()
    worst, late = max(timer.cpu), float(np.percentile(timer.wall, PERCENTILE))
    for name, value in (("CPU, worst step", worst), (f"wall clock, {PERCENTILE} %", late)):
        verdict = "reached" if value <= MOST else "not reached"
        console.print(f"{name}: {1e3 * value:.2f} ms; must {1e3 * MOST:.0f} ms: {verdict}.")
    if args.parts:
        console.print(parts_table(agent, SEED))


if __name__ == "__main__":
    main(sys.argv[1:])

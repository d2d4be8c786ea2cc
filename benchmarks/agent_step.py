"""Time of a control step of the agent in CanGrasp with the camera, and of its parts.

The agent moves the hand of an actual robot in front of the camera and learns with both updaters, on
one core. Target: 1 ms in the median and 4 ms in the 99th percentile; the control period is 20 ms.
The CPU time is shown as well as the wall-clock time, which other programs prolong.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections.abc import Callable
from time import perf_counter, thread_time

import numpy as np
from rich.console import Console
from rich.table import Table

from jmm_agent.agent import Agent
from jmm_agent.mapping.prior import MapPrior, PriorOptions
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats
from jmm_agent.vision.marker_residual import MarkerResidual
from jmm_agent.vision.observation_fit import (
    MarkerObservation,
    ObservationFitOptions,
    fit_observations,
)
from kengoro.agents import make_agent
from kengoro.hand_search import READY
from kengoro.robots import make_env
from kengoro.session import Session
from kengoro.trained_maps import trained_map
from kengoro_env.assets import asset_path
from kengoro_env.departures import actual
from kengoro_env.postures import posture_set
from kengoro_env.robot.draft import Departure
from kengoro_env.robot.robot import Robot

SEED = 1
"""Seed of the robot, the agent and the postures."""

POSTURES = 20
"""Postures of the episode."""

OBSERVATIONS = (5, 27, 60)
"""Numbers of marker observations in a fit."""

REPEATS = 200
"""Timed calls of each part."""

ARM = "mjcf/kengoro_arm/arm.xml"


class TimedAgent:
    """Agent whose control steps are timed.

    Args:
        agent: all other attributes are its attributes.

    Attributes:
        unchanged: times of the steps in which the map stayed the same [s].
        updated: times of the steps in which an updater changed the map [s].
        cpu: CPU times of all steps [s].
    """

    def __init__(self, agent: Agent) -> None:
        self._agent = agent
        self.unchanged: list[float] = []
        self.updated: list[float] = []
        self.cpu: list[float] = []

    def __getattr__(self, name: str) -> object:
        return getattr(self._agent, name)

    def __setattr__(self, name: str, value: object) -> None:
        own = name in ("_agent", "unchanged", "updated", "cpu")
        object.__setattr__(self if own else self._agent, name, value)

    def step(self, readings: SensorReadings) -> Floats:
        """Call `Agent.step` and record its time."""
        before = self._agent.map
        begin, cpu_begin = perf_counter(), thread_time()
        lengths = self._agent.step(readings)
        self.cpu.append(thread_time() - cpu_begin)
        seconds = perf_counter() - begin
        (self.unchanged if self._agent.map is before else self.updated).append(seconds)
        return lengths


def times_of(work: Callable[[], object], repeats: int) -> list[float]:
    """Times of repeated calls [s]; one more call before them is not counted."""
    work()
    times = []
    for _ in range(repeats):
        begin = perf_counter()
        work()
        times.append(perf_counter() - begin)
    return times


def episode() -> tuple[Agent, TimedAgent]:
    """Run `POSTURES` postures of CanGrasp; return the agent, and the times of its steps."""
    agent = make_agent(SEED)
    timer = TimedAgent(agent)
    env = make_env("CanGrasp", SEED)
    session = Session(env, timer, SEED, None, {"posture": np.array(READY)})  # type: ignore[arg-type]
    order = np.random.default_rng(SEED).permutation(len(posture_set()))
    for posture in posture_set()[order[:POSTURES]]:
        session.move(posture, 2.0, 2.0)
        session.world.put_can_back()
    env.close()
    return agent, timer


def observations_of(agent: Agent, count: int) -> list[MarkerObservation]:
    """Marker observations of the actual robot at rest, with measured lengths and true poses."""
    departures: tuple[Departure, ...] = actual(SEED)
    robot = Robot(asset_path(ARM), departures)
    rng = np.random.default_rng(SEED)
    observations = []
    for posture in posture_set()[rng.permutation(len(posture_set()))[:count]]:
        robot.reset(posture, rng)
        pose = agent.kinematics.pose("marker_hand", robot.joint_angles, relative_to="eye")
        agent.estimator.reset(posture)
        for _ in range(50):
            agent.estimator.update(robot.measured_lengths(), 0.02)
        observations.append(MarkerObservation(pose, robot.measured_lengths(), agent.joint_angles))
    return observations


def main() -> None:
    """Print the table."""
    agent, timer = episode()
    table = Table(title="Agent on one core: times [ms]")
    for column in ("part", "calls", "median", "99th percentile", "largest"):
        table.add_column(column, justify="left" if column == "part" else "right")

    def row(part: str, seconds: list[float]) -> None:
        figures = (np.median(seconds), np.percentile(seconds, 99), np.max(seconds))
        table.add_row(part, f"{len(seconds)}", *(f"{1e3 * figure:.2f}" for figure in figures))

    row("control step", timer.unchanged + timer.updated)
    row("  CPU time", timer.cpu)
    row("  without update", timer.unchanged)
    row("  with update", timer.updated)
    q = agent.joint_angles
    lengths = agent.map.lengths(q)
    row("EKF update", times_of(lambda: agent.estimator.update(lengths, 0.02), REPEATS))
    row("map, lengths", times_of(lambda: agent.map.lengths(q), REPEATS))
    row("map, with Jacobian", times_of(lambda: agent.map.lengths_and_jacobian(q), REPEATS))
    prior = MapPrior(trained_map(), posture_set(), PriorOptions())
    marker_residual = MarkerResidual(agent.kinematics, "eye", "marker_hand")
    row("marker residual", times_of(lambda: marker_residual(q, np.eye(4)), REPEATS))
    agent = make_agent(SEED)
    limits, options = agent.kinematics.limits, ObservationFitOptions()
    observations = observations_of(agent, max(OBSERVATIONS))
    for count in OBSERVATIONS:
        earlier = fit_observations(
            observations[: count - 1], prior, marker_residual, limits, options
        ).angles
        start = np.vstack([earlier, observations[count - 1].guess])

        def fit(count: int = count, start: Floats = start) -> object:
            return fit_observations(
                observations[:count], prior, marker_residual, limits, options, start
            )

        row(f"fit of {count} observations", times_of(fit, 3))
    Console().print(table)


if __name__ == "__main__":
    main()

"""Times of the parts of a control step, and of the fits of marker observations."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

import numpy as np
from rich.table import Table

from jmm_agent.agent import Agent
from jmm_agent.mapping.prior import MapPrior, PriorOptions
from jmm_agent.types import Floats
from jmm_agent.updaters import VisionOptions
from jmm_agent.updaters.rest_fitter import FittedRests, RestFitter, RestMemory
from jmm_agent.vision.incremental_fit import fit_incrementally
from jmm_agent.vision.marker_residual import MarkerResidual
from jmm_agent.vision.observation_fit import (
    MarkerObservation,
    ObservationFitOptions,
    fit_observations,
)
from kengoro.agents import make_agent
from kengoro.trained_maps import trained_map
from kengoro_env.assets import asset_path
from kengoro_env.departures import actual
from kengoro_env.postures import posture_set
from kengoro_env.robot.draft import Departure
from kengoro_env.robot.nominal_model import NominalArm
from kengoro_env.robot.robot import Robot

OBSERVATIONS = (5, 27, 60)
"""Numbers of marker observations in a fit."""
REPEATS = 200
"""Timed calls of each part."""
ARM = "mjcf/kengoro_arm/arm.xml"


def times_of(work: Callable[[], object], repeats: int) -> list[float]:
    """Times of repeated calls [s]; one more call before them is not counted."""
    work()
    times = []
    for _ in range(repeats):
        begin = perf_counter()
        work()
        times.append(perf_counter() - begin)
    return times


def observations_of(agent: Agent, seed: int, count: int) -> list[MarkerObservation]:
    """Marker observations of the actual robot at rest, with measured lengths and true poses."""
    departures: tuple[Departure, ...] = actual(seed)
    robot = Robot(asset_path(ARM), departures)
    rng = np.random.default_rng(seed)
    observations = []
    for posture in posture_set()[rng.permutation(len(posture_set()))[:count]]:
        robot.reset(posture, rng)
        pose = agent.kinematics.pose("marker_hand", robot.joint_angles, relative_to="eye")
        agent.estimator.reset(posture)
        for _ in range(50):
            agent.estimator.update(robot.measured_lengths(), 0.02)
        tensions = robot.measured_tensions()
        observations.append(
            MarkerObservation(pose, robot.measured_lengths(), agent.joint_angles, tensions=tensions)
        )
    return observations


def parts_table(agent: Agent, seed: int) -> Table:
    """Times of the parts of a step and of the fits.

    Args:
        agent: that has learned.
        seed: of the robot whose observations are fitted, and of the agent that fits them.
    """
    table = Table(title="Parts on one core [ms]")
    for column in ("part", "calls", "median", "99th percentile", "largest"):
        table.add_column(column, justify="left" if column == "part" else "right")

    def row(part: str, seconds: list[float]) -> None:
        figures = (np.median(seconds), np.percentile(seconds, 99), np.max(seconds))
        table.add_row(part, f"{len(seconds)}", *(f"{1e3 * figure:.2f}" for figure in figures))

    q = agent.joint_angles
    lengths = agent.map.lengths(q)
    row("EKF update", times_of(lambda: agent.estimator.update(lengths, 0.02), REPEATS))
    row("map, lengths", times_of(lambda: agent.map.lengths(q), REPEATS))
    row("map, with Jacobian", times_of(lambda: agent.map.lengths_and_jacobian(q), REPEATS))
    prior = MapPrior(trained_map(), posture_set(), PriorOptions())
    marker_residual = MarkerResidual(agent.kinematics, "eye", "marker_hand")
    row("marker residual", times_of(lambda: marker_residual(q, np.eye(4)), REPEATS))
    _add_fits(row, make_agent(seed), seed, prior, marker_residual)
    return table


def _add_fits(
    row: Callable[[str, list[float]], None],
    agent: Agent,
    seed: int,
    prior: MapPrior,
    marker_residual: MarkerResidual,
) -> None:
    """Add the times of fits to a table.

    Args:
        row: adds a row with a title and times [s].
        agent: that has not learned.
        seed: of the robot whose observations are fitted.
        prior: of the map's error.
        marker_residual: of the marker's pose at a posture.
    """
    limits, options = agent.kinematics.limits, ObservationFitOptions()
    observations = observations_of(agent, seed, max(OBSERVATIONS))
    fitter = RestFitter(
        prior, marker_residual, limits, VisionOptions(), NominalArm(asset_path(ARM))
    )
    for count in OBSERVATIONS:
        earlier = fit_observations(
            observations[: count - 1], prior, marker_residual, limits, options
        ).angles
        start = np.vstack([earlier, observations[count - 1].guess])

        def fit(count: int = count, start: Floats = start) -> object:
            return fit_observations(
                observations[:count], prior, marker_residual, limits, options, start
            )

        def incremental(count: int = count, start: Floats = start) -> object:
            none = np.zeros((count, len(agent.map.muscles)))
            return fit_incrementally(
                observations[:count], prior, marker_residual, limits, options, start, none
            )

        none = np.zeros((count, len(agent.map.muscles)))
        before = fitter.fit_with_elongation(
            RestMemory(), observations[: count - 1], earlier, none[1:]
        )

        def rests(count: int = count, before: FittedRests = before, none: Floats = none) -> object:
            start = np.vstack([before.observed.angles, observations[count - 1].guess])
            return fitter.fit_with_elongation(before.memory, observations[:count], start, none)

        row(f"{count} observations: rests (default)", times_of(rests, 3))
        row("  together", times_of(fit, 3))
        row("  incremental, with elongations", times_of(incremental, 3))
        _add_forecasts(row, agent, before, observations[:count])


def _add_forecasts(
    row: Callable[[str, list[float]], None],
    agent: Agent,
    before: FittedRests,
    observations: list[MarkerObservation],
) -> None:
    """Add the times of what is expected of the newest observation, and of the next one.

    Args:
        row: adds a row with a title and times [s].
        agent: whose memory is replaced.
        before: fit of all observations but the newest.
        observations: all.
    """
    known, forecast = observations[:-1], agent.vision.forecast
    memory = agent.vision.memory._replace(
        observations=known,
        commands=[found.lengths for found in known],
        sound=[True] * len(known),
        angles=before.observed.angles,
        elongated=before.elongated,
        rests=before.memory,
    )
    agent.vision.memory = memory
    row("  prediction", times_of(lambda: forecast.predict(memory, observations), 3))
    both = agent.nominal_map, agent.map
    row("  expected error of the hand", times_of(lambda: forecast.hand_error(memory, *both), 3))
    row("  planner of the next look", times_of(agent.posture_planner, 3))
    row("  next look, of 48 postures", times_of(lambda: agent.next_posture(posture_set()[:48]), 3))

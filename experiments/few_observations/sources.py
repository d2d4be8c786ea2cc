"""How much each source of information tells of the joint angles of rests.

Ten rests of a robot that is driven by its drawing are fitted by lengths alone, with the balance of
tensions and loads, with three looks at the hand, and with all of them. The fit predicts its own
error, by the inverse of its Gauss-Newton matrix; the true error is beside it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from experiments.robots.world import Body, Sizes, World
from jmm_agent.types import Floats
from jmm_agent.vision.balance import Balance, BalanceOptions
from jmm_agent.vision.marker_observation import MarkerObservation
from jmm_agent.vision.observation_fit import ObservationFitOptions
from jmm_agent.vision.prior_widths import usual_widths
from jmm_agent.vision.rest_fit import Rest, RestProblem, fit_rests
from kengoro_env.departures import actual

RESTS, OBSERVED = 10, 3
"""Numbers of rests, and of those among them in which the hand is seen."""
SOURCES = {
    "lengths": "lengths",
    "balance": "lengths and balance",
    "vision": f"lengths and {OBSERVED} looks",
    "all": f"lengths, balance and {OBSERVED} looks",
}
"""Sources of information, and their titles."""
WIDTH_STEPS = 3
"""Number of fits, each with the widths of the prior that the last one finds likeliest."""
INSIDE = 1.96
"""Standard deviations that hold 95 % of normally distributed errors."""
REGULARISATION = 1e-9
"""Added to the Gauss-Newton matrix, relative to its diagonal."""


def errors_by_source(world: World, seed: int, sizes: Sizes) -> dict[str, Any]:
    """Errors of the joint angles by each source, true and predicted [deg].

    Args:
        world: nominal model.
        seed: of the robot.
        sizes: durations of movement and rest.

    Returns:
        For each of `SOURCES`: the RMS over rests and joints, the same by joint, and the share of
        true errors within the predicted 95 %.
    """
    learned, _ = world.split(seed, sizes)
    body = Body(world, actual(seed), sizes)
    body.reset(learned[0], np.random.default_rng([seed, 3]))
    rests = [body.go(target, world.map) for target in learned[1 : 1 + RESTS]]
    true = np.array([rest.true for rest in rests])
    found = {}
    for name in SOURCES:
        seen = OBSERVED if name in ("vision", "all") else 0
        observations = [
            MarkerObservation(
                world.marker(rest.true), rest.lengths, rest.estimate, tensions=rest.tensions
            )
            for rest in rests[:seen]
        ]
        rested = [Rest(rest.lengths, rest.tensions, rest.estimate) for rest in rests[seen:]]
        angles, spread = _fitted(world, observations, rested, name in ("balance", "all"))
        error = np.degrees(angles - true)
        predicted = np.degrees(spread)
        found[name] = {
            "error_deg": _rms(error),
            "predicted_deg": _rms(predicted),
            "covered": round(float(np.mean(np.abs(error) <= INSIDE * predicted)), 4),
            "error_joints_deg": np.round(np.sqrt(np.mean(error**2, axis=0)), 3).tolist(),
            "predicted_joints_deg": np.round(np.sqrt(np.mean(predicted**2, axis=0)), 3).tolist(),
        }
    return found


def _fitted(
    world: World, observations: list[MarkerObservation], rested: list[Rest], balanced: bool
) -> tuple[Floats, Floats]:
    """Joint angles of all rests (K, n) [rad], and their predicted standard deviations."""
    options = ObservationFitOptions()
    usual = widths = usual_widths(world.prior)
    balance = Balance(world.map, world.arm, world.limits, BalanceOptions())
    guesses = [one.guess for one in observations] + [one.guess for one in rested]
    unknown = np.vstack([*guesses, np.zeros(len(world.limits))])
    for _ in range(WIDTH_STEPS):
        problem = RestProblem(
            observations,
            rested,
            world.prior,
            widths,
            world.marker_residual,
            balance if balanced else None,
            options,
            np.zeros((len(observations), len(world.map.muscles))),
        )
        fit = fit_rests(problem, unknown, world.limits, options, len(observations), usual)
        unknown, widths = np.vstack([fit.observed.angles, fit.rests, fit.zero]), fit.widths
    angles = unknown[:-1]
    matrix = problem.normal_equations(unknown)[0]
    matrix[np.diag_indices_from(matrix)] *= 1.0 + REGULARISATION
    spread = np.sqrt(np.diag(np.linalg.inv(matrix)))[: angles.size].reshape(angles.shape)
    return angles, spread


def _rms(values: Floats) -> float:
    return round(float(np.sqrt(np.mean(values**2))), 4)

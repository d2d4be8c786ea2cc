"""Trial: estimates of one hidden effect in several realisations of a machine, and their bound."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from experiments.estimator_variance.estimate import Slopes, estimate, screen_known
from experiments.estimator_variance.machine import Known, hide_known, right_candidate
from experiments.harness.errors import ExperimentError
from experiments.strangers_bench.trial import NEXT, TRIES, machine, truth
from hidden_plants.strangers.size_bound import size_bound
from reality_gap import Candidate
from reality_gap.simulation.replayer import Replayer


def trial(seed: int, seconds: float, repeats: int) -> dict[str, Any]:
    """Estimate the size of an effect in realisations of the mismatches and the noise.

    Args:
        seed: of the machine and its effect.
        seconds: length of each log [s].
        repeats: number of realisations.

    Returns:
        The machine, the effect, the bound, and the truths, estimates and ends of intervals of all
        realisations, as JSON.

    Raises:
        ExperimentError: the machine shows no effect whose size a cause has as its only parameter.
    """
    with tempfile.TemporaryDirectory() as name:
        known, candidate, parameter = _choose(seed, seconds, Path(name))
        [effect] = known.hidden.secret.effects
        bound = size_bound(known.oracle, effect)
        truths = [known.size(k) for k in range(repeats)]
        found = _estimates(known, candidate, parameter, repeats, Path(name))
    return {
        "seed": seed,
        "machine": machine(known.hidden.stranger),
        **truth(known.hidden.stranger, effect, known.hidden.secret.multiples[0]),
        "cause": candidate.cause.id,
        "location": str(candidate.location),
        "parameter": parameter,
        "unit": candidate.parameters[0].unit,
        "bound": bound.oracle,
        "bound_of_readings": bound.readings,
        "truths": truths,
        "estimates": [one[0] for one in found],
        "low": [one[1] for one in found],
        "high": [one[2] for one in found],
    }


def _choose(seed: int, seconds: float, folder: Path) -> tuple[Known, Candidate, str]:
    """Choose the first effect that one parameter of a cause expresses."""
    for attempt in range(TRIES):
        for known in hide_known(seed + attempt * NEXT, seconds):
            with Replayer(known.study(folder, 0)) as replayer:
                found = right_candidate(replayer.system, known)
            if found is not None:
                return known, *found
    raise ExperimentError(
        f"estimator-variance, seed {seed}: none of the effects that were sampled has a size that "
        "is the only parameter of a cause."
    )


def _estimates(
    known: Known, candidate: Candidate, parameter: str, repeats: int, folder: Path
) -> list[tuple[float, float, float]]:
    """Estimate the parameter in each realisation; returns values and ends of their intervals.

    Slopes are computed once. They do not depend on the readings, unless torques are logged, whose
    replay goes through the measured motion.
    """
    slopes: Slopes | None = None
    found = []
    for number in range(repeats):
        with Replayer(known.study(folder, number)) as replayer:
            if slopes is None or replayer.system.study.inverse:
                slopes = screen_known(replayer, candidate)
            one = estimate(replayer, slopes, parameter)
        found.append((one.value, one.low, one.high))
    return found

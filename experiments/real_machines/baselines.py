"""Baselines of the diagnosis: models with parameters that a person frees, fitted by least squares.

A baseline is fitted to the readings that the diagnosis may fit, too. `fit` starts from several
points, because dry friction makes the misfit rough; `fit_by_mujoco` uses the optimiser of
`mujoco.sysid` as its users would, from the nominal model on.
"""

from __future__ import annotations

import io
import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from experiments.gap_bench.baselines import sysid_installed
from experiments.harness.errors import ExperimentError
from experiments.real_machines.parameters import Free, expand, predict
from jmm_agent.types import Floats
from reality_gap.simulation.inverse_dynamics import ensure_prepared
from reality_gap.study.data import Study
from reality_gap.study.measurements import measured
from reality_gap.study.splits import REPORT, split

PACE = ("armature", "damping", "friction", "bias", "delay")
"""Parameters of PACE (arXiv 2509.06342): rotor inertia, viscous and dry friction and zero of the
encoder of each joint, and one delay."""
PACE_EFFORT = ("armature", "damping", "friction", "delay")
"""The same where efforts are measured, which the zero of an encoder does not change."""
PERSON = ("mass", "damping", "friction", "armature", "gain")
"""Parameters that a person would free first."""
PERSON_EFFORT = ("mass", "damping", "friction", "armature", "offset")
"""The same where efforts are measured; together the standard model of identification."""

STARTS = (0.02, 0.5)
"""Values of all parameters, in their scales, from which fits start."""
DIFFERENCE = 0.02
"""Step of finite differences in scales."""
EVALUATIONS, ITERATIONS = 25, 20
"""Largest number of steps of one fit by scipy, and by `mujoco.sysid`."""
BAD = 1e3
"""Residual of a replay that diverged [noise]."""
INSIDE = 1e-6
"""Least distance of a start from the bounds, in scales."""


@dataclass(frozen=True)
class Baseline:
    """A fitted model.

    Attributes:
        values: parameters by key in SI units; mass and gain are relative errors.
        prediction: readings, shape (n,).
    """

    values: Mapping[str, float]
    prediction: Floats


@dataclass(frozen=True)
class Problem:
    """Least squares in units of the parameters' scales.

    Attributes:
        free: the parameters.
        residual: function of values (p,) that returns the errors (m,) [noise].
        predict: function of values (p,) that returns the parameters and all readings (n,).
    """

    free: Sequence[Free]
    residual: Callable[[Floats], Floats]
    predict: Callable[[Floats], Baseline]

    def bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper bounds, shape (p,) each."""
        low = np.array([one.low / one.scale for one in self.free])
        return low, np.array([one.high / one.scale for one in self.free])

    def jacobian(self, x: Floats) -> Floats:
        """Finite differences at ``x`` (p,), shape (m, p)."""
        here, (_, high) = self.residual(x), self.bounds()
        columns = []
        for k in range(len(x)):
            step = DIFFERENCE if x[k] + DIFFERENCE < high[k] else -DIFFERENCE
            moved = x.copy()
            moved[k] += step
            columns.append((self.residual(moved) - here) / step)
        return np.column_stack(columns)


def fit(study: Study, kinds: Sequence[str], shared: bool = False) -> Baseline:
    """Fit parameters of some kinds to all readings but those of the report split.

    Args:
        study: the study.
        kinds: of the parameters; see `experiments.real_machines.parameters.ACTS_ON`.
        shared: whether all elements of the machine share one parameter of each kind.
    """
    problem = pose(study, kinds, shared)
    low, high = problem.bounds()
    found = [
        least_squares(
            problem.residual,
            np.clip(np.full(len(low), start), low + INSIDE, high - INSIDE),
            problem.jacobian,
            bounds=(low, high),
            max_nfev=EVALUATIONS,
            xtol=1e-4,
            ftol=1e-5,
        )
        for start in STARTS
    ]
    best = min(found, key=lambda one: float(one.cost))
    return problem.predict(best.x)


def require_sysid() -> None:
    """Raise `ExperimentError` unless the extra ``mujoco[sysid]`` is installed."""
    if not sysid_installed():
        raise ExperimentError("The baseline needs mujoco[sysid]: pip install 'mujoco[sysid]'.")


def fit_by_mujoco(study: Study, kinds: Sequence[str], shared: bool = False) -> Baseline:
    """Fit parameters of some kinds by `mujoco.sysid`, from close to the nominal model on.

    Args:
        study: the study.
        kinds: of the parameters; see `experiments.real_machines.parameters.ACTS_ON`.
        shared: whether all elements of the machine share one parameter of each kind.

    Raises:
        ExperimentError: the extra ``mujoco[sysid]`` is not installed.
    """
    require_sysid()
    from mujoco import sysid

    logging.getLogger("absl").setLevel(logging.ERROR)
    problem = pose(study, kinds, shared)
    parameters = sysid.ParameterDict()
    for k, (low, high) in enumerate(zip(*problem.bounds(), strict=True)):
        first = float(np.clip(STARTS[0], low + STARTS[0], high - STARTS[0]))
        parameters.add(sysid.Parameter(f"{k}", first, low, high))

    def residual(x: Floats, _: object) -> tuple[list[Floats], None, None]:
        columns = [problem.residual(values) for values in np.atleast_2d(x.T)]
        return [np.column_stack(columns) if x.ndim > 1 else columns[0]], None, None

    _, found = sysid.optimize(
        parameters,
        residual,
        verbose=False,
        max_iters=ITERATIONS,
        eps=DIFFERENCE,
        output=io.StringIO(),
    )
    return problem.predict(np.ravel(found.x))


def pose(study: Study, kinds: Sequence[str], shared: bool) -> Problem:
    """Pose the least squares problem of a study."""
    study = ensure_prepared(study)
    readings = measured(study)
    use = split(readings) != REPORT
    free = expand(study, kinds, shared)

    def values(x: Floats) -> dict[str, float]:
        return {one.key: float(v * one.scale) for one, v in zip(free, x, strict=True)}

    def residual(x: Floats) -> Floats:
        error = (predict(study, readings, values(x)) - readings.value) / readings.noise
        return np.nan_to_num(error[use], nan=BAD, posinf=BAD, neginf=-BAD)

    def fitted(x: Floats) -> Baseline:
        return Baseline(values(x), predict(study, readings, values(x)))

    return Problem(free, residual, fitted)

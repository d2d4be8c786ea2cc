"""Remainder: what a hypothesis leaves of the gap, and how much of that can be learned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reality_gap.causes.base import Record
from reality_gap.diagnosis import Dependence
from reality_gap.inference.deviations import deviations
from reality_gap.inference.flexible_residual import banks
from reality_gap.inference.gauss_newton import Fit
from reality_gap.inference.learned_residual import Learned, learn_best
from reality_gap.inference.problem import Problem
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.measurements import Measured
from reality_gap.study.splits import FIT, REPORT, split
from reality_gap.study.system import commanded
from reality_gap.types import Bools, Floats

RIDGE = 10.0
"""Strength of the ridge regression on one quantity, in readings."""
LEAST = 0.02
"""Share of a remainder's power from which on a quantity is listed."""
TINY = 1e-9
"""Norm of residuals below which there are none [noise]."""
MOST = 5
"""Largest number of quantities that are listed."""


@dataclass(frozen=True)
class Remainder:
    """What a hypothesis leaves.

    Attributes:
        learned: what the best bank explains of the residual of the hypothesis.
        instead: what the best bank explains of the residual of the nominal model, in place of the
            hypothesis.
        depends_on: single quantities that explain most of the remainder, strongest first.
        before, after: RMS on the report split of the residuals of the nominal model and of the
            hypothesis, without what tolerances explain, in units of noise.
        explained: RMS of what tolerances explain of the hypothesis's residual there [noise].
        deviation: largest deviation by which they explain it [tolerances].
        of_step: RMS there of the error of the time step that extrapolation leaves [noise].
        fits: RMS on the report split of what tolerances leave of the residuals of the nominal model
            and of the hypothesis, with what their deviations cost; see `Deviations` [noise].
        share: RMS over all readings of the residual of the hypothesis over that of the nominal
            model, both without what tolerances explain.
    """

    learned: Learned
    instead: Learned
    depends_on: tuple[Dependence, ...]
    before: float
    after: float
    explained: float = 0.0
    deviation: float = 0.0
    of_step: float = 0.0
    fits: tuple[float, float] = (0.0, 0.0)
    share: float = 1.0


def evaluate_remainder(problem: Problem, fitted: Fit) -> Remainder:
    """Learn what a hypothesis leaves, and learn the whole gap in its place.

    Args:
        problem: what is to be explained.
        fitted: the hypothesis; it may be the nominal model.
    """
    records = problem.replayer.replay(fitted.hypothesis).records
    found = banks(problem.replayer, fitted.hypothesis, records)

    if fitted.is_null:
        # What can be learned is itself correlated: only what it leaves may inflate the noise.
        first = learn_best(problem.uninflated(), fitted.residual, found)
        left = problem.reinflated(fitted.residual - first.prediction)
        learned = instead = learn_best(left, fitted.residual, found)
    else:
        learned = learn_best(problem, fitted.residual, found)
        instead = learn_best(problem, problem.null_residual, found)
    report = split(problem.measured) == REPORT

    def rms(residual: Floats) -> float:
        return float(np.sqrt(np.mean(residual[report] ** 2)))

    before, after = deviations(problem, problem.null_residual, fitted.residual)
    return Remainder(
        learned=learned,
        instead=instead,
        depends_on=dependences(problem.replayer, after.left, records),
        before=rms(before.left),
        after=rms(after.left),
        explained=rms(fitted.residual - after.left),
        deviation=problem.roughness * float(np.abs(after.sizes).max(initial=0.0)),
        of_step=rms(problem.replayer.drift_error / problem.measured.noise),
        fits=(rms(before.left_with_cost), rms(after.left_with_cost)),
        share=float(np.linalg.norm(after.left)) / max(float(np.linalg.norm(before.left)), TINY),
    )


def channel_powers(
    problem: Problem, *residuals: Floats, everywhere: bool = False
) -> tuple[Floats, ...]:
    """Return the mean square of each channel on the report split, without tolerances [noise^2].

    Args:
        problem: what is to be explained.
        residuals: residuals in units of noise, shape (n,) each.
        everywhere: whether all readings are used in place of the report split.

    Returns:
        Power by channel of each residual, shape (c,).
    """
    report = (split(problem.measured) == REPORT) | everywhere
    channel, count = problem.measured.channel[report], len(problem.system.study.channels)
    readings = np.maximum(np.bincount(channel, minlength=count), 1)

    def power(left: Floats) -> Floats:
        square = np.bincount(channel, left[report] ** 2, minlength=count)
        return np.asarray(square / readings)

    return tuple(power(one.left) for one in deviations(problem, *residuals))


def dependences(
    replayer: Replayer, remainder: Floats, records: Sequence[Record]
) -> tuple[Dependence, ...]:
    """Return what single quantities explain of a remainder on the report split.

    Args:
        replayer: replays of the study.
        remainder: residual in units of noise, shape (n,).
        records: simulated signals of each episode.

    Returns:
        At most `MOST` quantities, the strongest first.
    """
    measured, names = replayer.measured, [c.name for c in replayer.system.study.channels]
    role = split(measured)
    report = role == REPORT
    power = float(np.sum(remainder[report] ** 2)) or 1.0
    found = []
    for name, features in _quantities(records, measured):
        prediction = np.zeros(len(remainder))
        for channel in np.unique(measured.channel):
            at = np.flatnonzero(measured.channel == channel)
            prediction[at] = _regress(remainder[at], features[at], role[at] == FIT)
        decrease = remainder**2 - (remainder - prediction) ** 2
        share = float(np.sum(decrease[report])) / power
        if share > LEAST:
            sums = np.bincount(measured.channel[report], decrease[report], minlength=len(names))
            found.append(Dependence(name, names[int(np.argmax(sums))], share))
    return tuple(sorted(found, key=lambda d: -d.fraction)[:MOST])


def _regress(value: Floats, features: Floats, fit: Bools) -> Floats:
    """Predict all values (n,) by a ridge regression on features (n, k) of those in ``fit``."""
    x = np.hstack([np.ones((len(features), 1)), features])
    gram = x[fit].T @ x[fit] + RIDGE * np.eye(x.shape[1])
    return x @ np.linalg.solve(gram, x[fit].T @ value[fit])


def _quantities(records: Sequence[Record], measured: Measured) -> list[tuple[str, Floats]]:
    """Return name and features (n, k) of each simulated quantity at the times of all readings."""
    model = records[0].model
    found = []
    for j in range(model.njnt):
        name, at, dof = model.joint(j).name, model.jnt_qposadr[j], model.jnt_dofadr[j]
        position = _sample([r.qpos[:, at] for r in records], records, measured)
        velocity = _sample([r.qvel[:, dof] for r in records], records, measured)
        slow = np.quantile(np.abs(velocity), 0.3) + 1e-9
        found.append((f"position of {name}", _powers(position)))
        found.append((f"velocity of {name}", _powers(velocity)))
        found.append((f"direction of {name}", np.tanh(velocity / slow)[:, None]))
    for i in commanded(model):
        force = _sample([r.force[:, i] for r in records], records, measured)
        found.append((f"force of {model.actuator(i).name}", _powers(force)))
    start = np.array([record.time[0] for record in records])
    time = measured.time + start[measured.episode]
    centres = np.arange(0.0, time.max() + 0.5, 0.5)
    found.append(("time", np.exp(-0.5 * ((time[:, None] - centres) / 0.3) ** 2)))
    return found


def _powers(values: Floats) -> Floats:
    """Return the first three powers of standardised values, shape (n, 3)."""
    x = (values - values.mean()) / (values.std() + 1e-12)
    return np.column_stack([x, x**2, x**3])


def _sample(columns: list[Floats], records: Sequence[Record], measured: Measured) -> Floats:
    """Return a signal, given by episode, at the times of all readings, shape (n,)."""
    values = np.zeros(len(measured.time))
    for e, (column, record) in enumerate(zip(columns, records, strict=True)):
        at = measured.episode == e
        values[at] = np.interp(measured.time[at] + record.time[0], record.time, column)
    return values

"""What a hypothesis leaves, how much of it could be learned, and what it depends on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reality_gap.causes.base import Record
from reality_gap.diagnosis import Dependence
from reality_gap.inference.flexible_residual import Bank, Learned, banks, learn
from reality_gap.inference.likelihood import NoiseModel
from reality_gap.inference.whitening import tolerated
from reality_gap.simulation.replayer import Hypothesis, Replayer
from reality_gap.study.measurements import Measured
from reality_gap.study.splits import CHOOSE, FIT, REPORT, split
from reality_gap.study.system import commanded
from reality_gap.types import Floats

RIDGE = 10.0
"""Strength of the regression on one quantity, in readings."""
LEAST = 0.02
"""Share of a remainder's power that is worth telling."""


@dataclass(frozen=True)
class Remainder:
    """What a hypothesis leaves.

    Attributes:
        learned: of what it leaves, by the bank that explains most.
        instead: of the whole gap, by the bank that explains most without any named cause.
        depends_on: single quantities that explain most of what it leaves, strongest first.
        before, after: RMS of the null's residual and of the hypothesis' on the report split,
            without what tolerances make of them [noise].
    """

    learned: Learned
    instead: Learned
    depends_on: tuple[Dependence, ...]
    before: float
    after: float


def examine(
    replayer: Replayer, rule: NoiseModel, hypothesis: Hypothesis, residual: Floats, null: Floats
) -> Remainder:
    """Learn what the residual (n,) of a hypothesis leaves, and the null's (n,) beside it."""
    records = replayer.look(hypothesis).records
    found: tuple[Bank, ...] = banks(replayer, hypothesis, records)
    learned = max((learn(replayer, rule, residual, b) for b in found), key=lambda x: x.evidence)
    instead = learned
    if hypothesis:
        instead = max((learn(replayer, rule, null, b) for b in found), key=lambda x: x.evidence)
    role, ones = split(replayer.measured), np.ones(len(residual))

    def left(found: Floats) -> Floats:
        return found - tolerated(rule.tolerances, ones, role <= CHOOSE, found)

    def rms(found: Floats) -> float:
        return float(np.sqrt(np.mean(found[role == REPORT] ** 2)))

    before, after = left(null), left(residual)
    depends_on = dependences(replayer, after, records)
    return Remainder(learned, instead, depends_on, rms(before), rms(after))


def dependences(
    replayer: Replayer, value: Floats, records: Sequence[Record]
) -> tuple[Dependence, ...]:
    """What each quantity explains of the remainder (n,) by itself, on the report split."""
    measured, names = replayer.measured, [c.name for c in replayer.system.study.channels]
    role = split(measured)
    report = role == REPORT
    power = float(np.sum(value[report] ** 2)) or 1.0
    found = []
    for name, features in _quantities(records, measured):
        prediction = np.zeros(len(value))
        for channel in np.unique(measured.channel):
            at = np.flatnonzero(measured.channel == channel)
            prediction[at] = _regress(value[at], features[at], role[at] == FIT)
        gone = value**2 - (value - prediction) ** 2
        share = float(np.sum(gone[report])) / power
        if share > LEAST:
            sums = np.bincount(measured.channel[report], gone[report], minlength=len(names))
            found.append(Dependence(name, names[int(np.argmax(sums))], share))
    return tuple(sorted(found, key=lambda d: -d.fraction)[:5])


def _regress(value: Floats, features: Floats, fit: NDArray[np.bool_]) -> Floats:
    x = np.hstack([np.ones((len(features), 1)), features])
    gram = x[fit].T @ x[fit] + RIDGE * np.eye(x.shape[1])
    return x @ np.linalg.solve(gram, x[fit].T @ value[fit])


def _quantities(records: Sequence[Record], measured: Measured) -> list[tuple[str, Floats]]:
    """What the machine did at the time of every reading: name and features (n, k)."""
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
    x = (values - values.mean()) / (values.std() + 1e-12)
    return np.column_stack([x, x**2, x**3])


def _sample(columns: list[Floats], records: Sequence[Record], measured: Measured) -> Floats:
    values = np.zeros(len(measured.time))
    for e, (column, record) in enumerate(zip(columns, records, strict=True)):
        at = measured.episode == e
        values[at] = np.interp(measured.time[at] + record.time[0], record.time, column)
    return values

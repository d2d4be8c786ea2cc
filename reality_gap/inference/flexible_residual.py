"""The learned residual: what any mechanism could explain, whatever its name.

Banks of functions stand for everything that has no name. Forces: a torque at each joint that is any
function of its position, with or without its direction of motion, and a force on each wire that
is any function of its length, sent through the machine as an effort that nobody commanded; a sensor
of the wire's tension may feel it or not. Readings: each channel hears any other,
or errs by any function of a joint's position. The few
that explain most are learned in closed form, each at the price of its freedom. They never count as
a cause: they are the upper bound of what there is to explain, and what they explain beyond the
named causes is unexplained.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reality_gap.causes.base import Record
from reality_gap.inference.likelihood import NoiseModel
from reality_gap.inference.unmodelled_forces import FORCE, push
from reality_gap.simulation.hypothesis import build
from reality_gap.simulation.replayer import Hypothesis, Replayer
from reality_gap.study.measurements import Measured
from reality_gap.study.splits import REPORT, split
from reality_gap.study.system import ActuatedTendon, System
from reality_gap.types import Floats

WAVES = 28
"""Half waves over the range of a joint, at most."""
BUMPS = 8
"""Places along the range where the direction of motion may matter."""
EDGES = (0.8, 0.9, 0.96)
"""Shares of the range from which on something may be in the way, from either end."""
PITCH = 0.003
"""Shortest wave over a wire's length [m]."""
MOST = 200
"""Replays at most; with many joints, fewer waves."""
SIZE = 3.0
"""Prior deviation of a weight; with weight 1, a column has the size of the noise."""
MOST_COLUMNS = 6
"""Columns of a bank that are learned, at most."""


@dataclass(frozen=True)
class Bank:
    """Columns (n, k) in units of noise, each of mean square 1, and what they stand for."""

    name: str
    columns: Floats


def banks(replayer: Replayer, base: Hypothesis, records: Sequence[Record]) -> tuple[Bank, ...]:
    """All functions, as changes of the prediction of ``base``, whose replay gave ``records``."""
    found = [_crosstalk(replayer), *_errors(replayer, records)]
    if not replayer.system.study.inverse:
        found += _forces(replayer, base, records)
    return tuple(found)


def _crosstalk(replayer: Replayer) -> Bank:
    """Every channel hears every other sensor of the log."""
    measured, study = replayer.measured, replayer.system.study
    columns = []
    for heard in range(len(study.channels)):
        signal = _everywhere(measured, heard)
        for channel in range(len(study.channels)):
            if channel != heard and len(study.channels) <= 20:
                columns.append(np.where(measured.channel == channel, signal, 0.0))
    stacked = np.column_stack(columns) if columns else np.zeros((len(measured.value), 0))
    return Bank("readings of each other", _unit(stacked))


def _everywhere(measured: Measured, channel: int) -> Floats:
    """A channel's readings at the times of all readings (n,)."""
    signal = np.zeros(len(measured.value))
    for e in np.unique(measured.episode):
        here = measured.episode == e
        own = here & (measured.channel == channel)
        if own.any():
            signal[here] = np.interp(measured.time[here], measured.time[own], measured.value[own])
    return signal


def _errors(replayer: Replayer, records: Sequence[Record]) -> list[Bank]:
    """Every channel errs by a function of a joint's position."""
    measured = replayer.measured
    moving = _moving(replayer.system, records)
    found = []
    for name in moving:
        at = records[0].model.joint(name).qposadr[0]
        position = np.zeros(len(measured.value))
        for e, record in enumerate(records):
            here = measured.episode == e
            now = measured.time[here] + record.time[0]
            position[here] = np.interp(now, record.time, record.qpos[:, at])
        phase = (position - position.min()) / np.ptp(position)
        waves = np.cos(np.pi * phase[:, None] * np.arange(2, _waves(moving) + 1))
        columns = [
            np.where((measured.channel == c)[:, None], waves, 0.0)
            for c in np.unique(measured.channel)
            if len(moving) <= 3
        ]
        if columns:
            found.append(Bank(f"readings by position of {name}", _unit(np.hstack(columns))))
    return found


def _moving(system: System, records: Sequence[Record]) -> list[str]:
    return [name for name in system.joints if _travel(records, name) > 1e-3]


def _waves(moving: Sequence[str]) -> int:
    return min(WAVES, max(4, MOST // (2 * len(moving))))


def _forces(replayer: Replayer, base: Hypothesis, records: Sequence[Record]) -> list[Bank]:
    system = replayer.system
    # Hooks are slow, and a little force moves the machine about as far without them.
    quick = [part for part in base if not build(system, [part]).effects.hooks]
    before = replayer.residuals([quick], replayer.coarse)[0]

    moving = _moving(system, records)
    pushes = {
        f"position of {name}": [
            push("joint", name, records, series)
            for series in _functions(records, name, _waves(moving))
        ]
        for name in moving
    }
    along = {tendon: _by_length(records, tendon, len(system.tendons)) for tendon in system.tendons}
    for tendon, series in along.items():
        pushes[f"length of {tendon.name}"] = [
            push("tendon", tendon.name, records, one) for one in series
        ]
    trials = [[*quick, (one, {"size": 1.0})] for some in pushes.values() for one in some]
    moved = iter(replayer.residuals(trials, replayer.coarse))
    columns = {name: [before - next(moved) for _ in some] for name, some in pushes.items()}
    found = [_bank(name, some) for name, some in columns.items() if some]
    for tendon, series in along.items():
        felt = [_felt(replayer, tendon, records, one) for one in series]
        own = columns[f"length of {tendon.name}"]
        both = [a + b for a, b in zip(own, felt, strict=True)]
        if both:
            found.append(_bank(f"length of {tendon.name}, felt by its sensor", both))
    return found


def _bank(name: str, columns: Sequence[Floats]) -> Bank:
    return Bank(name, _unit(np.nan_to_num(np.column_stack(columns))))


def _by_length(
    records: Sequence[Record], tendon: ActuatedTendon, tendons: int
) -> list[list[Floats]]:
    """Series of force by episode [N]: waves over the length of a wire."""
    at = records[0].model.tendon(tendon.name).id
    length = [r.length[:, at] for r in records]
    travel = float(np.ptp(np.concatenate(length)))
    count = min(int(travel / PITCH), MOST // (2 * tendons))
    if count < 2:
        return []
    phase = [2 * np.pi * x / travel for x in length]
    return [[wave(m * x) for x in phase] for m in range(1, count + 1) for wave in (np.cos, np.sin)]


def _felt(
    replayer: Replayer, tendon: ActuatedTendon, records: Sequence[Record], series: list[Floats]
) -> Floats:
    """What a force on a wire adds to the readings of its tension (n,), in units of noise."""
    measured, study = replayer.measured, replayer.system.study
    force = FORCE["tendon"] * np.concatenate(series)
    clock = np.concatenate([r.time for r in records])
    start = np.array([r.time[0] for r in records])[measured.episode]
    felt = np.interp(measured.time + start, clock, force)
    own = [
        c for c, channel in enumerate(study.channels) if channel.sensor in tendon.tension_sensors
    ]
    return np.where(np.isin(measured.channel, own), felt, 0.0) / measured.noise


def _travel(records: Sequence[Record], joint: str) -> float:
    column = records[0].model.joint(joint).qposadr[0]
    return float(np.ptp(np.concatenate([r.qpos[:, column] for r in records])))


def _functions(records: Sequence[Record], joint: str, waves: int) -> list[list[Floats]]:
    """Series of torque by episode [N m or N].

    Waves, what grows from somewhere near an end of the range on, and bumps by direction of motion.
    """
    model = records[0].model
    at, dof = model.joint(joint).qposadr[0], model.joint(joint).dofadr[0]
    position = [r.qpos[:, at] for r in records]
    low = min(float(p.min()) for p in position)
    width = max(float(p.max()) for p in position) - low
    speed = 0.1 * float(np.sqrt(np.mean(np.concatenate([r.qvel[:, dof] for r in records]) ** 2)))
    phase = [(p - low) / width for p in position]
    way = [np.tanh(r.qvel[:, dof] / (speed + 1e-9)) for r in records]
    found = []
    for m in range(1, waves + 1):
        found.append([np.cos(np.pi * m * x) for x in phase])
    for edge in EDGES:
        found.append([np.maximum(0.0, x - edge) for x in phase])
        found.append([np.maximum(0.0, (1.0 - edge) - x) for x in phase])
    count = max(2, BUMPS * waves // WAVES)
    for centre in (np.arange(count) + 0.5) / count:
        bump = [np.exp(-0.5 * ((x - centre) * count) ** 2) for x in phase]
        found.append([b * w for b, w in zip(bump, way, strict=True)])
    return found


def _unit(columns: Floats) -> Floats:
    size = np.sqrt(np.mean(columns**2, axis=0))
    return columns[:, size > 1e-9] / size[size > 1e-9]


@dataclass(frozen=True)
class Learned:
    """What a bank explains of a residual.

    Attributes:
        name: of the bank.
        evidence: by how much the log marginal likelihood of fit and choose splits rises [nats].
        prediction: (n,) of the residual, in units of noise.
        explained: share of the power of the residual on the report split; may be negative.
    """

    name: str
    evidence: float
    prediction: Floats
    explained: float


def learn(replayer: Replayer, rule: NoiseModel, residual: Floats, bank: Bank) -> Learned:
    """Learn a residual (n,) by the few columns of a bank that explain it best.

    Columns come in one by one, each at the price of its freedom and of having been chosen.
    """
    columns, left = rule.learn(bank.columns), rule.learn(residual)
    gram, right = columns.T @ columns, columns.T @ left
    count = len(right)
    chosen: list[int] = []
    best, weight = 0.0, np.zeros(0)
    while len(chosen) < min(MOST_COLUMNS, count):
        trials = [
            (_evidence(gram, right, [*chosen, j]), j) for j in _candidates(gram, right, chosen)
        ]
        evidence, j = max(trials)
        price = sum(np.log(count - i) for i in range(len(chosen) + 1))
        if evidence - price < best + 1.0:
            break
        chosen.append(j)
        best = evidence - price
        weight = _weights(gram, right, chosen)
    prediction = bank.columns[:, chosen] @ weight if chosen else np.zeros(len(residual))
    report = split(replayer.measured) == REPORT
    power = float(np.sum(residual[report] ** 2))
    gone = power - float(np.sum((residual[report] - prediction[report]) ** 2))
    return Learned(bank.name, best, prediction, gone / power if power else 0.0)


def _candidates(gram: Floats, right: Floats, chosen: list[int]) -> list[int]:
    """The columns most like what the chosen ones leave."""
    left = right - gram[:, chosen] @ _weights(gram, right, chosen) if chosen else right
    score = left**2 / (np.diag(gram) + 1e-9)
    score[chosen] = -1.0
    return [int(j) for j in np.argsort(-score)[:5]]


def _weights(gram: Floats, right: Floats, chosen: list[int]) -> Floats:
    part = gram[np.ix_(chosen, chosen)] + np.eye(len(chosen)) / SIZE**2
    weights: Floats = np.linalg.solve(part, right[chosen]).astype(np.float64)
    return weights


def _evidence(gram: Floats, right: Floats, chosen: list[int]) -> float:
    """Log marginal likelihood of weights with prior deviation `SIZE` [nats]."""
    part = gram[np.ix_(chosen, chosen)]
    weight = _weights(gram, right, chosen)
    _, room = np.linalg.slogdet(np.eye(len(chosen)) + SIZE**2 * part)
    return 0.5 * float(right[chosen] @ weight - room)

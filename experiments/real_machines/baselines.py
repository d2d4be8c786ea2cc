"""Baselines of the diagnosis: models with parameters that a person frees, fitted by least squares.

A baseline edits every moving joint of the nominal model in the same way, and is fitted to the
readings that the diagnosis may fit, too. Its parameters are multiples of scales that follow from
the machine: its inertia, its effort and its speed. Fits start from several points, because dry
friction makes the misfit rough.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.optimize import least_squares

from jmm_agent.types import Floats
from reality_gap.causes.base import Effects, Record
from reality_gap.simulation.hypothesis import Plant
from reality_gap.simulation.inverse_dynamics import ensure_prepared, inverse_replay
from reality_gap.simulation.replay import replay
from reality_gap.study.data import Study
from reality_gap.study.measurements import Measured, measured
from reality_gap.study.splits import REPORT, split

PACE = ("armature", "damping", "friction", "bias", "delay")
"""Parameters of PACE (arXiv 2509.06342): rotor inertia, viscous and dry friction, zero of the
encoder, and one delay."""
PERSON = ("mass", "damping", "friction", "armature", "gain")
"""Parameters that a person would free first."""
PERSON_EFFORT = ("mass", "damping", "friction", "offset")
"""The same where efforts are measured; this is the published model of the EMPS drive."""

STARTS = (0.02, 0.5)
"""Values of all parameters, in their scales, from which fits start."""
DIFFERENCE = 0.02
"""Step of finite differences in scales."""
EVALUATIONS = 40
"""Largest number of steps of one fit."""
BAD = 1e3
"""Residual of a replay that diverged [noise]."""


@dataclass(frozen=True)
class Baseline:
    """A fitted model.

    Attributes:
        values: parameters by name in SI units; mass and gain are relative errors.
        prediction: readings, shape (n,).
    """

    values: Mapping[str, float]
    prediction: Floats


@dataclass(frozen=True)
class Scales:
    """Typical sizes of the machine: inertia, effort and speed of a joint in SI units."""

    inertia: float
    effort: float
    speed: float

    def of(self, name: str) -> float:
        """Scale of a parameter."""
        return {
            "armature": 0.3 * self.inertia,
            "damping": 0.2 * self.effort / self.speed,
            "friction": 0.2 * self.effort,
            "bias": 0.05,
            "delay": 0.02,
            "mass": 0.3,
            "gain": 0.3,
            "offset": 0.1 * self.effort,
        }[name]


def fit(study: Study, names: tuple[str, ...]) -> Baseline:
    """Fit the parameters ``names`` to all readings but those of the report split."""
    study = ensure_prepared(study)
    readings = measured(study)
    use = split(readings) != REPORT
    scales = find_scales(study)
    size = np.array([scales.of(name) for name in names])
    low = np.array([bounds(name, scales)[0] for name in names]) / size
    high = np.array([bounds(name, scales)[1] for name in names]) / size

    def residual(x: Floats) -> Floats:
        values = dict(zip(names, x * size, strict=True))
        error = (predict(study, readings, values) - readings.value) / readings.noise
        return np.nan_to_num(error[use], nan=BAD, posinf=BAD, neginf=-BAD)

    def jacobian(x: Floats) -> Floats:
        here = residual(x)
        columns = []
        for k in range(len(x)):
            step = DIFFERENCE if x[k] + DIFFERENCE < high[k] else -DIFFERENCE
            moved = x.copy()
            moved[k] += step
            columns.append((residual(moved) - here) / step)
        return np.column_stack(columns)

    found = [
        least_squares(
            residual,
            np.clip(np.full(len(names), start), low + 1e-6, high - 1e-6),
            jacobian,
            bounds=(low, high),
            max_nfev=EVALUATIONS,
            xtol=1e-4,
            ftol=1e-5,
        )
        for start in STARTS
    ]
    best = min(found, key=lambda one: float(one.cost))
    values = dict(zip(names, (float(x) for x in best.x * size), strict=True))
    return Baseline(values, predict(study, readings, values))


def bounds(name: str, scales: Scales) -> tuple[float, float]:
    """Bounds of a parameter in SI units."""
    if name in ("bias", "offset"):
        return -10.0 * scales.of(name), 10.0 * scales.of(name)
    if name in ("mass", "gain"):
        return -0.95, 3.0
    return 0.0, 20.0 * scales.of(name)


def find_scales(study: Study) -> Scales:
    """Find the typical sizes of a machine from its nominal model along the log."""
    readings = measured(study)
    model = study.spec().compile()
    plant = Plant(study.spec(), Effects())
    if study.inverse:
        effort = float(np.sqrt(np.mean(readings.value**2)))
        records = inverse_replay(plant, study, readings).records
    else:
        records = replay(plant, study, readings).records
        effort = float(np.sqrt(np.mean(np.concatenate([r.force for r in records]) ** 2)))
    speed = float(np.sqrt(np.mean(np.concatenate([r.qvel for r in records]) ** 2)))
    return Scales(float(model.dof_M0.max()), effort, max(speed, 1e-3))


def predict(study: Study, readings: Measured, values: Mapping[str, float]) -> Floats:
    """Predict the readings of a prepared study, shape (n,).

    Args:
        study: the study.
        readings: its readings.
        values: parameters by name in SI units; mass and gain are relative errors.
    """
    spec = study.spec()
    for joint in spec.joints:
        joint.armature += values.get("armature", 0.0)
        joint.damping[0] += values.get("damping", 0.0)
        joint.frictionloss += values.get("friction", 0.0)
    for geom in spec.geoms:  # whose mass is NaN if it follows from the density
        geom.mass *= 1.0 + values.get("mass", 0.0)
        geom.density *= 1.0 + values.get("mass", 0.0)
    for actuator in spec.actuators:
        actuator.gainprm[0] *= 1.0 + values.get("gain", 0.0)
        actuator.biasprm[1] *= 1.0 + values.get("gain", 0.0)
    plant = Plant(spec, _effects(study, values))
    if study.inverse:
        return inverse_replay(plant, study, readings).prediction
    return replay(plant, study, readings).prediction


def _effects(study: Study, values: Mapping[str, float]) -> Effects:
    bias, delay, offset = (values.get(name, 0.0) for name in ("bias", "delay", "offset"))
    effects = Effects()

    def command(model: mujoco.MjModel, time: Floats, command: Floats) -> Floats:
        late = [np.interp(time - delay, time, column) for column in command.T]
        return np.column_stack(late) - bias

    def reading(record: Record) -> None:
        for channel in study.channels:
            record.sensors[:, record.column(channel.sensor, channel.component)] += bias

    def effort(model: mujoco.MjModel, time: Floats, effort: Floats) -> None:
        for column in effort.T:
            column[:] = np.interp(time - delay, time, column) + offset

    if study.inverse:
        effects.efforts.append(effort)
    else:
        effects.commands.append(command)
        effects.readings.append(reading)
    return effects

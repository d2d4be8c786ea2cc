"""Hypotheses: candidate causes with parameter values, and the plants that they describe."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from reality_gap.causes import CATALOGUE
from reality_gap.causes.base import Cause, Effects, Location, Parameter, Values
from reality_gap.causes.support.own_amounts import OWN
from reality_gap.causes.support.shared_amounts import FACTOR
from reality_gap.study.system import System


@dataclass(frozen=True)
class Candidate:
    """A cause at a location.

    Attributes:
        cause: the mechanism.
        location: the model elements where it acts.
        parameters: the cause's parameters at this location.
    """

    cause: Cause
    location: Location
    parameters: tuple[Parameter, ...]

    def __str__(self) -> str:
        return f"{self.cause.id} at {self.location}"

    def parameter(self, name: str) -> Parameter:
        """Return the parameter of this name."""
        return next(p for p in self.parameters if p.name == name)

    def null_values(self) -> dict[str, float]:
        """Return the parameter values at which the cause has no effect."""
        return {parameter.name: parameter.null for parameter in self.parameters}

    def includes(self, other: Candidate) -> bool:
        """Return whether the other candidate is a special case of this one."""
        special = other.cause.id in self.cause.includes and self.location.acts_on(other.location)
        return special or self.covers(other)

    def covers(self, other: Candidate) -> bool:
        """Return whether this is the same cause at all joints, and the other at some of them."""
        mine, its = self.location, other.location
        return (
            self.cause.id == other.cause.id
            and mine.note == OWN
            and its.note in ("", FACTOR)
            and (mine.kind, mine.log) == (its.kind, its.log)
            and set(its.elements) <= set(mine.elements)
        )

    def matches(self, other: Candidate) -> bool:
        """Return whether the other candidate is the same cause at the same location."""
        return self.cause.id == other.cause.id and self.location == other.location


Part = tuple[Candidate, Values]
"""A candidate with parameter values."""
Hypothesis = Sequence[Part]
"""The candidates that a model is extended by, with their values."""


@dataclass(frozen=True)
class Plant:
    """A model with the effects of a hypothesis.

    Attributes:
        spec: the model, with all edits that MuJoCo can express.
        effects: the effects that MuJoCo cannot express.
        edits: keys of the edits in ``spec``; plants with equal edits have equal models.
    """

    spec: mujoco.MjSpec
    effects: Effects
    edits: tuple[Hashable, ...] = ()


def in_log(hypothesis: Hypothesis, log: str) -> list[Part]:
    """Return what a hypothesis is in one log, with candidates that act in all logs.

    The deviations of a cause that acts in all logs, and in this one in addition, are added.

    Args:
        hypothesis: candidates with their values.
        log: name of the log; empty for what is the same in all logs.
    """
    found = dict[tuple[str, Location], Part]()
    for candidate, values in hypothesis:
        if candidate.location.log not in ("", log):
            continue
        everywhere = replace(candidate, location=replace(candidate.location, log=""))
        key = candidate.cause.id, everywhere.location
        if key in found:
            values = added(candidate, found[key][1], values)
        found[key] = everywhere, values
    return list(found.values())


def added(candidate: Candidate, values: Values, others: Values) -> Values:
    """Return the sum of two deviations of a candidate from its null values, within its bounds."""
    return {
        p.name: float(np.clip(values[p.name] + others[p.name] - p.null, p.low, p.high))
        for p in candidate.parameters
    }


def build(system: System, hypothesis: Hypothesis, nominal: mujoco.MjSpec | None = None) -> Plant:
    """Build a plant from the study's model and a hypothesis.

    Candidates are added in the order of the catalogue, in which effects on readings come last.
    Candidates with null values are left out, and those that act in one log only; see `in_log`.

    Args:
        system: the study's model and its elements; the plant has its model's time step.
        hypothesis: candidates with their values.
        nominal: a model with the same elements in place of the study's; it is not changed.

    Returns:
        A plant with a copy of the model.
    """
    spec = system.study.spec() if nominal is None else nominal.copy()
    spec.option.timestep = float(system.model.opt.timestep)
    _fix_damping(spec, system.model)
    effects, edits = Effects(), []
    order = {name: i for i, name in enumerate(CATALOGUE)}
    for candidate, values in sorted(hypothesis, key=lambda part: order.get(part[0].cause.id, 0)):
        unchanged = all(values[p.name] == p.null for p in candidate.parameters)
        if unchanged or candidate.location.log:
            continue
        cause, location = candidate.cause, candidate.location
        if cause.edit is not None:
            cause.edit(spec, system, location, values)
            edits.append((cause.id, location, tuple(sorted(values.items()))))
        if cause.attach is not None:
            cause.attach(effects, system, location, values)
    return Plant(spec, effects, tuple(edits))


def _fix_damping(spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    """Replace the damping ratios of servos by their velocity gains in the nominal model.

    The compiler computes such a gain from stiffness and inertia, so that causes that change these
    would change the damping as well; and it keeps the ratio itself where a gain is not its usual
    one, as positive feedback.
    """
    for index, actuator in enumerate(spec.actuators):
        if actuator.biastype == mujoco.mjtBias.mjBIAS_AFFINE and actuator.biasprm[2] > 0.0:
            actuator.biasprm[2] = float(model.actuator_biasprm[index, 2])


def has_effects(system: System, candidate: Candidate, values: Values) -> bool:
    """Return whether a candidate has effects that MuJoCo cannot express.

    Args:
        system: the study's model and its elements.
        candidate: the cause and its location.
        values: values of its parameters.
    """
    effects = build(system, [(candidate, values)]).effects
    return any(
        (effects.commands, effects.hooks, effects.readings, effects.motions, effects.efforts)
    )

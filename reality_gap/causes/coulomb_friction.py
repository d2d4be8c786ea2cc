"""Coulomb friction of a tendon in its guides, or of a joint.

Friction of a joint that the nominal model has (``frictionloss``) may also be too large: a negative
value takes it away. Where the force of a motor is measured, friction may also be between the motor
and its sensor, as in a gearbox in front of a load cell: the sensor then measures what is left.
"""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, SearchHints, Values
from reality_gap.causes.support import elements, lugre, motors, shared_amounts, typical_scales
from reality_gap.causes.support.own_amounts import with_own_amounts
from reality_gap.causes.support.shared_amounts import EXCESS, FACTOR, REDUCIBLE
from reality_gap.study.system import System

USUAL, SPREAD, SPREAD_BEFORE = 1.5e-3, 1.5e-3, 3e-3
"""Friction of a tendon whose nominal model has none, its standard deviation, and that of friction
before a force sensor, each as a share of the tendon's typical force."""
LEAST_BEFORE = 6e-3
"""Friction before a force sensor up to which it is not named, as the same share: that of a good
gearbox."""
ABOVE = 4.0
"""Largest friction that is added to that of a model, over that of the model."""
BEFORE = "before the force sensor"
"""Note of a location where the friction is between motors and the sensors of their forces."""


def _locations(system: System) -> tuple[Location, ...]:
    of_tendons = elements.each_tendon(system) + elements.all_tendons(system)
    every = shared_amounts.all_joints(system, system.model.dof_frictionloss)
    return of_tendons + elements.each_joint(system) + every + _before_sensors(system)


def _before_sensors(system: System) -> tuple[Location, ...]:
    """Return each element whose motor's force is measured, and all tendons of this kind."""
    if not lugre.is_available(system):
        return ()
    found = tuple(Location(m.kind, (m.element,), BEFORE) for m in motors.measured(system))
    tendons = tuple(one.elements[0] for one in found if one.kind == "tendon")
    return found + ((Location("tendon", tendons, BEFORE),) if len(tendons) > 1 else ())


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    if location.note == FACTOR:
        least = shared_amounts.least(system, location, system.model.dof_frictionloss)
        tolerance = typical_scales.force_tolerance(system, location) / least
        return (Parameter(EXCESS, "1", 0.2, tolerance, -1.0, 20.0, hints=REDUCIBLE),)
    if location.kind == "tendon":
        size = typical_scales.tendon_force(system, location)
        hints = SearchHints(secants=elements.secants(system, location, (0.2 * size,)))
        each = [Location("tendon", (name,)) for name in location.elements]
        mean = float(np.mean([typical_scales.tendon_force(system, one) for one in each]))
        usual, spread, least = USUAL * mean, SPREAD * mean, 0.0
        if location.note == BEFORE:
            usual, spread, least = 0.0, SPREAD_BEFORE * mean, LEAST_BEFORE * mean
        elif lugre.has_nominal_friction(system, location):
            usual = 0.0
        sizes = (0.03 * size, spread, 0.0, 2.0 * size)
        friction = Parameter("friction", "N", *sizes, hints=hints, usual=usual, least=least)
    else:
        unit, size = typical_scales.weakest_force(system, location)
        nominal = shared_amounts.least(system, location, system.model.dof_frictionloss)
        tolerance = typical_scales.force_tolerance(system, location)
        low = 0.0 if location.note == BEFORE else -nominal
        secants = elements.secants(system, location, (0.1 * size, 0.4 * size))
        if low < 0.0:  # where a joint of the model sticks, a little less friction does nothing
            secants += elements.secants(system, location, (-0.4 * nominal, -0.8 * nominal))
        most = typical_scales.most_friction(system, location)
        sizes = (0.02 * size, tolerance, low, max(most * size, ABOVE * nominal))
        hints = SearchHints(secants=secants, absence=low < 0.0)
        friction = Parameter("friction", unit, *sizes, hints=hints)
    creep = () if location.note == BEFORE else lugre.creep_parameters(system, location)
    return (friction, *lugre.presliding_parameters(system, location), *creep)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    if location.kind == "joint" and (location.note == FACTOR or values["friction"] < 0.0):
        nominal = system.model.dof_frictionloss
        added = shared_amounts.amounts(system, location, nominal, "friction", values)
        for name, amount in added.items():
            joint = spec.joint(name)
            joint.frictionloss = max(0.0, joint.frictionloss + amount)
    elif values["friction"]:
        lugre.add_friction(spec, system, CAUSE.id, location, values["friction"], values)


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    if location.note != BEFORE or not values["friction"]:
        return
    added = lugre.friction_actuators(system, CAUSE.id, location)
    measured = [m for m in motors.measured(system) if m.element in added]

    def subtract(record: Record) -> None:
        for motor in measured:
            force = record.force[:, record.model.actuator(added[motor.element]).id] / motor.gear
            for sensor in motor.sensors:
                record.sensors[:, record.column(sensor)] += force

    effects.readings.append(subtract)


CAUSE = with_own_amounts(
    Cause(
        id="coulomb_friction",
        title="Coulomb friction",
        explanation=(
            "A force of constant size opposes the motion, so that an element sticks and lags."
        ),
        locations=_locations,
        parameters=_parameters,
        edit=_edit,
        attach=_attach,
        sticky=True,
    )
)
